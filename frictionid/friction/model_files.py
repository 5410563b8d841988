"""Files of fitted models: JSON, written atomically, never pickled.

A model file holds the law by name, theta, the parameters in words with units and, where given, the
mechanism's parameters. The weights of networks stand beside it in a safetensors file of the same
name. It never names code: a law outside this package needs its class at hand.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, fields
from difflib import get_close_matches
from importlib import import_module
from inspect import isabstract
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import numpy as np

from frictionid.config import unknown
from frictionid.data.plants import Calibration
from frictionid.errors import InputError, located, needs
from frictionid.files import (
    TEMPORARY,
    model_path,
    read_json,
    regular_file,
    sha256,
    write_bytes,
    write_json,
)
from frictionid.friction import Friction, Law, laws, units_of

from .bam_files import is_bam, read_bam

FORMAT = "frictionid model 1"
_WEIGHTS = ".safetensors"
# of a calibration, where servos drive
_OF_SERVOS = ("motor", "target_delay", "backlash", "envelope")


def _built_in() -> Iterator[type[Law]]:
    """The laws of the files in `friction/laws` that model files can hold."""
    for module in iter_modules(laws.__path__, f"{laws.__name__}."):
        for law in vars(import_module(module.name)).values():
            if not (isinstance(law, type) and issubclass(law, Law)) or isabstract(law):
                continue
            if law.kind and law.__module__ == module.name and "__dataclass_params__" in vars(law):
                yield law


LAWS: dict[str, type[Law]] = dict(sorted((law.kind, law) for law in _built_in()))


def model_document(friction: Friction) -> dict[str, Any]:
    """JSON document of a friction; its law stands under its name in `LAWS`, else its class's.

    The means of a batch stand in `joints`, in words and units, for people; `theta` is what counts.
    Weights of a network have no words.
    """
    if reason := friction.law.cannot_be_saved:
        raise InputError(f"{friction.law} cannot be saved: {reason}")
    theta = np.asarray(friction.theta, dtype=float)
    has = friction.law.has_parameters(friction.n)
    mean = theta.mean(axis=tuple(range(theta.ndim - 2)))
    words = []
    for j, row in enumerate(mean.tolist()):
        rows = zip(friction.law.names, row, friction.units_at(j), has[j], strict=True)
        words.append({name: {"value": x, "unit": unit} for name, x, unit, there in rows if there})
    return {
        "format": FORMAT,
        "law": _law_table(friction.law),
        **({} if friction.law.is_network else {"joints": words}),
        "theta": theta,
        "shape": list(theta.shape),
        "parameters": dict(friction.parameters),
        "provenance": friction.provenance.document(),
        **_units_table(friction),
        **({"mechanism": friction.mechanism} if friction.mechanism else {}),
        **({} if friction.calibration is None else {"calibration": asdict(friction.calibration)}),
    }


def _units_table(friction: Friction) -> dict[str, Any]:
    """Units of the positions where they are not all "rad", and of loads that are no forces."""
    units = friction.position_units
    load = {} if friction.load_unit == "N" else {"load_unit": friction.load_unit}
    if set(units) <= {"rad"}:
        return load
    return {"angle_unit": units[0] if len(set(units)) == 1 else list(units), **load}


def _units_of_document(document: Mapping[str, Any], joints: int, where: str) -> tuple[str, ...]:
    """Units of the positions of each joint, () where all are "rad"."""
    named = document.get("angle_unit", "rad")
    units = tuple(named) if isinstance(named, list) else (named,) * joints
    if len(units) != joints or not set(units) <= {"rad", "m"}:
        raise InputError(
            f'{where}: "angle_unit" must be "rad" or "m", or one of these for each of {joints} '
            f"joints, not {named!r}"
        )
    return () if set(units) <= {"rad"} else units


def _load_unit(document: Mapping[str, Any], where: str) -> str:
    """Unit of the loads of joints that turn."""
    unit = document.get("load_unit", "N")
    if unit not in ("N", "N m"):
        raise InputError(f'{where}: "load_unit" must be "N" or "N m", not {unit!r}')
    return str(unit)


def _law_table(law: Law) -> dict[str, Any]:
    """Kind and settings of a law; one within another, as in an ensemble, is such a table itself."""
    names = (field.name for field in fields(law) if field.name not in law.left_out_of_files)
    settings = {name: _setting(getattr(law, name)) for name in names}
    return {"kind": kind_of(law), **settings}


def kind_of(law: Law) -> str:
    """Name of a law in model files: that in `LAWS`, else its class's."""
    return law.kind if LAWS.get(law.kind) is type(law) else type(law).__name__


def _setting(value: Any) -> Any:
    """A setting of a law with tables in place of laws."""
    if isinstance(value, tuple):
        return tuple(map(_setting, value))
    return _law_table(value) if isinstance(value, Law) else value


def model_paths(path: Path) -> tuple[Path, Path]:
    """A model file, and the file of a network's weights beside it.

    Raises
    ------
    InputError
        Where the model file has the ending of the weights.
    """
    if path.suffix == _WEIGHTS:
        raise InputError(f"{path}: a model file is JSON, {_WEIGHTS} are weights: name a .json file")
    return path, path.with_suffix(_WEIGHTS)


def save_model(friction: Friction, path: Path) -> None:
    """Write a friction as a JSON model file, the weights of a network beside it.

    Where it is interrupted, the model that was there before, if any, can still be read: its weights
    stay in a hidden file beside it until the model file names the new ones.

    Raises
    ------
    InputError
        Where the place cannot be written, or has the ending of weights.
    """
    document = model_document(friction)
    path, beside = model_paths(path)
    if friction.law.is_network:
        with needs("networks"):
            from safetensors.numpy import save

        content = save({"theta": np.ascontiguousarray(document["theta"])})
        _keep_named(path, beside)
        write_bytes(beside, content)
        document["theta"] = {"file": beside.name, "sha256": sha256(content)}
    write_json(path, document)
    _earlier(beside).unlink(missing_ok=True)


def _earlier(weights: Path) -> Path:
    """Where weights are kept while others take their place."""
    return weights.with_name(f"{TEMPORARY}earlier-{weights.name}")


def _keep_named(path: Path, beside: Path) -> None:
    """Keep the weights that a model file names, if there are any, until it names others."""
    with suppress(InputError, OSError):
        table = read_json(path).get("theta")
        if isinstance(table, Mapping) and table.get("file") == beside.name:
            write_bytes(_earlier(beside), _named(table, beside))


def _beside(table: Mapping[str, Any], path: Path) -> np.ndarray:
    """Weights that stand in a file beside the model file."""
    with needs("networks"):
        from safetensors import SafetensorError
        from safetensors.numpy import load

    name = str(table.get("file"))
    if Path(name).name != name or Path(name).suffix != _WEIGHTS:
        raise InputError(f"{path}: theta.file = {name!r} must be a {_WEIGHTS} file beside it")
    try:
        content = _named(table, path.parent / name)
        theta = load(content)["theta"]
    except OSError as error:
        raise InputError(
            f"{path}: its weights {name} cannot be read ({error.strerror}): keep the two together"
        ) from None
    except (SafetensorError, KeyError) as error:
        raise InputError(f"{path}: {name} holds no tensor theta ({error})") from None
    if sha256(content) != table.get("sha256"):
        raise InputError(f"{path}: {name} holds other weights than were saved with it: fit again")
    return np.asarray(theta, dtype=float)


def _named(table: Mapping[str, Any], weights: Path) -> bytes:
    """Content of the weights that a model file names: the file, or what was kept of it."""
    for file in (weights, _earlier(weights)):
        if file.is_file() and sha256(content := file.read_bytes()) == table.get("sha256"):
            return content
    return regular_file(weights).read_bytes()


def load_model(path: Path, own_laws: Sequence[type[Law]] = ()) -> Friction:
    """Friction of a model file; its law must be one of `LAWS`, or of `own_laws`.

    A file written by hand may leave out `theta` and give `joints` only. Parameter files of BAM are
    read, too, see `bam_files`; `machine:NAME` is a card, see `frictionid.machines`.
    """
    path = model_path(path)
    document = read_json(path)
    if is_bam(document):
        return read_bam(document, str(path))
    if isinstance(document.get("theta"), Mapping):
        document["theta"] = _beside(document["theta"], path)
    return read_model(document, str(path), own_laws)


def read_model(
    document: Mapping[str, Any], where: str, own_laws: Sequence[type[Law]] = ()
) -> Friction:
    """Friction of a model document; `where` is named in errors."""
    _check_format(document.get("format"), where)
    kinds = LAWS | {law.__name__: law for law in own_laws}
    law = _law(document.get("law"), kinds, where)
    try:
        theta = _theta(document, law, where)
        parameters = {str(k): float(v) for k, v in document.get("parameters", {}).items()}
        units = _units_of_document(document, theta.shape[-2] if theta.ndim > 1 else 1, where)
        calibration = _calibration(document.get("calibration"), where)
        source, mechanism = document.get("provenance", {}), document.get("mechanism", "")
        friction = Friction(
            *(law, theta, parameters, source, units, calibration, str(mechanism)),
            load_unit=_load_unit(document, where),
        )
    except (TypeError, ValueError, AttributeError) as error:
        text = str(error).removeprefix(f"{where}: ")
        raise InputError(f"{where}: {text}") from None
    if not np.isfinite(theta).all():
        raise InputError(f"{where}: theta must be finite")
    for name, value in parameters.items():
        if not np.isfinite(value):
            raise InputError(f"{where}: parameter {name!r} must be finite, not {value}")
    return friction


def _check_format(stated: Any, where: str) -> None:
    """Refuse files of a newer version, and files that are something else."""
    if stated == FORMAT:
        return
    name, _, version = str(stated).rpartition(" ")
    if f"{name} " == FORMAT.rstrip("1") and version.isdigit():
        raise InputError(
            f'{where}: is of another version of frictionid, "format" is {stated!r} and this one '
            f"reads {FORMAT!r}: install the version that wrote it, or a newer one"
        )
    other = "; it is of another program" if stated is None else ""
    raise InputError(
        f'{where}: is no model file, "format" must be "{FORMAT}", not {stated!r}{other}'
    )


def _calibration(table: Any, where: str) -> Calibration | None:
    """Calibration of its table, every number finite."""
    if table is None:
        return None
    names = [f.name for f in fields(Calibration) if f.name not in _OF_SERVOS]
    if not isinstance(table, Mapping) or set(table) - set(_OF_SERVOS) != set(names):
        raise InputError(
            f'{where}: "calibration" must have {", ".join(names)}, and may have '
            f"{', '.join(_OF_SERVOS)}"
        )
    numbers: dict[str, Any] = {}
    for name, value in table.items():
        may_lack = value is None and name in ("base", *_OF_SERVOS)
        numbers[name] = None if may_lack else np.asarray(value, dtype=float)
        if not may_lack and not np.isfinite(numbers[name]).all():
            raise InputError(f"{where}: calibration.{name} must be finite numbers")
    return Calibration(**numbers)


def _law(table: Any, kinds: Mapping[str, type[Law]], where: str) -> Law:
    if not isinstance(table, Mapping) or "kind" not in table:
        raise InputError(f'{where}: "law" must be an object with a "kind"')
    kind = str(table["kind"])
    if kind not in kinds:
        near = get_close_matches(kind, list(kinds), n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise InputError(
            f"{where}: law {kind!r} is unknown; {hint}known are {', '.join(kinds)}; "
            "one's own is given as --law module:Class"
        )
    settings = {
        k: _law(v, kinds, where) if isinstance(v, Mapping) and "kind" in v else v
        for k, v in table.items()
        if k != "kind"
    }
    names = [setting.name for setting in fields(kinds[kind])]
    for name in settings:
        if name not in names:
            raise InputError(f"{where}: law {kind!r}: {unknown(name, names)}")
    try:
        return kinds[kind](**settings)
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: law {kind!r}: {error}") from None


def _theta(document: Mapping[str, Any], law: Law, where: str) -> np.ndarray:
    joints = document.get("joints")
    if joints is not None and not (isinstance(joints, list) and joints):
        raise InputError(f'{where}: "joints" must list the parameters of each joint')
    words = None if joints is None else _words(document, joints, law, where)
    if "theta" not in document:
        if words is None:
            raise InputError(f'{where}: needs "theta", or "joints" with the parameters of each')
        return words
    theta = _shaped(document, law, where)
    if words is not None:
        mean = theta.mean(axis=tuple(range(theta.ndim - 2)))
        if mean.shape != words.shape or not np.allclose(mean, words, rtol=1e-6, equal_nan=True):
            raise InputError(f'{where}: "joints" and "theta" disagree: remove one of them')
    return theta


def _shaped(document: Mapping[str, Any], law: Law, where: str) -> np.ndarray:
    """The array `theta` in its `shape`, where the document has one."""
    shape = document.get("shape")
    try:
        theta = np.asarray(document["theta"], dtype=float)
        return theta if shape is None else theta.reshape(shape)
    except (TypeError, ValueError):
        of_shape = "" if shape is None else f', and fit "shape" = {shape!r}'
        raise InputError(
            f'{where}: "theta" must have a row of {len(law.names)} numbers for each joint'
            f'{of_shape}: correct it, or leave it out and give "joints"'
        ) from None


def _words(document: Mapping[str, Any], joints: Sequence[Any], law: Law, where: str) -> np.ndarray:
    """Parameters (n, P) of `joints`; those that a joint does not have are zero."""
    with located(where):
        has = law.has_parameters(len(joints))
    each = _units_of_document(document, len(joints), where) or ("rad",) * len(joints)
    load = _load_unit(document, where)
    out = np.zeros(has.shape)
    for j, (joint, unit) in enumerate(zip(joints, each, strict=True)):
        units = zip(law.names, units_of(law, unit, load), has[j], strict=True)
        present = {name: unit for name, unit, there in units if there}
        out[j, has[j]] = _joint(joint, present, f"{where}: joint {j + 1}")
    return out


def _joint(joint: Any, units: Mapping[str, str], where: str) -> list[float]:
    """Values of one joint's parameters, in the order of these names with their units."""
    names = set(joint) if isinstance(joint, Mapping) else set()
    if names != set(units):
        raise InputError(
            f"{where} must have the parameters {', '.join(units) or 'none'}; "
            f"it has {', '.join(sorted(names)) or 'none'}"
        )
    values = []
    for name, unit in units.items():
        entry = joint[name]
        value = entry.get("value") if isinstance(entry, Mapping) else None
        if isinstance(value, bool) or not isinstance(value, int | float):
            example = f'{{"value": 0.1, "unit": "{unit}"}}'
            raise InputError(f"{where}: {name} must be written as {example}, not {entry!r}")
        if entry.get("unit", unit) != unit:
            raise InputError(f"{where}: {name} must be in {unit!r}, not {entry['unit']!r}")
        values.append(float(value))
    return values
