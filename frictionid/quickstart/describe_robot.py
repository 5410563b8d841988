"""From tables and a URDF or MJCF to a dataset.toml: joints, columns, sides, and what is missing."""

import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import compress
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.evaluation import Protocol, prepare
from frictionid.evaluation.torque_left import means_of, row_torques
from frictionid.fitting.one_step.residual import IN_TURN, stiction_mask
from frictionid.mechanics import Mechanism, mechanism_of
from frictionid.mechanics.mechanism_table import FORMATS, mechanism_options
from frictionid.mechanics.rigid_body.robot import Joint

from .column_guesses import LEFT_OVER, ColumnGuesses, guess_columns
from .describe_tables import (
    GAINS,
    OUTPUT,
    Described,
    Draft,
    Known,
    actuator_of,
    described_draft,
    encoder_of,
    loaded,
)
from .robot_columns import RobotColumns, RobotFile, names_of, robot_columns
from .tables import Tables, quantity_of, words

_NOTHING = 1e-9  # of the usual inertia of a joint
_HARDLY = 0.05  # of the widest motion of a joint
_QUICK = 1000.0  # [rad/s^2], by the largest torque, of a joint without an inertia of its own
_MISSING = "MISSING, see above"
_GEARS = (
    "gear ratios (--gear, turns of each motor for one of its joint, negative where these turn "
    "against each other): "
)
GEAR = f"{_GEARS}without them nothing below holds"
_CONSTANTS = (
    "torque constants and gears (--kt [N m/A], --gear; their product counts, negative where a "
    "current counts the other way round): "
)
_KT = f"{_CONSTANTS}without them friction is in A"
_ROTOR = (
    "rotor inertias (rotor_... in [mechanism.parameters], gear^2 times those of the motors): "
    "without them check finds inertia missing; fits find it, as inertia is free there"
)
_OFFSET = (
    "joint angles where the motors' are zero (offset in [motor]): without them they are zero, or "
    "the quarter turns that the motion asks for"
)
_TORQUE = (
    "torques or currents (--torque NAME,NAME, a column for each joint): without them all joints "
    "swing freely"
)
_NO_LOAD = "in {} no load shows: with constants (--kt, --gear) these joints move, too"
_IMU = (
    "where the IMU is in the frame of the base (sensor_position [m], sensor_rotation in [base]): "
    "without them at its origin, and parallel"
)
_HELD = "it is held; where it moves, an IMU must say how (floating, [base])"


def describe_robot(
    tables: Tables,
    file: RobotFile,
    options: Mapping[str, Any],
    facts: Known,
    still: Mapping[str, str] = {},
) -> Described:
    """A dataset.toml and a first suite for tables of a robot.

    options : of the [mechanism] table, such as joints, and parameters, such as rotors
    facts : what is known of columns and motors
    still : joints that are locked, and why

    Raises
    ------
    InputError
        Where no column fits the joints, or the tables are damaged.
    """
    columns = robot_columns(
        file.robot, tables.first, facts.gear, facts.columns, options.get("joints"), tuple(still)
    )
    names = mechanism_options(FORMATS[file.format])
    values = {k: v for k, v in options.items() if k not in names}
    settings = {k: v for k, v in options.items() if k in names}
    table = _mechanism_table(tables, file, columns, settings)
    machine = mechanism_of({**table, file.format: str(file.path), "parameters": values})
    stand_in = _stand_in(machine, columns.joints)
    table["parameters"] = {**values, **stand_in}
    machine = machine.with_values(table["parameters"])
    guesses = _guesses(tables, machine, columns, facts)
    filled = _with_file(facts, columns.joints)
    motor = _motor(columns, guesses, filled)
    efforts = [joint.limits.effort for joint in columns.joints]
    actuator = actuator_of(columns.target, filled, efforts if np.isfinite(efforts).all() else ())
    missing = tuple(_missing(machine, motor, actuator, filled))
    if not (columns.torque or actuator) and {*map(quantity_of, guesses.unused)} - {"velocity"}:
        missing += (_TORQUE,)
    missing += (_IMU,) if columns.imu else ()
    comments = _comments(file, columns, machine, facts, filled, still)
    comments |= {f"motor.{key}": _MISSING for key in motor if getattr(filled, key, 0) is None}
    comments |= dict.fromkeys(stand_in, "; MISSING, a guess: its link has no inertia")
    motor |= encoder_of(tables.first, guesses)
    beside = columns.velocity, columns.imu, missing
    draft = Draft(tables, table, guesses, machine, motor, comments, actuator, *beside)
    factor = {*missing} & {_KT, GEAR}  # of the torques, where angles are the joints'
    if len(factor) == 1 and not (GEAR in factor and "angle" in motor):
        gains = gains_by_gravity(loaded(draft))
        none = [joint for joint, gain in gains.items() if gain is None]
        if none and len(none) < len(gains) and "joints" not in options:
            pairs = zip(columns.joints, columns.torque, strict=True)
            why = _NO_LOAD.format(", ".join(name for joint, name in pairs if joint.name in none))
            locked = {**still, **dict.fromkeys(none, why)}
            kept = _of_joints(facts, [gain is not None for gain in gains.values()])
            return describe_robot(tables, file, options, kept, locked)
        if not none:
            head = _CONSTANTS if _KT in factor else _GEARS
            said = head + _taken(gains)
            missing = tuple(said if text in factor else text for text in missing)
            key = "gear" if filled.gear is None else "kt"
            each = [float(f"{gain[0] * motor[key]:.3g}") for gain in gains.values() if gain]
            draft = draft._replace(missing=missing, motor={**motor, key: each})
    blind = not {GEAR, _KT, GAINS, _TORQUE}.isdisjoint(missing)
    described = described_draft(draft, blind=blind)
    rest = _resting(described, columns.joints)
    if not rest or "joints" in options or facts.per_joint:
        return described
    why = f"{', '.join(rest)}: hardly any motion in these tables"
    return describe_robot(tables, file, options, facts, {**still, **dict.fromkeys(rest, why)})


def _resting(described: Described, joints: Sequence[Joint]) -> list[str]:
    """Joints whose friction no table shows, as they hardly move beside others."""
    missing = [f.joint for f in described.verdict.findings if f.kind == "missing_excitation"]
    angles = [recording.angle.value for recording in described.dataset.recordings]
    travel = np.max([np.ptp(angle, axis=0) for angle in angles], axis=0)
    hardly = travel < _HARDLY * travel.max()
    return [joint.name for j, joint in enumerate(joints) if hardly[j] and j + 1 in missing]


def _comments(
    file: RobotFile,
    columns: RobotColumns,
    machine: Mechanism,
    facts: Known,
    filled: Known,
    still: Mapping[str, str],
) -> dict[str, str]:
    """Comments of keys of the dataset.toml, see `Draft`; filled : the facts with the file's."""
    of_file = "" if facts.gains else "of the file"
    turns = "turns of the motor for one of its joint"
    locked = "; ".join(dict.fromkeys(filter(None, (columns.silent, *still.values()))))
    return {
        file.format: "meshes are not looked at",
        "joints": "those with columns, in their order; others are locked",
        "base": "the file lets it go: " + ("its IMU says how" if columns.imu else _HELD),
        "locked": locked or "left out, or no motor that is measured",
        "driven": "no torques, no targets",
        "": "\n".join(_limits(columns.joints)),
        **{p.name: "; of the file" if p.default else "; not in it" for p in machine.parameters},
        "motor.gear": turns if filled.gear is facts.gear else f"{turns}, of the file",
        **dict.fromkeys(("actuator.P", "actuator.D"), of_file if filled.gains else _MISSING),
    }


def _taken(gains: "Mapping[str, Gain | None]") -> str:
    each = (f"{j} {gain[0]:.3g} +- {gain[1]:.1g}" for j, gain in gains.items() if gain)
    return f"taken as the masses of the file ask for, and right if these are, {', '.join(each)}"


def _stand_in(machine: Mechanism, joints: Sequence[Joint]) -> dict[str, float]:
    """Rotor inertias [kg m^2] of joints that the file gives no inertia, so that they can move."""
    q = np.linspace(0.0, 1.0, 5)[:, None] * np.ones(machine.n)
    M = machine.inertia(machine.base(machine.defaults), q)
    diagonal = np.diagonal(M, axis1=1, axis2=2).max(axis=0)
    out = {}
    for joint, inertia in zip(joints, diagonal, strict=True):
        if inertia < _NOTHING * np.median(diagonal):
            effort = joint.limits.effort if np.isfinite(joint.limits.effort) else 10.0
            out[f"rotor_{joint.name}"] = round(effort / _QUICK, 6)
    return out


def _mechanism_table(
    tables: Tables, file: RobotFile, columns: RobotColumns, options: Mapping[str, Any]
) -> dict[str, Any]:
    place = os.path.relpath(file.path, tables.folder)
    out: dict[str, Any] = {file.format: place.replace(os.sep, "/")}
    if columns.base:
        out["base"] = columns.base
    if columns.imu:
        out["floating"] = True
    out["joints"] = [joint.name for joint in columns.joints]
    if columns.locked:
        out["locked"] = dict(columns.locked)
    if not (columns.torque or columns.target):
        out["driven"] = False
    return {**out, **options}


def _guesses(
    tables: Tables, machine: Mechanism, columns: RobotColumns, facts: Known
) -> ColumnGuesses:
    """Guesses of the columns, with the units of the angles that names or the file ask for."""
    named = {**facts.columns, "angle": columns.angle}
    if columns.torque:
        named["torque"] = columns.torque
    driven = [bool(columns.torque)] * machine.n
    kt = facts.kt is not None
    guesses = guess_columns(tables.first, driven, machine.position_units, named, kt=kt)
    if columns.guessed:
        guess = guesses.torque
        guesses = guesses._replace(torque=guess._replace(evidence=LEFT_OVER + guess.evidence))
    unit = columns.units[0] if len({*columns.units}) == 1 else columns.units
    angle = guesses.angle._replace(unit=unit, evidence=columns.evidence)
    used = {*columns.velocity, *columns.target, *names_of(columns.imu)}
    return guesses._replace(angle=angle, unused=tuple(n for n in guesses.unused if n not in used))


def _motor(columns: RobotColumns, guesses: ColumnGuesses, facts: Known) -> dict[str, Any]:
    """The [motor] table, where columns are of motors or hold currents."""
    shaft = any("motor" in words(name) for name in columns.torque) and not guesses.is_current
    if not (guesses.is_current or shaft or columns.side == "motor"):
        return {}
    out: dict[str, Any] = {}
    if guesses.is_current:
        out["kt"] = 1.0 if facts.kt is None else facts.kt
    out["gear"] = 1.0 if facts.gear is None else facts.gear
    if columns.side == "motor":
        out |= {"angle": "motor", "offset": [0.0] * len(columns.joints)}
    if shaft:
        out["torque"] = "motor"
    return out


def _missing(
    machine: Mechanism, motor: Mapping[str, Any], actuator: Mapping[str, Any], facts: Known
) -> Iterator[str]:
    """What nobody has said, and what happens without it."""
    amperes = "kt" in motor and facts.kt is None
    if facts.gear is None and motor and (not amperes or "angle" in motor):
        yield GEAR
    if amperes:
        yield _KT
    if "offset" in motor:
        yield _OFFSET
    if actuator and facts.gains is None:
        yield GAINS
    if actuator and facts.kt is not None:
        yield OUTPUT
    if not any(machine.defaults[p.name] > 0 for p in machine.parameters if p.rotor):
        yield _ROTOR


def _of_joints(facts: Known, keep: Sequence[bool]) -> Known:
    """With constants of some joints only, where each has its own."""
    each = facts.kt, facts.gear
    kt, gear = ([*compress(c, keep)] if isinstance(c, Sequence) else c for c in each)
    return facts._replace(kt=kt, gear=gear)


def _with_file(facts: Known, joints: Sequence[Joint]) -> Known:
    """With gears, P and D of the file where nobody said them, one P where all are the same."""
    gears = [joint.gear for joint in joints if joint.gear]
    if facts.gear is None and len(gears) == len(joints) and {*gears} != {1.0}:  # often a stand-in
        facts = facts._replace(gear=gears)
    each = [joint.gains for joint in joints if joint.gains]
    if facts.gains or len(each) < len(joints):
        return facts
    P, D = (float(x[0]) if len({*x}) == 1 else list(x) for x in zip(*each, strict=True))
    return facts._replace(gains=(P, D))


def _limits(joints: Sequence[Joint]) -> Iterator[str]:
    """Limits of the file, as comments."""
    limited = [joint for joint in joints if np.isfinite(joint.limits).any()]
    if limited:
        yield "limits of the file: position, velocity, torque, in SI units"
    for joint in limited:
        yield "  {}: {:g} to {:g}, {:g}, {:g}".format(joint.name, *joint.limits)


# --- Gains of currents ----------------------------------------------------------------------------


_WINDOW, _CLUSTER = 0.05, 20  # [s], and windows
_SURE = 0.1  # standard error of a gain, as a share of it
_EXPLAINS = 0.8  # share of a joint's load, at least
_FEWEST = 80  # windows of sliding
_ALONE = 0.02  # share of a column that nothing else explains, at least


Gain = tuple[float, float]  # joint torque by unit of its column, and the standard error


def gains_by_gravity(dataset: Dataset) -> dict[str, Gain | None]:
    """Gain of each joint's torque column by its name, None where the file's masses do not show.

    Least squares, over windows in which the joint slides, of

        what the rigid bodies need = gain column - coulomb sgn(w) - viscous w + offset - rotor dw/dt

    with the rotor's inertia where the mechanism has none: it would be taken for gain.
    """
    problem, n = prepare(dataset, Protocol()).integral, dataset.mechanism.n
    left, column = row_torques(problem, problem.r[:, :n], np.ones(len(problem.r), dtype=bool))
    start, w, end = (problem.nodes.inputs.w[at, :n] for at in problem.stencil.T)
    speeding = (end - start) / problem.dt[:, None]
    rests = stiction_mask(problem, None, IN_TURN)[:, :n]
    number = np.floor(problem.time / _WINDOW + 1e-9)
    keys = np.stack([problem.recording, number], axis=1)
    place = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    rows = np.ones(len(place))
    out: dict[str, Gain | None] = {}
    for j, name in enumerate(dataset.mechanism.joints):
        u, v = column[:, j], w[:, j]
        free = [] if dataset.mechanism.defaults.get(f"rotor_{name}") else [-speeding[:, j]]
        parts = [u - left[:, j], rests[:, j], u, -np.sign(v), -v, rows, *free]
        need, rest, *A = means_of(np.stack(parts, axis=1), place, rows).T
        slides = rest == 0
        out[name] = _gain(np.stack(A, axis=1)[slides], need[slides])
    return out


def _gain(A: Array, need: Array) -> Gain | None:
    """Gain of the first column (W, 4 or 5) for what is needed (W,), errors clustered over time."""
    if len(A) < _FEWEST:
        return None
    x, _, rank, _ = np.linalg.lstsq(A, need)
    left = need - A @ x
    if rank < A.shape[1] or left.var() > (1 - _EXPLAINS) * need.var():
        return None
    inverse = np.linalg.inv(A.T @ A)
    if 1 / inverse[0, 0] < _ALONE * len(A) * A[:, 0].var():
        return None
    scores = np.add.reduceat(A * left[:, None], np.arange(0, len(A), _CLUSTER))
    error = float(np.sqrt((inverse @ scores.T @ scores @ inverse)[0, 0]))
    return (float(x[0]), error) if error < _SURE * abs(x[0]) else None
