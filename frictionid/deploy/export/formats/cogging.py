"""Cogging as a table for a controller's map: what to add to the motor torque, over the angle.

A CSV and a C header with the same numbers, over one turn of the motor, after which they repeat.
"""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import at_rest
from frictionid.friction.laws import Cogging
from frictionid.friction.laws.combined import CombinedLaw

from ..exported import ExportedFriction, ExportSettings, Written
from .c import comment

_SAMPLES, _EACH = 256, 64  # at least, and for each period of the fastest wave: 0.12 % off between


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """CSV and C header of the cogging torques of all joints."""
    law = _cogging_of(model)
    count = max(_SAMPLES, _EACH * max(law.orders))
    period = 2 * np.pi / law.gear
    angle = np.arange(count) * period / count
    torque = _torques(model, law, angle)
    unit, force = (
        " or ".join(dict.fromkeys(model.units)),
        " or ".join(dict.fromkeys(model.torque_units)),
    )
    about = [
        *model.facts,
        f"Cogging over {period:.9g} {unit}, a turn of the motor: add it to the motor torque.",
    ]
    rows = (",".join(f"{x:.9g}" for x in row) for row in np.column_stack([angle, torque]))
    heads = ",".join([f"angle [{unit}]", *(_quoted(f"{name} [{force}]") for name in model.joints)])
    table = "\n".join([*(f"# {line}" for line in about), heads, *rows]) + "\n"
    header = _header(settings, period, torque, [comment(line) for line in about])
    lost = ("a table over the angle holds the cogging alone: friction is left to another file",)
    note = "interpolate between the angles; behind the last one the table begins anew"
    return Written({".csv": table.encode(), ".h": header.encode()}, lost, notes=(note,))


def _cogging_of(model: ExportedFriction) -> Cogging:
    """The cogging of a law, the one of a sum."""
    law = model.law
    parts = law.parts if isinstance(law, CombinedLaw) else (law,)
    for part in parts:
        if isinstance(part, Cogging):
            return part
    raise InputError(
        f"cogging: {type(law).__name__} has no torque of the position alone: fit a sum with "
        'cogging, such as laws = ["coulomb_viscous", { kind = "cogging", harmonics = "auto" }]'
    )


def _torques(model: ExportedFriction, law: Cogging, angle: Array) -> Array:
    """Torque (S, n) of the cogging at angles (S,)."""
    names, theta = model.law.names, np.asarray(model.friction.theta, dtype=float)
    numbers = theta[:, [names.index(name) for name in law.names]]
    q = np.repeat(angle[:, None], len(theta), axis=1)
    return np.asarray(law.torque(numbers, at_rest(0.0 * q)._replace(q=q), ()))


def _quoted(name: str) -> str:
    """A name as a cell of a CSV."""
    return '"' + name.replace('"', '""') + '"' if set(name) & set(',"') else name


def _header(settings: ExportSettings, period: float, torque: Array, about: list[str]) -> str:
    count, n = torque.shape
    real, end = settings.precision, "f" if settings.precision == "float" else ""
    name, big = settings.name, settings.name.upper()
    numbers = ",\n".join("    {" + ", ".join(f"{x:.9e}{end}" for x in row) + "}" for row in torque)
    text = "\n   ".join(about)
    return f"""/* {text} */
#ifndef {big}_COGGING_H
#define {big}_COGGING_H
#include <math.h>

#define {big}_COGGING_SAMPLES {count}
#define {big}_COGGING_PERIOD {period:.17g}{end}

static const {real} {name}_cogging_table[{count}][{n}] = {{
{numbers}
}};

/* Torque to add to that of a motor (from 0) at the angle of its joint. */
static inline {real} {name}_cogging(int joint, {real} angle)
{{
    const {real} place = angle / {big}_COGGING_PERIOD;
    const {real} at = (place - floor{end}(place)) * {big}_COGGING_SAMPLES;
    const int first = (int)at % {big}_COGGING_SAMPLES;
    const int next = (first + 1) % {big}_COGGING_SAMPLES;
    const {real} share = at - floor{end}(at);
    const {real} a = {name}_cogging_table[first][joint];
    return a + share * ({name}_cogging_table[next][joint] - a);
}}

#endif
"""
