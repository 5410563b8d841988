"""Texts of a first dataset.toml and suite.toml, with comments that say what speaks for them."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from frictionid.mechanics import Mechanism
from frictionid.quickstart.column_guesses import ColumnGuesses

_COMMENT = 40  # column of the comments
_LONG, _WIDE = 96, 130  # of a line, and of one with its comment


@dataclass(frozen=True)
class Draft:
    """All that a first dataset.toml says.

    files : tables of the recordings; mechanism : the [mechanism] table
    motor : [motor], where columns are of motors, or hold currents; actuator : [actuator]
    evidence : what speaks for signs and units, from the physics
    machine : the mechanism; comments : comments of keys of [mechanism], and below it as ""
    velocity : columns of velocities
    """

    name: str
    files: tuple[str, ...]
    mechanism: Mapping[str, Any]
    guesses: ColumnGuesses
    machine: Mechanism
    motor: Mapping[str, Any] = field(default_factory=dict)
    evidence: tuple[str, ...] = ()
    comments: Mapping[str, str] = field(default_factory=dict)
    actuator: Mapping[str, Any] = field(default_factory=dict)
    velocity: tuple[str, ...] = ()


def dataset_text(draft: Draft) -> str:
    """Text of the dataset.toml of a draft."""
    parts = (_head, _mechanism, _columns, _units, _motor, _actuator, _signs, _hold, _recordings)
    return "\n".join(line for part in parts for line in part(draft)) + "\n"


def suite_text(draft: Draft, horizons: Sequence[float], recordings: int) -> str:
    """Text of a first suite: no friction, Coulomb and viscous, Stribeck, by two recipes."""
    return "\n".join(_suite(draft, horizons, recordings)) + "\n"


def _head(draft: Draft) -> Iterator[str]:
    yield "# Written by frictionid init: what speaks for its guesses stands behind each #."
    yield "# Correct what is wrong. All keys: data/README.md of frictionid."
    yield _line("name", draft.name)
    for text in draft.evidence:
        yield from textwrap.wrap(text, 96, initial_indent="# ", subsequent_indent="# ")


def _mechanism(draft: Draft) -> Iterator[str]:
    values = draft.mechanism.get("parameters", {})
    yield "\n[mechanism]"
    for key, value in draft.mechanism.items():
        said = f"all of it: frictionid mechanisms {value}" if key == "kind" else ""
        if key != "parameters":
            yield _line(key, value, draft.comments.get(key, said))
    for text in draft.comments.get("", "").splitlines():
        yield f"# {text}"
    yield "\n[mechanism.parameters]"
    for p in draft.machine.parameters:
        comment, value = f"{p.meaning} [{p.unit}]", values.get(p.name, p.default)
        usual = p.name not in values
        said = draft.comments.get(p.name, "; usual value" * usual)
        text = _line(p.name, value, comment + said)
        yield "# " * usual + text


def _columns(draft: Draft) -> Iterator[str]:
    g = draft.guesses
    yield "\n[columns]"
    yield _line("time", g.time.columns[0], g.time.evidence)
    yield _line("angle", _one_or_all(g.angle.columns), g.angle.evidence)
    if any(g.torque.columns):
        yield _line("torque", _one_or_all(g.torque.columns), g.torque.evidence)
    if draft.velocity:
        yield _line("velocity", _one_or_all(draft.velocity), "kept, and tested by check")
    if g.missing:
        yield _line("missing", "drop", f"{g.missing} rows have no angle: they are gaps")
    if g.unused:
        yield f"# not used: {', '.join(g.unused)}"


def _units(draft: Draft) -> Iterator[str]:
    g = draft.guesses
    yield "\n[units]"
    yield _line("time", g.time.unit)
    yield _line("angle", g.angle.unit)
    if draft.velocity:
        units = [g.angle.unit] if isinstance(g.angle.unit, str) else g.angle.unit
        yield _line("velocity", _one_or_all([f"{unit}/s" for unit in units]), "as the angles")
    if any(g.torque.columns):
        yield _line("torque", g.torque.unit, "a current, see [motor]" if g.is_current else "")


_MOTOR = {
    "kt": "torque constant at the motor's shaft [N m/A]",
    "gear": "torque at the joint = kt gear current",
    "angle": "the columns are of the motors: joint angle = motor angle / gear + offset",
    "torque": "the columns are of the motors: torque at the joint = gear motor torque",
    "offset": "joint angles at which the motors' are zero [rad]",
}
_ACTUATOR = {
    "target": "targets that the joints follow: no torque was measured",
    "output": "P (target - angle) - D velocity is a torque at the joint",
    "P": "[N m/rad]",
    "D": "[N m s/rad]",
    "limit": "largest torques, of the file [N m]",
}


def _motor(draft: Draft) -> Iterator[str]:
    if draft.motor:
        yield "\n[motor]"
    for key, value in draft.motor.items():
        yield _line(key, value, draft.comments.get(f"motor.{key}", _MOTOR[key]))


def _actuator(draft: Draft) -> Iterator[str]:
    if draft.actuator:
        yield "\n[actuator]"
    for key, value in draft.actuator.items():
        yield _line(key, value, draft.comments.get(f"actuator.{key}", _ACTUATOR[key]))


def _signs(draft: Draft) -> Iterator[str]:
    turned = {key: signs for key, signs in draft.guesses.signs.items() if set(signs) != {1}}
    if turned:
        yield "\n[signs]"
        for key, signs in turned.items():
            yield _line(key, _one_or_all(signs), "-1: the column counts the other way round")


def _hold(draft: Draft) -> Iterator[str]:
    said = {
        "previous": "held until the next value; a sensor's samples: linear",
        "linear": "a sensor's samples, which change all the time",
    }
    if any(draft.guesses.torque.columns):
        yield "\n[hold]"
        yield _line("torque", draft.guesses.hold, said[draft.guesses.hold])


def _recordings(draft: Draft) -> Iterator[str]:
    yield "\n[recordings]"
    yield _line("patterns", list(draft.files))
    if split := draft.guesses.split:
        yield _line("split", split.columns[0], f"{split.evidence}, each a recording")


def _suite(draft: Draft, horizons: Sequence[float], recordings: int) -> Iterator[str]:
    single = recordings == 1
    yield "# A first suite: frictionid compare suite.toml"
    yield _line("name", f"{draft.name}-first")
    yield _line("horizons", list(horizons), "predictions so far ahead are scored [s]")
    yield "\n[folds]"
    yield _line(
        "kind",
        "blocks" if single else "recordings",
        "stretches of time: there is one recording" if single else "whole recordings are held out",
    )
    if single and draft.machine.kind in ("urdf", "mjcf"):
        yield _line("count", 5, "each is fitted apart: five take half as long as ten")
    yield "\n[[datasets]]"
    yield _line("path", ".")
    if draft.machine.kind in ("urdf", "mjcf"):
        yield from _robot_suite(draft)
        return
    yield "\n[[recipes]]"
    yield _line("name", "integral", "momentum balance of smoothed states: seconds")
    yield "\n[[recipes]]"
    yield _line("name", "shooting", "on the measured angles, with intervals: a minute or more")
    yield _line("by", "shooting")
    yield "# free are friction, and of inertia, delay, bias what the data tell, or what is named:"
    yield '# free = ["friction", "delay", "inertia"]     # also: "gain", "bias", "offset"'
    for kind, said in (
        ("none", "the baseline"),
        ("coulomb_viscous", "all kinds: frictionid identifiers"),
        ("stribeck", ""),
    ):
        yield "\n[[identifiers]]"
        yield _line("kind", kind, said)


def _robot_suite(draft: Draft) -> Iterator[str]:
    """Recipe and laws for arms: torques where they are measured, else one step."""
    yield "\n[[recipes]]"
    if draft.actuator:
        yield _line("name", "integral", "no torque was measured: momentum balance, one step")
    else:
        yield _line("name", "inverse_dynamics", "friction, inertia, delay, bias by the torques")
    for kind, said in (
        ("none", "the baseline"),
        ("coulomb_viscous", "all kinds: frictionid identifiers"),
        ("stribeck", ""),
        *(
            (("load_dependent", "friction that grows with the load of the gear"),)
            * (not draft.actuator)
        ),
    ):
        yield "\n[[identifiers]]"
        yield _line("kind", kind, said)


def _one_or_all(values: Sequence[Any]) -> Any:
    return values[0] if len(values) == 1 else list(values)


def _line(key: str, value: Any, comment: str = "") -> str:
    """A key with its value, and a comment: behind it, or above where the line would be long.

    >>> print(_line("locked", {"arm_5": 0.1}, "no motor"))
    locked = { arm_5 = 0.1 }                # no motor
    """
    text = json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        text = ", ".join(f"{json.dumps(k) if '.' in k else k} = {v}" for k, v in value.items())
        text = f"{{ {text} }}"
    line = f"{key} = {text}"
    if len(line) > _LONG and isinstance(value, list):
        entries = textwrap.wrap(text[1:-1], _LONG, initial_indent="    ", subsequent_indent="    ")
        line = "\n".join([f"{key} = [", *entries, "]"])
    if not comment:
        return line
    if len(max(line.splitlines(), key=len)) + len(comment) > _WIDE or "\n" in line:
        above = textwrap.wrap(comment, _LONG, initial_indent="# ", subsequent_indent="# ")
        return "\n".join([*above, line])
    return f"{line:<{_COMMENT - 1}} # {comment}"
