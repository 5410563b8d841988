"""From tables to a dataset.toml and a first suite, with comments that say what speaks for them.

Columns are guessed by names and numbers, signs by the physics.
"""

import json
import tempfile
import textwrap
from collections.abc import Mapping, Sequence
from itertools import compress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.check import Verdict, check
from frictionid.check.hypotheses import ABSOLUTE, SHIFTED, TORQUE_UNITS, Convention
from frictionid.data.readers.column_toml import counts_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.table import Table
from frictionid.data.recordings import Dataset
from frictionid.data.servo import UNKNOWN_GAIN
from frictionid.data.signals import TORQUE_HOLD
from frictionid.errors import InputError
from frictionid.evaluation.folds import usual_kind
from frictionid.files import BAGS
from frictionid.mechanics import Mechanism, mechanism_of
from frictionid.mechanics.mechanism_table import mechanism_kinds, mechanism_options
from frictionid.report.tables import render

from .column_guesses import ColumnGuesses, guess_columns
from .quick import plan_for
from .tables import Tables, is_target, quantity_of

Constants = float | Sequence[float]  # one, or one per joint
GAINS = "gains of the controller (--gains P,D [N m/rad], [N m s/rad]): without them nothing holds"
OUTPUT = (
    "output of the controller (output in [actuator]), taken as a torque at the joint: only other "
    "outputs need --kt and --gear, which are left out (kt, gear in [actuator])"
)


class Known(NamedTuple):
    """What is known of the tables: columns by quantity, and constants of the motors.

    kt : [N m/A]; gear : turns of the motor for one of the joint; one, or one per joint
    gains, limit : P [N m/rad], D [N m s/rad] and largest torque [N m] of a controller that follows
        targets
    """

    columns: Mapping[str, Sequence[str]] = {}
    kt: Constants | None = None
    gear: Constants | None = None
    gains: tuple[Constants, Constants] | None = None
    limit: Constants | None = None

    @property
    def per_joint(self) -> bool:
        """Whether a constant is given for each joint."""
        return any(np.ndim(c) for c in (self.kt, self.gear, *(self.gains or ())) if c is not None)


class Draft(NamedTuple):
    """All that a first dataset.toml says.

    tables : of the recordings; mechanism : the [mechanism] table
    motor : [motor], where columns are of motors, or hold currents; actuator : [actuator]
    machine : the mechanism; comments : comments of keys of [mechanism], and below it as ""
    velocity : columns of velocities; base : [base], where an IMU says how it moves
    missing : what was not given and no guess replaces, and what happens without it
    evidence : what speaks for signs and units, from the physics
    """

    tables: Tables
    mechanism: Mapping[str, Any]
    guesses: ColumnGuesses
    machine: Mechanism
    motor: Mapping[str, Any]
    comments: Mapping[str, str]
    actuator: Mapping[str, Any]
    velocity: tuple[str, ...] = ()
    base: Mapping[str, Any] = {}
    missing: tuple[str, ...] = ()
    evidence: tuple[str, ...] = ()


class Described(NamedTuple):
    """Texts of dataset.toml and suite.toml, the data set that they describe, and the guesses.

    verdict : of `check` on the data set, or on what was corrected last
    """

    dataset_toml: str
    suite_toml: str
    dataset: Dataset
    draft: Draft
    verdict: Verdict


def guess_tables(tables: Tables, mechanism: Mapping[str, Any], facts: Known) -> ColumnGuesses:
    """Guesses of the columns under a [mechanism] table.

    Raises
    ------
    InputError
        Where no column fits a quantity.
    """
    machine = mechanism_of(mechanism)
    driven = [False] * machine.n if targets_in(tables.first, facts, machine.n) else machine.driven
    kt = facts.kt is not None
    return guess_columns(tables.first, driven, machine.position_units, facts.columns, kt=kt)


def _is_passive(tables: Tables, mechanism: Mapping[str, Any], facts: Known) -> bool:
    """Whether no column is left for the torque of a kind of mechanism that may have no motor."""
    machine, build = mechanism_of(mechanism), mechanism_kinds()[mechanism["kind"]]
    columns = tables.first.columns
    options = mechanism_options(build)
    if "driven" not in options or "torque" in facts.columns or not any(machine.driven):
        return False
    idle, units = [False] * machine.n, machine.position_units
    unused = guess_columns(tables.first, idle, units, facts.columns).unused
    damaged = any(quantity_of(name) in ("torque", "current") for name in tables.first.faults)
    # what has no name and never changes is no torque
    kinds = {quantity_of(name) for name in unused if quantity_of(name) or np.ptp(columns[name])}
    return kinds <= {"time", "velocity"} and not damaged


def targets_in(table: Table, facts: Known, joints: int) -> tuple[str, ...]:
    """Columns of the angles that a controller follows, where the table has no torques; or none.

    Currents are torques where their constant is known.
    """
    torques = ("torque",) if facts.kt is None else ("torque", "current")
    pushes = any(quantity_of(name) in torques for name in table.columns)
    targets = tuple(filter(is_target, table.columns))
    return () if pushes or "torque" in facts.columns or len(targets) != joints else targets


def actuator_of(
    targets: Sequence[str], facts: Known, efforts: Sequence[float] = ()
) -> dict[str, Any]:
    """The [actuator] table of a position controller with these targets; {} without any.

    efforts : largest torques where nobody has said a limit

    Raises
    ------
    InputError
        For a limit without targets.
    """
    limit = efforts if facts.limit is None else facts.limit
    if not targets and facts.limit is not None:
        raise InputError(
            f"--set limit={limit}: no columns of targets; leave it out, or rename them"
        )
    if not targets:
        return {}
    P, D = facts.gains or (UNKNOWN_GAIN, UNKNOWN_GAIN)
    bounds = {"limit": limit} if np.size(limit) else {}
    return {"target": _one_or_all(targets), "output": "torque", "P": P, "D": D, **bounds}


def describe_tables(tables: Tables, mechanism: Mapping[str, Any], facts: Known) -> Described:
    """A dataset.toml and a first suite for tables of a mechanism.

    Columns and units are guessed by names and numbers; units and signs are then corrected where the
    motion contradicts them, see `frictionid.check`.

    Raises
    ------
    InputError
        Where no column fits a quantity, a constant is missing, or the tables are damaged.
    """
    comments = {}
    if _is_passive(tables, mechanism, facts):
        joints = mechanism_of(mechanism).n
        mechanism = {**mechanism, "driven": [False] * joints if joints > 1 else False}
        comments["driven"] = "no column is left for a torque: passive motion"
    guesses = guess_tables(tables, mechanism, facts)
    if guesses.is_current and facts.kt is None:
        names = ", ".join(filter(None, guesses.torque.columns))
        raise InputError(
            f"{names} holds currents [{guesses.torque.unit}]: give the motor's torque constant "
            "with --kt [N m/A] and its gear ratio with --gear, or name a torque with --torque"
        )
    gear = 1.0 if facts.gear is None else facts.gear
    motor = {"kt": facts.kt, "gear": gear} if guesses.is_current else {}
    motor |= encoder_of(tables.first, guesses)
    machine = mechanism_of(mechanism)
    targets = targets_in(tables.first, facts, machine.n)
    guesses = guesses._replace(unused=tuple(n for n in guesses.unused if n not in targets))
    missing: tuple[str, ...] = (GAINS,) if targets and facts.gains is None else ()
    if targets and (facts.kt, facts.gear) != (None, None):
        missing += (OUTPUT,)
    actuator = actuator_of(targets, facts)
    currents = (n for n in guesses.unused if targets and quantity_of(n) == "current")
    said = tuple(
        f"{name} is a current: --kt and --gear take it, not the targets" for name in currents
    )
    draft = Draft(tables, mechanism, guesses, machine, motor, comments, actuator)
    draft = draft._replace(missing=missing, evidence=said)
    return described_draft(draft, blind=GAINS in missing)


def encoder_of(table: Table, guesses: ColumnGuesses) -> dict[str, Any]:
    """Keys of [motor] for the angles of a table that are taken as counts; {} for others."""
    counted = np.broadcast_to(guesses.angle.unit, len(guesses.angle.columns)) == "counts"
    if not counted.any():
        return {}
    names = compress(guesses.angle.columns, counted)
    keys: dict[str, Any] = counts_of(np.stack([table.columns[n] for n in names]), named=True)
    if not counted.all():
        keys["offset"] = np.where(counted, keys["offset"], 0.0).tolist()
    return keys


def described_draft(draft: Draft, *, blind: bool) -> Described:
    """Texts of a draft, its signs and units corrected where the motion contradicts them.

    blind : whether so much is missing that no sign can be corrected
    """
    dataset = loaded(draft)
    for _ in dataset.mechanism.joints:
        verdict = check(dataset)
        corrected = _corrected(draft, verdict, blind=blind)
        if corrected is draft:
            break
        draft, dataset = corrected, loaded(corrected)
    texts = dataset_text(draft), suite_text(draft, dataset)
    return Described(*texts, dataset, draft, verdict)


def loaded(draft: Draft) -> Dataset:
    """The data set that a draft describes."""
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "dataset.toml"
        file.write_text(dataset_text(draft), encoding="utf-8")
        try:
            return load_dataset(file, draft.tables.folder)
        except InputError as error:
            raise InputError(str(error).replace(f"{file}: ", "")) from None


def _corrected(draft: Draft, verdict: Verdict, *, blind: bool) -> Draft:
    """The draft with the convention that the motion asks for, where it contradicts the guesses."""
    kinds = {finding.kind: finding for finding in verdict.findings}
    late = [kinds[kind].text for kind in ("late_velocity", "wrong_velocity") if kind in kinds]
    if late and draft.velocity:
        said = tuple(f"velocities are left out: {text}" for text in late)
        draft = draft._replace(velocity=(), evidence=(*draft.evidence, *said))
    if blind:
        return draft
    if draft.guesses.hold == TORQUE_HOLD and _is_sampled(verdict):
        draft = draft._replace(guesses=draft.guesses._replace(hold="linear"))
    fitting = [s for s in verdict.conventions if s.convention.kind in kinds]
    if not fitting:
        return draft
    best = min(fitting, key=lambda s: s.score).convention
    guesses, motor = _with_convention(draft.guesses, best), _with_gears(draft, best)
    text = kinds[best.kind].text
    if guesses is None and motor is None:
        remark = f"frictionid check: {text}"
        repeated = remark in draft.evidence
        return draft if repeated else draft._replace(evidence=(*draft.evidence, remark))
    evidence = (*draft.evidence, f"corrected: {text}")
    return draft._replace(
        guesses=guesses or draft.guesses, motor=motor or draft.motor, evidence=evidence
    )


def _is_sampled(verdict: Verdict) -> bool:
    """Whether torques that are read as held are samples of one that is not.

    A held torque acts half a sample late. So does none that the motion shows to act as it is read.
    """
    measured = bool(verdict.torque) and all(t.source == "measured" for t in verdict.torque)
    if verdict.delay is None:
        return measured
    low, high = verdict.delay.interval
    early = low <= -0.5 / verdict.clock.rate <= high
    return early or measured and not low <= 0.0 <= high


def _with_gears(draft: Draft, best: Convention) -> dict[str, Any] | None:
    """The [motor] table with another zero or gear; None where that is not what is wrong."""
    motor, n = dict(draft.motor), len(best.angle)
    if best.kind == "motor_angles":
        return {**motor, "angle": "motor"}
    gear = np.broadcast_to(np.asarray(motor.get("gear", 1.0), dtype=float), n)
    flips = np.diag(best.angle)
    if best.kind == "flipped_gear" and np.array_equal(best.angle, np.diag(flips)):
        return {**motor, "gear": (gear * flips).tolist()}
    if best.kind not in (SHIFTED, ABSOLUTE):
        return None
    before = np.broadcast_to(np.asarray(motor.get("offset", 0.0), dtype=float), n)
    zero = best.angle @ before + best.offset
    there = {"offset": [round(float(radians), 6) for radians in zero]}
    if np.array_equal(best.angle, np.eye(n)):
        return {**motor, **there}
    turns_both = motor.get("angle") == "motor" and {"kt", "torque"} & {*motor}
    if turns_both and np.array_equal([best.angle, best.torque], [np.diag(flips)] * 2):
        return {**motor, "gear": (gear * flips).tolist(), **there}
    if motor or not np.array_equal(best.torque, np.eye(n)):
        return None
    return {"coupling": np.linalg.inv(best.angle).tolist(), "angle": "motor", **there}


def _with_convention(guesses: ColumnGuesses, best: Convention) -> ColumnGuesses | None:
    """The guesses under a convention; None where dataset.toml has no key for it."""
    units = {"degrees": "deg", "radians": "rad", "millimetres": "mm", "metres": "m"}
    if best.kind in units:
        return guesses.with_angle_unit(units[best.kind], "by the motion, see above")
    if best.kind in TORQUE_UNITS and guesses.torque.unit == "N m":
        torque = guesses.torque._replace(unit=best.kind, evidence="by the motion, see above")
        return guesses._replace(torque=torque)
    if best.kind not in ("flipped_angle", "flipped_torque", "flipped_joint"):
        return None
    diagonals = {"angle": best.angle, "torque": best.torque}
    before = {key: guesses.signs.get(key, 1) for key in diagonals}
    turned = {key: np.diag(d) * before[key] for key, d in diagonals.items()}
    signs = {key: tuple(int(s) for s in each) for key, each in turned.items()}
    return guesses._replace(signs=signs)


# --- Texts ----------------------------------------------------------------------------------------

_COMMENT = 40  # column of the comments
_LONG, _WIDE = 96, 130  # of a line, and of one with its comment


def dataset_text(draft: Draft) -> str:
    """Text of the dataset.toml of a draft."""
    g = draft.guesses
    units = [g.angle.unit] if isinstance(g.angle.unit, str) else g.angle.unit
    context = {
        "g": g,
        "values": draft.mechanism.get("parameters", {}),
        "driven": any(g.torque.columns),
        "bags": draft.tables.files[0].endswith(BAGS),
        "rates": [{"mrad": "rad/s", "rev": "rpm"}.get(unit, f"{unit}/s") for unit in units],
        "turned": {key: signs for key, signs in g.signs.items() if set(signs) != {1}},
    }
    return _rendered("dataset.toml.j2", draft, context)


def suite_text(draft: Draft, dataset: Dataset) -> str:
    """Text of a first suite: the laws and the method of `frictionid quick`."""
    plan, folds = plan_for(dataset), usual_kind(dataset.recordings)
    laws = [law.model_dump(exclude_none=True) for law in (*plan.laws, *plan.further)]
    context = {"folds": folds, "by_torque": plan.by_torque, "laws": laws}
    return _rendered("suite.toml.j2", draft, context)


def _rendered(template: str, draft: Draft, context: Mapping[str, Any]) -> str:
    filters = {"alone": _one_or_all, "comment": _comment}
    names = {"draft": draft, "line": _line, "name": draft.tables.folder.resolve().name}
    return render(template, {**names, **context}, filters=filters)


def _one_or_all(values: Sequence[Any]) -> Any:
    return values[0] if len(values) == 1 else list(values)


def _comment(text: str) -> str:
    return textwrap.fill(text, _LONG, initial_indent="# ", subsequent_indent="# ")


def _value(value: Any) -> str:
    """A value of TOML on one line.

    >>> print(_value(["stribeck", {"kind": "cogging", "harmonics": [7]}]))
    ["stribeck", { kind = "cogging", harmonics = [7] }]
    """
    if isinstance(value, Mapping):
        pairs = ((json.dumps(k) if "." in k else k, _value(v)) for k, v in value.items())
        return f"{{ {', '.join(f'{key} = {entry}' for key, entry in pairs)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value, ensure_ascii=False)


def _line(key: str, value: Any, comment: str = "") -> str:
    """A key with its value, and a comment: behind it, or above where the line would be long.

    >>> print(_line("locked", {"arm_5": 0.1}, "no motor"))
    locked = { arm_5 = 0.1 }                # no motor
    """
    text = _value(value)
    line = f"{key} = {text}"
    if len(line) > _LONG and isinstance(value, list | tuple):
        entries = textwrap.wrap(text[1:-1], _LONG, initial_indent="    ", subsequent_indent="    ")
        line = "\n".join([f"{key} = [", *entries, "]"])
    if not comment:
        return line
    if len(max(line.splitlines(), key=len)) + len(comment) > _WIDE or "\n" in line:
        return f"{_comment(comment)}\n{line}"
    return f"{line:<{_COMMENT - 1}} # {comment}"
