"""Which joints of a URDF or MJCF a table is of, and which of its columns are theirs.

Columns are assigned by what their names share with the joints' names, or by their order.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.readers.column_toml import UNITS, counts_of
from frictionid.data.readers.table import Table
from frictionid.errors import InputError
from frictionid.mechanics.rigid_body.robot import MOVING, Joint, Robot
from frictionid.mechanics.rigid_body.robot_files import read_mjcf, read_urdf, robot_format

from .column_guesses import LENGTHS, check_named
from .tables import (
    COUNTS,
    OTHERS,
    by_trust,
    is_measured,
    is_target,
    nameless,
    quantity_of,
    tokens,
    unit_of,
    words,
)

_READ = {"urdf": read_urdf, "mjcf": read_mjcf}
_SILENT = 0.02  # of the median of the joints' largest torques: below, a motor is not measured
_BEYOND = 1.05  # times the travel that the file allows: further, and angles are not the joint's
_DEGREES = 4 * np.pi  # of an angle without limits: joints rarely turn further
_SAYING = {"angle": ("rad", "mrad", "deg", "mm"), "torque": ("N m",)}  # of no other quantity


class RobotFile(NamedTuple):
    """A file that describes a robot, its format, and what it says."""

    path: Path
    format: str
    robot: Robot


def robot_file(path: Path) -> RobotFile:
    """The robot of a URDF or MJCF, or of the only one in a folder; meshes are not looked at.

    Raises
    ------
    InputError
        Where there is none, or several, or it cannot be read.
    """
    files = [path]
    if path.is_dir():
        robots = [f for end in ("urdf", "xml") for f in sorted(path.rglob(f"*.{end}"))]
        files = [f for f in robots if robot_format(f)]
        if len(files) != 1:
            names = ", ".join(str(f) for f in files[:5]) or "none that ends with .urdf or .xml"
            raise InputError(f"{path}: holds {len(files)} robots ({names}); name one file")
    kind = robot_format(files[0])
    if not kind:
        raise InputError(f"{files[0]}: is no URDF (<robot>) and no MJCF (<mujoco>); name one")
    return RobotFile(files[0], kind, _READ[kind](files[0]))


class RobotColumns(NamedTuple):
    """Joints that move, in the order of the robot, and a column of each quantity for each.

    base : link that is held where the file lets it go, or ""; imu : [base] where it moves
    torque, velocity, target : columns, or none
    locked : means of joints whose torque is not measured, and why, in words
    side : "motor" where the angles cannot be those of the joints
    units : of the angles, one per joint; evidence : what speaks for these
    guessed : whether the columns of torque are those that are left over
    """

    joints: tuple[Joint, ...]
    base: str
    angle: tuple[str, ...]
    torque: tuple[str, ...] = ()
    velocity: tuple[str, ...] = ()
    target: tuple[str, ...] = ()
    locked: Mapping[str, float] = {}
    silent: str = ""
    side: str = "joint"
    units: tuple[str, ...] = ()
    evidence: str = ""
    imu: Mapping[str, Any] = {}
    guessed: bool = False


def robot_columns(
    robot: Robot,
    table: Table,
    gear: float | Sequence[float] | None = None,
    named: Mapping[str, Sequence[str]] = {},
    only: Sequence[str] | None = None,
    mute: Sequence[str] = (),
) -> RobotColumns:
    """Joints and columns of a table.

    gear : turns of the motors for one of the joints, where these are known
    named : columns of "angle" or "torque" that are known; only : names of the joints that move
    mute : joints that are locked

    Raises
    ------
    InputError
        Where no angles can be assigned, or a column that is named has no joint.
    """
    base, every = _movable(robot)
    movable = [j for j in every if only is None or j.name in only]
    check_named(table, named)
    imu = imu_columns(table) if base else {}
    left = [name for name in table.columns if name not in names_of(imu)]
    if all(j.kind != "prismatic" for j in every):
        left = [name for name in left if unit_of(name, "angle") != "mm"]
    kinds = ("angle", "torque", "current", "velocity", "target")
    called = {kind: named.get(kind) or [n for n in left if _is(n, kind)] for kind in kinds}
    by = {kind: _most_assigned(movable, called[kind]) for kind in kinds}
    if not by["angle"]:
        by["angle"] = _named_alike(movable, left)
    if not by["angle"]:
        raise _no_angles(table, movable)
    logged = {**_most_assigned(every, called["angle"]), **by["angle"]}
    driving = {**_most_assigned(every, called["torque"]), **by["torque"]}
    _check_joints(named, {"angle": logged, "torque": driving})
    joints = [j for j in movable if j.name in by["angle"]]
    pushes, guessed = by["torque"] or by["current"], False
    if not (pushes or by["target"]):
        taken = {*by["angle"].values(), *named.get("time", ())}
        free = [n for n in left if n not in taken and not (np.diff(table.columns[n]) > 0).all()]
        pushes = _left_over(joints, free)
        guessed = bool(pushes)
    driven = [j for j in joints if j.name in pushes] if pushes else joints
    silent = _silent(table, [j for j in driven if pushes], pushes)
    near = ", ".join(pushes[name] for name in silent)
    said = f"{near} stay near zero: nothing drives these joints, which are locked at their mean"
    kept = tuple(j for j in driven if j.name not in (*silent, *mute))
    still = [j for j in every if j.name in logged and j not in kept]
    angle = tuple(by["angle"][j.name] for j in kept)
    side, units, evidence = _side(table, kept, angle, gear)
    return RobotColumns(
        kept,
        base,
        angle,
        tuple(pushes[j.name] for j in kept if pushes),
        _of_all(kept, by["velocity"]),
        () if pushes else _of_all(kept, by["target"]),
        {j.name: _mean(table, logged[j.name], j, units) for j in still},
        said * bool(silent),
        side,
        units,
        evidence,
        imu,
        guessed,
    )


def _check_joints(
    named: Mapping[str, Sequence[str]], assigned: Mapping[str, Mapping[str, str]]
) -> None:
    """Refuse a column of angles or torques that is named and has no joint with an angle."""
    for quantity, columns in assigned.items():
        held = [name for joint, name in columns.items() if joint in assigned["angle"]]
        lost = [name for name in named.get(quantity, ()) if name and name not in held]
        if lost:
            raise InputError(
                f"--{quantity}: {lost[0]!r} has no joint with an angle: columns are called as "
                "their joints, or there is one for each joint, in their order; name these with "
                "--set 'joints=[...]', or leave the column out"
            )


def _no_angles(table: Table, movable: Sequence[Joint]) -> InputError:
    """What is wrong where no column is the angle of a joint."""
    angles = ", ".join(n for n in table.columns if _is(n, "angle"))
    which = f"columns {angles}" if angles else "no columns"
    if all(map(str.isdecimal, table.columns)):
        which = f"columns '1' to '{len(table.columns)}', without a header, do not"
    return InputError(
        f"{table.file}: {which} look like angles, and the robot "
        f"has the joints {', '.join(j.name for j in movable)}: name one column for each joint "
        "that moves with --angle, and the joints with --set 'joints=[...]'"
    )


def _mean(table: Table, name: str, joint: Joint, units: Sequence[str]) -> float:
    """Mean [rad] or [m] of a column, its unit by its name, else that of others (units)."""
    column, slides = table.columns[name], joint.kind == "prismatic"
    usual = "m" if slides else next((u for u in units if u not in LENGTHS), "rad")
    size = UNITS["angle"].get(_unit_said(name, column, joint) or usual, 1.0)
    return round(float(size * np.nanmean(column)), 4)


def _of_all(joints: Sequence[Joint], columns: Mapping[str, str]) -> tuple[str, ...]:
    """Columns of all joints, or none."""
    each = tuple(columns[j.name] for j in joints if j.name in columns)
    return each if len(each) == len(joints) else ()


def _movable(robot: Robot) -> tuple[str, list[Joint]]:
    """The link that is held where a free joint lets it go, and the joints that can be named."""
    free = [j for j in robot.joints if j.kind == "floating"]
    tied = {j.name for j in robot.joints if j.mimic is not None} | {j.mimic for j in robot.joints}
    movable = [j for j in robot.joints if j.kind in MOVING and j.name not in tied]
    return (free[0].child if free else ""), movable


def _is(name: str, kind: str) -> bool:
    """Whether a column's name speaks, if only by a unit, of a measured quantity, or of a target."""
    if kind == "target":
        return is_target(name)
    by_unit = (quantity for quantity, units in _SAYING.items() if unit_of(name, quantity) in units)
    return (quantity_of(name) or next(by_unit, "")) == kind and is_measured(name)


def _most_assigned(joints: Sequence[Joint], columns: Sequence[str]) -> dict[str, str]:
    """Columns by the names of the joints: those of a sensor where they name as many as all do."""
    return max((_assigned(joints, names) for names in by_trust(columns)), key=len)


def _assigned(joints: Sequence[Joint], columns: Sequence[str]) -> dict[str, str]:
    """Columns by the names of the joints: by what the names share, else in their order."""
    out: dict[str, str] = {}
    for name, said in zip(columns, _counted(columns, joints), strict=True):
        like = [j.name for j in joints if said and said <= tokens(j.name)]
        exact = [j for j in like if tokens(j) == said]
        chosen = exact if len(exact) == 1 else like
        if len(chosen) == 1 and chosen[0] not in out:
            out[chosen[0]] = name
    if len(out) == len(columns):
        return out
    in_order = zip((j.name for j in joints), columns, strict=False)
    return dict(in_order) if len(columns) == len(joints) else out


def _counted(columns: Sequence[str], joints: Sequence[Joint]) -> list[frozenset[str]]:
    """Tokens of columns, their numbers one more where they count from 0 and the joints from 1."""
    said = [tokens(name) for name in columns]
    if not any("0" in each for each in said) or any("0" in tokens(j.name) for j in joints):
        return said
    return [frozenset(str(int(x) + 1) if x.isdecimal() else x for x in each) for each in said]


def _named_alike(joints: Sequence[Joint], columns: Sequence[str]) -> dict[str, str]:
    """Columns that say nothing but the name of a joint, for all joints or none."""
    plain = nameless(columns)
    each = {j.name: [n for n in plain if tokens(n) == tokens(j.name)] for j in joints}
    alone = all(len(names) == 1 for names in each.values())
    return {joint: names[0] for joint, names in each.items()} if alone else {}


def _left_over(joints: Sequence[Joint], columns: Sequence[str]) -> dict[str, str]:
    """Columns that say nothing of what they are, one for each joint; or none."""
    left = nameless(columns)
    each = {} if any(OTHERS & {*words(n)} for n in left) else _assigned(joints, left)
    return each if len(each) == len(left) == len(joints) else {}


def _silent(table: Table, joints: Sequence[Joint], pushes: Mapping[str, str]) -> list[str]:
    """Joints whose torque column stays near zero, beside those of the others."""
    top = {j.name: float(np.nanmax(np.abs(table.columns[pushes[j.name]]))) for j in joints}
    usual = float(np.median(list(top.values()))) if top else 0.0
    silent = [name for name, value in top.items() if value < _SILENT * usual]
    return silent if len(silent) < len(top) else []


def _side(
    table: Table,
    joints: Sequence[Joint],
    columns: Sequence[str],
    gear: float | Sequence[float] | None,
) -> tuple[str, tuple[str, ...], str]:
    """Side and units of the angles, by their names and by how far the file lets the joints turn."""
    angles = [table.columns[name] for name in columns]
    travel = np.array([np.ptp(angle[np.isfinite(angle)]) for angle in angles])
    said = np.array([*map(_unit_said, columns, angles, joints)])
    slides = np.array([j.kind == "prismatic" for j in joints])
    room = np.array([j.limits.upper - j.limits.lower for j in joints])
    stated = said != ""
    usual = np.where(np.isfinite(room), room, np.where(stated, np.inf, _DEGREES))
    most = _BEYOND * np.where(stated & slides, np.inf, usual)
    named = any("motor" in words(name) for name in columns)
    shaft = named or "counts" in said[slides]
    far = (travel > most) & (travel <= 1e3 * most) & (gear is None and not shaft)
    lengths = np.where(far, "mm", "m")

    def units_with(unit: str) -> tuple[str, ...]:
        return tuple(np.where(stated, said, np.where(slides, lengths, unit)).tolist())

    def fit(units: Sequence[str], ratio: Any = 1.0) -> bool:
        size = np.array([UNITS["angle"].get(unit, 0.0) for unit in units])
        return bool((size * travel / ratio <= most).all())

    first, last = units_with("rad"), units_with("deg")
    fits = [units for units in (first, last) if fit(units)]
    span = _span(joints, travel, said)
    if shaft or (gear is not None and first not in fits):
        ratio = np.abs(np.asarray(gear if gear is not None else np.inf, dtype=float))
        units = first if fit(first, ratio) else last
        taken = ", ".join(dict.fromkeys(units))
        return "motor", units, f"{'named like motors' if named else span}; taken as {taken}"
    free = ~(stated | slides)
    if first not in fits and counts_of(np.stack(angles)[free]):
        return "joint", units_with("counts"), f"{span}: counts, a guess, see [motor]"
    if fits:
        return "joint", fits[0], f"{span}{': degrees' if fits[0] != first else ''}"
    return "motor", first, f"{span}: angles of the motors, before a gear"


def _unit_said(name: str, angle: Array, joint: Joint) -> str:
    """Unit of a joint's angles that their name says, or ""."""
    if COUNTS & {*words(name)} and counts_of(angle, named=True):
        return "counts"
    unit = unit_of(name, "angle")
    return unit if (unit in LENGTHS) == (joint.kind == "prismatic") else ""


def _span(joints: Sequence[Joint], travel: Array, said: Any) -> str:
    """The units that the names say, and the widest travel, of a joint that turns if any does."""
    j = max(range(len(joints)), key=lambda j: (joints[j].kind != "prismatic", travel[j]))
    low, high, *_ = joints[j].limits
    limit = f"allows {high - low:.3g} {'m' if joints[j].kind == 'prismatic' else 'rad'}"
    if np.isinf(high - low):
        limit = "sets no limit" + f"; few turn further than {_DEGREES:.3g} rad" * (not said[j])
    units = ", ".join(dict.fromkeys(filter(None, said)))
    names = f"the name says {units}; " * bool(units)
    return f"{names}travel of up to {travel[j]:.3g}, where the file {limit}"


# --- Columns of an IMU ----------------------------------------------------------------------------


_CALLED = {
    "angular_velocity": (
        frozenset("gyro gyroscope gyr gx gy gz wx wy wz".split()),
        (frozenset({"angular", "velocity"}), frozenset({"angular", "vel"})),
    ),
    "specific_force": (
        frozenset("acc accel accelerometer ax ay az".split()),
        (frozenset({"linear", "acceleration"}), frozenset({"specific", "force"})),
    ),
}
_IN_G = (0.5, 2.0)  # median size of a specific force in units of g
_FAST = 35.0  # [rad/s]: gyroscopes show less, unless it is deg/s


def imu_columns(table: Table) -> dict[str, Any]:
    """The [base] table of an IMU whose columns have usual names, or nothing.

    >>> names = [f"imu_{kind}_{axis}" for kind in ("gyro", "acc") for axis in "xyz"]
    >>> base = imu_columns(Table("a.csv", np.arange(2), {name: np.ones(2) for name in names}))
    >>> base["angular_velocity"], base["units"]
    (['imu_gyro_x', 'imu_gyro_y', 'imu_gyro_z'], {'specific_force': 'g'})
    >>> sorted(names_of(base)) == sorted(names)
    True
    """
    out: dict[str, Any] = {}
    for quantity in _CALLED:
        names = list(_columns(table, quantity))
        if len(names) != 3:
            return {}
        out[quantity] = names
    units = {}
    if _size(table, out["angular_velocity"]).max() > _FAST:
        units["angular_velocity"] = "deg/s"
    if _IN_G[0] < np.median(_size(table, out["specific_force"])) < _IN_G[1]:
        units["specific_force"] = "g"
    at_origin = {key: [0.0, 0.0, 0.0] for key in ("sensor_position", "sensor_rotation")}
    return {**out, **({"units": units} if units else {}), **at_origin}


def names_of(base: Mapping[str, Any]) -> list[str]:
    """Columns of an IMU."""
    return [name for quantity in _CALLED for name in base.get(quantity, ())]


def _columns(table: Table, quantity: str) -> Iterator[str]:
    single, several = _CALLED[quantity]
    for name in table.columns:
        said = set(words(name))
        if is_measured(name) and (said & single or any(each <= said for each in several)):
            yield name


def _size(table: Table, names: list[str]) -> Array:
    """Length (T,) of vectors where all their columns have numbers."""
    vectors = np.stack([table.columns[name] for name in names])
    return np.linalg.norm(vectors[:, np.isfinite(vectors).all(axis=0)], axis=0)
