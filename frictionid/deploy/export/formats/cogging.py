"""Cogging as a table for a controller's map: what to add to the motor torque, over the angle.

A CSV and a C header with the same numbers, over one turn of the motor, after which they repeat.
"""

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.files import csv_text
from frictionid.friction import at_rest
from frictionid.friction.laws import Cogging
from frictionid.friction.laws.combined import CombinedLaw

from ..exported import ExportedFriction, ExportSettings, Written
from ..expressions import rendered
from .c import comment

_SAMPLES, _EACH = 256, 64  # at least, and for each period of the fastest wave: 0.12 % off between


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """CSV and C header of the cogging torques of all joints."""
    law = _cogging_of(model)
    count = max(_SAMPLES, _EACH * max(law.orders))
    period = 2 * np.pi / law.gear
    angle = np.arange(count) * period / count
    torque = _torques(model, law, angle)
    unit, force = (" or ".join(dict.fromkeys(x)) for x in (model.units, model.torque_units))
    about = [
        *model.facts,
        f"Cogging over {period:.9g} {unit}, a turn of the motor: add it to the motor torque.",
    ]
    heads = [f"angle [{unit}]", *(f"{name} [{force}]" for name in model.joints)]
    frame = pd.DataFrame(np.column_stack([angle, torque]), columns=heads)
    table = "\n".join([*(f"# {line}" for line in about), csv_text(frame)])
    end = "f" if settings.precision == "float" else ""
    context = {"end": end, "about": about, "comment": comment, "torque": torque, "period": period}
    header = rendered("cogging.h.j2", model, settings, context)
    lost = ("a table over the angle holds the cogging alone: friction is left to another file",)
    note = "interpolate between the angles; behind the last one the table begins anew"
    return Written({".csv": table.encode(), ".h": header}, lost, notes=(note,))


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
