"""frictionid init, check and quick: from tables of one's own to a first verdict."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import frictionid as fid
from frictionid.errors import InputError

from .command import (
    DatasetPath,
    ModelPaths,
    PresentOrNone,
    check_files,
    is_quiet,
    numbers,
    running,
    setting,
)

if TYPE_CHECKING:
    from frictionid.quickstart.describe_tables import Described, Known
    from frictionid.quickstart.tables import Tables


def init(
    tables: ModelPaths,
    *,
    mechanism: str = "",
    set_: list[str] | None = None,
    kt: str = "",
    gear: str = "",
    gains: str = "",
    time: str = "",
    angle: str = "",
    torque: str = "",
    replace: bool = False,
    json: bool = False,
) -> None:
    """Guess what the columns of tables are, and write dataset.toml and a first suite.toml.

    What is not given is asked for in a terminal.

    Parameters
    ----------
    tables : Tables of recordings, or their folder.
    mechanism : Kind, see: frictionid mechanisms; or a URDF, MJCF, or its folder.
    set_ : A parameter or option of it, e.g. mass=0.3, or a servo's limit=2 [N m]; repeatable.
    kt : Torque constant of the motors [N m/A], one, or one per joint with commas.
    gear : Turns of the motor per joint's, one, or one per joint with commas.
    gains : P,D of a controller that follows targets [N m/rad, N m s/rad].
    time : Column of the time; of tables without one the rate of their rows, e.g. '100 Hz'.
    angle : Columns of the angles, with commas, one per joint; guessed where none is given.
    torque : Columns of torques or currents, with commas, one per joint; guessed where none is
        given.
    """
    from frictionid.outputs import check_outputs
    from frictionid.quickstart.describe_tables import Known, describe_tables
    from frictionid.quickstart.tables import tables_at

    source = tables_at(tables, time)
    dataset_file, suite_file = (source.folder / f"{name}.toml" for name in ("dataset", "suite"))
    if not replace:
        _check_free(dataset_file)
    check_outputs([dataset_file, suite_file], replace=True)
    named = {"time": time, "angle": angle, "torque": torque}
    columns = {key: [c.strip() for c in text.split(",")] for key, text in named.items() if text}
    rule = "be P and D with a comma, e.g. --gains 20,1.5"
    two = numbers("--gains", gains, rule, 2) if gains else ()
    constants = _constants("--kt", kt), _constants("--gear", gear)
    sets = dict(map(setting, set_ or []))
    facts = Known(columns, *constants, (two[0], two[1]) if two else None, sets.pop("limit", None))
    robot = Path(mechanism)
    if robot.suffix and not robot.exists():
        raise InputError(f"--mechanism {mechanism}: no such file")
    if mechanism and robot.exists():
        from frictionid.quickstart.describe_robot import describe_robot
        from frictionid.quickstart.robot_columns import robot_file

        if not is_quiet():
            typer.echo(f"reading {robot} and the tables, which takes seconds ...", err=True)
        described = describe_robot(source, robot_file(robot), sets, facts)
    else:
        machine = _mechanism(mechanism, sets)
        described = describe_tables(source, machine, _motor(source, machine, facts))
    if not replace:
        _check_free(suite_file, left=described.suite_toml.encode())
    options = {"mechanism": mechanism, "kt": kt, "gear": gear, "gains": gains, **named}
    _write(source, described, json, _again(tables, described, options, set_ or []))


def _again(
    paths: list[Path], described: Described, options: dict[str, str], sets: list[str]
) -> str:
    """The call that gives constants of motors which are missing, joint by joint; or ""."""
    import shlex

    import numpy as np

    draft, missing = described.draft, False
    for key in {"kt", "gear"} & {*draft.motor}:
        each = [str(number) for number in np.ravel(draft.motor[key])]
        if draft.comments.get(f"motor.{key}", "").startswith("MISSING"):
            each, missing = [f"{key}_{joint}" for joint in draft.machine.joints], True
        options[key] = ",".join(each)
    if "locked" in draft.mechanism:
        sets = [*sets, f"joints={list(draft.machine.joints)}"]  # the last one counts
    words = [f"--{key}={text}" for key, text in options.items() if text]
    words += [f"--set={text}" for text in sets]
    said = shlex.join(["init", *map(str, paths), *words, "--replace"])
    return f"frictionid {said}" if missing else ""


def _check_free(file: Path, left: bytes | None = None) -> None:
    """What somebody has written is not overwritten unasked.

    Parameters
    ----------
    left : what an interrupted call leaves, which may stay
    """
    import os

    if os.path.lexists(file) and not (left and file.is_file() and file.read_bytes() == left):
        raise InputError(
            f"{file} is there already: edit it, rename it, or --replace to write over it"
        )


def _write(tables: Tables, described: Described, json: bool, again: str) -> None:
    import tomllib

    from frictionid.files import json_text, write_text
    from frictionid.quickstart.describe_robot import GEAR
    from frictionid.quickstart.describe_tables import GAINS

    # the suite first: a folder with a dataset.toml is done
    write_text(tables.folder / "suite.toml", described.suite_toml)
    write_text(tables.folder / "dataset.toml", described.dataset_toml)
    if json:
        texts = {"dataset": described.dataset_toml, "suite": described.suite_toml}
        read: dict[str, Any] = {name: tomllib.loads(text) for name, text in texts.items()}
        read["written"] = [tables.folder / f"{name}.toml" for name in texts]
        print(json_text(read), end="")
        return
    print(described.dataset_toml)
    print(f"written to {tables.folder / 'dataset.toml'} and {tables.folder / 'suite.toml'}")
    for text in described.draft.missing:
        print(f"missing: {text}")
    if again:
        print(f"with constants: {again}")
    command = "check" if described.draft.machine.kind in ("urdf", "mjcf") else "quick"
    first = "".join(
        f"write the {text.split()[0]} into dataset.toml, then "
        for text in described.draft.missing
        if text in (GAINS, GEAR)
    )
    print(f"next: {first}frictionid {command} {tables.folder}")


# --- What is not given ------------------------------------------------------------------------


def _mechanism(kind: str, values: dict[str, Any]) -> dict[str, Any]:
    """The [mechanism] table of the options, the rest asked for."""
    from frictionid.comparison.kind_descriptions import described, mechanisms
    from frictionid.config import nearest

    kinds = mechanisms()
    if not kind:
        if not _is_asked():
            raise InputError(
                f"init needs the mechanism: --mechanism {' or '.join(k.name for k in kinds)} "
                "(see frictionid mechanisms)"
            )
        kind = str(typer.prompt("mechanism", default=kinds[-1].name, err=True))
    machine = described(kinds, kind)
    options = {option.name for option in machine.settings}
    table = {"kind": kind, **{k: v for k, v in values.items() if k in options}}
    parameters = {k: v for k, v in values.items() if k not in options}
    names = [p.name for p in machine.parameters]
    for name in parameters:
        if name not in names:
            raise InputError(f"--set {name}: {kind} has no such parameter; {nearest(name, names)}")
    missing = [p for p in machine.parameters if not p.default and p.name not in parameters]
    if missing and not _is_asked():
        words = " ".join(f"--set {p.name}=..." for p in missing)
        said = ", ".join(f"{p.name} [{p.unit}] ({p.meaning})" for p in missing)
        raise InputError(f"{kind} needs {said}: add {words}")
    for p in missing:
        parameters[p.name] = _number(f"{p.name}, {p.meaning} [{p.unit}]")
    return {**table, "parameters": parameters}


def _motor(tables: Tables, machine: dict[str, Any], guesses: Known) -> Known:
    """The constants of motors whose currents are in the tables, asked for where not given."""
    from frictionid.quickstart.describe_tables import guess_tables

    if guesses.kt is not None or not _is_asked():
        return guesses
    if not guess_tables(tables, machine, guesses).is_current:
        return guesses
    kt = _number("kt, torque constant of the motor [N m/A]")
    gear = guesses.gear
    if gear is None:
        gear = _number("gear, turns of the motor for one of the joint")
    return guesses._replace(kt=kt, gear=gear)


def _constants(option: str, text: str) -> float | list[float] | None:
    """Number of an option, or numbers with commas; None where it is not given."""
    if not text:
        return None
    values = numbers(option, text, "be a number, or one per joint with commas")
    return values[0] if len(values) == 1 else values


def _is_asked() -> bool:
    """Whether somebody sits at a terminal who can answer."""
    import sys

    return sys.stdin.isatty() and sys.stderr.isatty()


def _number(what: str) -> float:
    return float(typer.prompt(what, type=float, err=True))


# --- Check and quick --------------------------------------------------------------------------


def check(
    dataset: DatasetPath,
    *,
    data: Path | None = None,
    json: bool = False,
    out: Path | None = None,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Report errors in recordings, what the recordings identify, and what to record next.

    Questions are answered by yes, NO, or not tested and why; yes means that the test could have
    failed. Of each motor's torque it says whether it is measured, commanded or modelled.

    The exit status is 0 where the data are good, 1 doubtful, 2 unusable as they stand.

    Parameters
    ----------
    out : Folder for pictures.
    """
    from frictionid.check import LEVELS
    from frictionid.report.diagnostics import picture_paths, write_pictures

    if out is not None:
        check_files(picture_paths(out), (), dataset, data, replace=replace)
    verdict = fid.check(fid.load_dataset(dataset, data, trust=trust))
    if json:
        print(verdict.json())
    else:
        verdict.show()
    if out:
        for path in write_pictures(verdict.details, out):
            typer.echo(f"written to {path}", err=True)
    raise typer.Exit(LEVELS.index(verdict.level))


def quick(
    dataset: DatasetPath,
    *,
    figure: Path | None = None,
    data: PresentOrNone = None,
    jobs: int = 0,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Check a data set, compare a few friction laws on held-out motion, and say which one holds.

    The exit status is 2 where the data are unusable, else 0.

    Parameters
    ----------
    figure : Picture to write (PNG) [quick-<name>.png, or the next number].
    jobs : Number of laws that are fitted side by side; 0: one per core.
    """
    import os
    from functools import partial
    from itertools import chain, count

    from frictionid.files import file_names, write_bytes
    from frictionid.progress import say_nothing
    from frictionid.quickstart import quick as first
    from frictionid.quickstart.quick_report import quick_figure, quick_json, show_check, show_laws
    from frictionid.report.figures.style import png

    loaded = fid.load_dataset(dataset, data, trust=trust)
    name = f"quick-{file_names([loaded.name])[loaded.name]}"
    ends = chain([""], (f"-{k}" for k in count(2)))
    paths = (Path(f"{name}{end}.png") for end in ends)
    figure = figure or next(path for path in paths if replace or not os.path.lexists(path))
    check_files([figure], (), dataset, data, replace=replace)
    with running(first.plan_for(loaded).steps, f"first verdict ({loaded.name})") as done:
        # laws take minutes: a run that is stopped leaves what the check says
        verdict = first.quick(loaded, done, say_nothing if json else show_check, jobs)
    print(quick_json(verdict)) if json else show_laws(verdict)
    if verdict.chosen is None:
        raise typer.Exit(2)
    write_bytes(figure, png(partial(quick_figure, verdict)))
    typer.echo(f"written to {figure}", err=True)
