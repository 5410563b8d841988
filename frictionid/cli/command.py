"""What commands share: options and arguments, and what is shown: bars, nothing with --quiet.

Wrong paths are refused before imports.
"""

import inspect
import io
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from typer.models import ParameterInfo

from frictionid.errors import InputError
from frictionid.progress import Done, compiling, listening

# Of commands that do not say themselves what such an option does.
COMMON = """
data : Folder with the tables.
dataset : Folder with dataset.toml, that file, or a name, e.g. acrobot_clean.
equal : Joints with the same friction, e.g. hip_left,hip_right; repeatable.
files : MODEL.json ... DATASET
folder : Result folder of a comparison.
json : Print all numbers as JSON.
law : Class of a law that is not built in, module:Class; repeatable.
model : Model file, or machine:NAME.
models : MODEL.json MODEL.json ...
only : Name of a recording to take; repeatable [all].
other : A second one, to say what changed.
replace : Write over files that exist (never over what is read).
require : Exit with 1 unless the verdict on every data set is this: recommended, simple_enough,
    undecided, or QUESTION=ANSWER as in verdict.json; repeatable.
sample_time : Use samples at least this far apart [s].
suite : Suite file, or the name of one, e.g. acrobot.
trust : Run code that a suite or data set names by its module.
"""


def add_command(app: typer.Typer, command: Callable[..., None], name: str | None = None) -> None:
    """Add a command, under another name than its function's where one is given.

    Positional parameters are arguments, keyword-only ones options. What they do stands in the
    section Parameters of the docstring, or else above. Integers are not negative. A function that a
    type names, as Annotated[Path, present], checks the value.
    """
    summary, _, section = (inspect.getdoc(command) or "").partition("\n\nParameters\n----------\n")
    texts = dict(re.findall(r"^(\w+) : (.*(?:\n +.*)*)", COMMON + section, re.MULTILINE))
    hints = get_type_hints(command, include_extras=True)
    for key, parameter in inspect.signature(command).parameters.items():
        text = " ".join(texts.get(key, "").split())
        command.__annotations__[key] = _described(hints[key], parameter, text)
    app.command(name, help=summary)(command)


def _described(hint: Any, parameter: Parameter, text: str) -> Any:
    """The type of a parameter with what the command line makes of it."""
    kind, note = get_args(hint) if get_origin(hint) is Annotated else (hint, None)
    if isinstance(note, ParameterInfo):
        note.help = note.help or text
    elif parameter.kind is Parameter.KEYWORD_ONLY:
        option = f"--{parameter.name.rstrip('_').replace('_', '-')}"
        least = 0 if kind in (int, int | None) else None
        note = typer.Option(option, help=text, min=least, callback=note)
    else:
        note = typer.Argument(help=text, callback=note)
    return Annotated[kind, note]


def numbers(option: str, text: str, rule: str, count: int | None = None) -> list[float]:
    """Finite numbers of an option, with commas.

    count : of numbers, where that is fixed

    >>> numbers("--windows", "0.1,0.3", "be lengths in seconds, e.g. --windows 0.1,0.3")
    [0.1, 0.3]
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = [math.nan]
    if not all(map(math.isfinite, values)) or len(values) != (count or len(values)):
        raise InputError(f"{option} {text!r} must {rule}")
    return values


def settings(texts: Iterable[str]) -> dict[str, Any]:
    """Settings by key; a dot in a key leads into a table, as in TOML.

    Raises
    ------
    InputError
        As `setting`, and for a key that is a value and a table.

    >>> settings(["symmetric=false", "bounds.viscous=[0, 1]", "bounds.coulomb=[0, 2]"])
    {'symmetric': False, 'bounds': {'viscous': [0, 1], 'coulomb': [0, 2]}}
    """
    out: dict[str, Any] = {}
    for key, value in map(setting, texts):
        *tables, name = key.split(".")
        place = out
        for table in tables:
            place = place.setdefault(table, {})
            if not isinstance(place, dict):
                raise InputError(f"--set {key}: {table!r} is a value already, and no table")
        place[name] = value
    return out


def setting(text: str) -> tuple[str, Any]:
    """Key and value of a setting, the value read as TOML where it is, else as text.

    Raises
    ------
    InputError
        Where there is no key, or no equals sign.

    >>> setting("symmetric=false"), setting("shape = arctan"), setting("mass=.4")
    (('symmetric', False), ('shape', ' arctan'), ('mass', 0.4))
    """
    from frictionid.config import parse_toml

    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--set {text!r} must be key=value, e.g. --set symmetric=false")
    try:
        read = parse_toml(f"x = {value}", "--set")
    except InputError:
        read = {}
    if re.fullmatch(r"[-+]?(\.\d+|\d+\.)", value.strip()):  # which TOML does not know as numbers
        return key.strip(), float(value)
    return key.strip(), read["x"] if set(read) == {"x"} else value


def _dataset(path: Path) -> Path:
    from frictionid.files import dataset_path

    dataset_path(path)
    return path


def _suite(path: Path) -> Path:
    from frictionid.files import suite_path

    return suite_path(path)


def present(path: Path | None) -> Path | None:
    """The path of a file or folder that a command reads; InputError where there is none."""
    from frictionid.files import model_path, regular_file

    if path is not None and not regular_file(model_path(path)).exists():
        raise InputError(f"{path}: no such file; correct the path")
    return path


def _results(folder: Path | None) -> Path | None:
    if folder is None:
        return None
    if folder.is_dir() and not [*folder.glob("provenance.json"), *folder.glob("unfinished")]:
        raise InputError(f"{folder} holds no comparison; name a folder that compare wrote")
    if not (folder / "unfinished/provenance.json").exists():  # that was interrupted
        present(folder / "provenance.json")
    return folder


def _models_and_dataset(paths: list[Path]) -> list[Path]:
    _models(paths[:-1])
    if len(paths) > 1:
        _dataset(paths[-1])
    return paths


def _models(paths: list[Path]) -> list[Path]:
    for path in paths:
        present(path)
    return paths


DatasetPath = Annotated[Path, _dataset]
SuitePath = Annotated[Path, _suite]
ResultFolder = Annotated[Path, _results]
OtherFolder = Annotated[Path | None, _results]
PresentPath = Annotated[Path, present]
ModelPaths = Annotated[list[Path], _models]
ModelsAndDataset = Annotated[list[Path], _models_and_dataset]
PresentOrNone = Annotated[Path | None, present]


def check_files(
    written: Iterable[Path | None],
    read: Iterable[Path | None],
    dataset: Path,
    data: Path | None = None,
    *,
    replace: bool,
) -> None:
    """Refuse files to write that exist or are read, those of a data set among these."""
    from frictionid.data.readers.dataset import dataset_files
    from frictionid.outputs import check_outputs

    check_outputs(written, [*read, *dataset_files(dataset, data)], replace=replace)


# --- What a command shows: a progress bar, nothing with --quiet, advice after Ctrl-C --------------

QUIET = ("--quiet", "-q")
COMPILING = "compiling, once on this machine"


_NOWHERE = io.StringIO()  # output that is dropped


def is_quiet() -> bool:
    """Whether nothing is printed but errors."""
    return sys.stdout is _NOWHERE


@contextmanager
def without_quiet(words: Sequence[str]) -> Iterator[list[str]]:
    """Arguments of the command line without --quiet; where it was among them, output is dropped."""
    rest = [word for word in words if word not in QUIET]
    if len(rest) == len(words):
        yield rest
        return
    with redirect_stdout(_NOWHERE):
        yield rest


def show(
    text: object, document: Mapping[str, Any], written: Iterable[Path | None] = (), *, json: bool
) -> None:
    """Print a result and the files that were written: in words, or with `json` all its numbers."""
    from frictionid.files import json_text

    paths = [path for path in written if path is not None]
    if json:
        print(json_text({**document, **({"written": paths} if paths else {})}), end="")
        return
    for line in (str(text), *(f"written to {path}" for path in paths)):
        if line:
            print(line)


@contextmanager
def interruptible(advice: str) -> Iterator[None]:
    """Work that Ctrl-C ends with one line of advice and exit status 130."""
    try:
        yield
    except KeyboardInterrupt:
        typer.echo(f"frictionid: interrupted; {advice}", err=True)
        raise typer.Exit(130) from None


@contextmanager
def counted(total: int, title: str, first: str = "") -> Iterator[Done]:
    """A bar of `total` steps; call what it gives after each step, with what stands behind the bar.

    first : what stands there before
    """
    with _bar(total, title, first) as (bar, task):
        yield lambda name: bar.update(task, advance=1, last=_plain(name))


@contextmanager
def heard(title: str) -> Iterator[None]:
    """A bar of the steps that the work inside reports, see `frictionid.progress`."""
    with _bar(None, title, "") as (bar, task):

        def step(what: str, left: int) -> None:
            done = bar.tasks[0].completed + 1
            bar.update(task, completed=done, total=done + left, last=_plain(what))

        with listening(step):
            yield


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)


@contextmanager
def _bar(total: int | None, title: str, first: str) -> Iterator[tuple[Any, Any]]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("[dim]{task.fields[last]}"),
    )
    hidden, both = not console.is_terminal or is_quiet(), sys.stdout.isatty()
    with Progress(*columns, console=console, disable=hidden, redirect_stdout=both) as bar:
        task = bar.add_task(_plain(title), total=total, last=_plain(first))
        with compiling(lambda what: bar.update(task, last=f"{COMPILING}: {_plain(what)}")):
            yield bar, task


@contextmanager
def said_once() -> Iterator[None]:
    """A line on a terminal where loops are compiled while no bar is shown."""
    said = False

    def say(_: str) -> None:
        nonlocal said
        if not said and sys.stderr.isatty() and not is_quiet():
            typer.echo(f"{COMPILING} (frictionid warm does it ahead) ...", err=True)
        said = True

    with compiling(say):
        yield


@contextmanager
def running(names: Sequence[str], title: str, jobs: int = 1) -> Iterator[Done]:
    """A bar that shows what runs; call what it gives with the name of each finished step.

    Where no terminal shows it, each finished step is a line.

    names : of all steps, in the order in which they begin, `jobs` at a time
    """
    left = list(names)

    def now() -> str:
        return ", ".join(left[:jobs])

    with counted(len(left), title, now()) as count:

        def done(name: str) -> None:
            left.remove(name)
            count(now())
            if len(names) > 1 and not (sys.stderr.isatty() or is_quiet()):
                typer.echo(f"{len(names) - len(left)} of {len(names)} done: {name}", err=True)

        yield done
