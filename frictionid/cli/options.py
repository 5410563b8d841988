"""Options and arguments that several commands have; wrong paths are refused before imports."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from copy import copy
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer

Bias = Annotated[
    bool,
    typer.Option("--bias", help="Intervals hold the bias of smoothed states, too; takes seconds."),
]
Trust = Annotated[
    bool,
    typer.Option("--trust", help="Run code that a suite or data set names by its module."),
]
Json = Annotated[bool, typer.Option("--json", help="Print all numbers as JSON.")]
Replace = Annotated[
    bool, typer.Option("--replace", help="Write over files that exist (never over what is read).")
]
Only = Annotated[
    list[str] | None, typer.Option(help="Name of a recording to take; repeatable [all].")
]
Require = Annotated[
    list[str] | None,
    typer.Option(
        "--require",
        help="Exit with 1 unless the verdict on every data set is this: recommended, "
        "simple_enough, undecided, or QUESTION=ANSWER as in verdict.json; repeatable.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", help="A setting, e.g. symmetric=false or bounds.viscous=[0,1]."),
]
Free = Annotated[
    str,
    typer.Option(
        help="Free blocks: friction,inertia,delay,gain,bias,offset,actuator,target_delay,backlash "
        "[friction, and of inertia, delay and bias what the data tell]."
    ),
]
KnownCalibration = Annotated[
    Path | None,
    typer.Option(
        help="Model file whose base parameters, delay, gain, bias, offset, and what it says of "
        "servos, are held; blocks named by --free have its standard errors as priors."
    ),
]
Equal = Annotated[
    list[str] | None,
    typer.Option(help="Joints with the same friction, e.g. hip_left,hip_right; repeatable."),
]
Fixed = Annotated[
    list[str] | None,
    typer.Option(help="A parameter that is not free, e.g. inertia.gravity_2; repeatable."),
]
Windows = Annotated[
    str | None, typer.Option(help="Lengths of the windows of shooting [s], e.g. 0.1,0.3.")
]
Iterations = Annotated[int | None, typer.Option(min=1, help="Iterations of shooting at most.")]
Laws = Annotated[
    list[str] | None,
    typer.Option("--law", help="Class of a law that is not built in, module:Class; repeatable."),
]
SampleTime = Annotated[float | None, typer.Option(help="Use samples at least this far apart [s].")]
Tables = Annotated[Path | None, typer.Option("--data", help="Folder with the tables.")]
SuiteTables = Annotated[
    Path | None,
    typer.Option("--data", help="Folder with the tables of the suite's one data set."),
]
Consistent = Annotated[
    bool, typer.Option("--consistent", help="Inverse dynamics: inertias that bodies can have.")
]


def add_command(app: typer.Typer, command: Callable[..., None]) -> None:
    """Add a command: positional parameters are arguments, keyword-only ones options.

    The help of each stands in the section Parameters of the docstring, unless its type brings one;
    truths are flags that turn something on.
    """
    summary, _, section = (inspect.getdoc(command) or "").partition("\n\nParameters\n----------\n")
    texts = dict(re.findall(r"^(\w+) : (.*(?:\n +.*)*)", section, re.MULTILINE))
    hints = get_type_hints(command, include_extras=True)
    for name, parameter in inspect.signature(command).parameters.items():
        hint = hints[name]
        kind, *infos = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        flag = [f"--{name.replace('_', '-')}"] if kind is bool else []
        is_option = parameter.kind is Parameter.KEYWORD_ONLY
        info = copy(infos[0]) if infos else typer.Option(*flag) if is_option else typer.Argument()
        if name in texts:
            info.help = " ".join(texts[name].split())
        command.__annotations__[name] = Annotated[kind, info]
    app.command(help=summary)(command)


def numbers(option: str, text: str, rule: str, count: int | None = None) -> list[float]:
    """Finite numbers of an option, with commas.

    count : of numbers, where that is fixed

    Raises
    ------
    InputError
        Where it does not keep the rule.

    >>> numbers("--windows", "0.1,0.3", "be lengths in seconds, e.g. --windows 0.1,0.3")
    [0.1, 0.3]
    """
    import math

    from frictionid.errors import InputError

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
    from frictionid.errors import InputError

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
    from frictionid.errors import InputError

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
    from frictionid.data.readers.dataset_path import dataset_path

    dataset_path(path)
    return path


def _suite(path: Path) -> Path:
    from frictionid.files import suite_path

    return suite_path(path)


def present(path: Path | None) -> Path | None:
    """The path of a file or folder that a command reads; InputError where there is none."""
    from frictionid.errors import InputError
    from frictionid.files import model_path, regular_file

    if path is not None and not regular_file(model_path(path)).exists():
        raise InputError(f"{path}: no such file; correct the path")
    return path


def _results(folder: Path) -> Path:
    if not (folder / "unfinished" / "provenance.json").exists():  # that was interrupted
        present(folder / "provenance.json")
    return folder


def _other_results(folder: Path | None) -> Path | None:
    return None if folder is None else _results(folder)


def _models_and_dataset(paths: list[Path]) -> list[Path]:
    for path in paths[:-1]:
        present(path)
    if len(paths) > 1:
        _dataset(paths[-1])
    return paths


def _models(paths: list[Path]) -> list[Path]:
    for path in paths:
        present(path)
    return paths


DatasetPath = Annotated[
    Path,
    typer.Argument(
        help="Folder with dataset.toml, that file, or a name, e.g. acrobot_clean.",
        callback=_dataset,
    ),
]
SuitePath = Annotated[
    Path, typer.Argument(help="Suite file, or the name of one, e.g. acrobot.", callback=_suite)
]
ResultFolder = Annotated[
    Path, typer.Argument(help="Result folder of a comparison.", callback=_results)
]
OtherFolder = Annotated[
    Path | None,
    typer.Argument(help="A second one, to say what changed.", callback=_other_results),
]
ModelPath = Annotated[Path, typer.Argument(help="Model file, or machine:NAME.", callback=present)]
ModelPaths = Annotated[
    list[Path], typer.Argument(help="MODEL.json MODEL.json ...", callback=_models)
]
ModelsAndDataset = Annotated[
    list[Path], typer.Argument(help="MODEL.json ... DATASET", callback=_models_and_dataset)
]
DataFolder = Annotated[
    Path | None, typer.Option("--data", help="Folder with the tables.", callback=present)
]
