"""The command line: everything heavy is imported when a command runs."""

import sys
import warnings
from functools import cache
from typing import Annotated, Any

import typer

from frictionid.cli.command import QUIET, add_command, said_once, without_quiet
from frictionid.cli.experiments import simulate, suggest
from frictionid.cli.fit import evaluate, fit, predict
from frictionid.cli.installed import data, identifiers, laws, mechanisms, warm
from frictionid.cli.start import check, init, quick
from frictionid.cli.suites import compare, report, sensitivity, tune
from frictionid.deploy.cli import baseline, compensate, export, monitor, pool, watch
from frictionid.errors import InputError
from frictionid.rig.cli import align, excite, log, render, simulate_drive, track

app = typer.Typer(
    name="frictionid",
    rich_markup_mode=None,  # brackets in help are units, not markup
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
for command in (
    init,
    quick,
    check,
    compare,
    fit,
    evaluate,
    predict,
    pool,
    export,
    compensate,
    report,
    baseline,
    monitor,
    watch,
    simulate,
    suggest,
    log,
    excite,
    align,
    simulate_drive,
    warm,
    tune,
    sensitivity,
    track,
    render,
    mechanisms,
    laws,
    identifiers,
):
    add_command(app, command)
app.add_typer(data, name="data")


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"frictionid {version('frictionid')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
    quiet: Annotated[
        bool, typer.Option(*QUIET, help="Print nothing but errors; after a command, too.")
    ] = False,
) -> None:
    """Identify friction in robot joints from recorded motion, and compare the models fairly."""


def main() -> int:
    """Run the command line; a user's mistake ends in one line and exit status 2."""
    words_or_help = sys.argv[1:] or ["--help"]
    with without_quiet(words_or_help) as words, warnings.catch_warnings(), said_once():
        if not sys.warnoptions:  # overflows of damaged numbers end in results that are refused
            warnings.filterwarnings("ignore", category=RuntimeWarning)
        return _run(words)


@cache
def _commands() -> Any:
    """All commands with their options."""
    return typer.main.get_command(app)


def _run(words: list[str]) -> int:
    try:
        return int(_commands()(args=words, standalone_mode=False) or 0)
    except InputError as error:
        return _complain(str(error), 2)
    except typer.Exit as stop:
        return int(stop.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        return _complain("interrupted", 130)
    except (OSError, MemoryError) as error:  # a full disk, a closed pipe, a small memory
        return _complain(_environment(error), 2)
    except Exception as error:
        shown = getattr(error, "format_message", None)  # click's complaints about arguments
        if shown is None:
            raise
        context = getattr(error, "ctx", None)
        name = f" {context.info_name}" if context is not None and context.parent else ""
        words = shown().replace("Value error, ", "").rstrip(".")
        return _complain(f"{words} (see frictionid{name} --help)", 2)


def _environment(error: OSError | MemoryError) -> str:
    """What the computer lacks, where no reader or writer could say it better."""
    if isinstance(error, MemoryError):
        return "the memory is too small for this: use fewer or shorter recordings"
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or error}: make room, or check the place"


def _complain(message: str, status: int) -> int:
    print(f"frictionid: {' '.join(message.split())}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
