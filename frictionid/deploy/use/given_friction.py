"""The friction that a user gives: as it is, or as part of a fit."""

from __future__ import annotations

from typing import Any

from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.temperature import refuse_temperature


def given_friction(given: Any) -> Friction:
    """A friction as it is, and that of a fit.

    Raises
    ------
    InputError
        For anything else, and for friction that depends on the temperature.
    """
    friction = getattr(given, "friction", given)
    if not isinstance(friction, Friction):
        raise InputError(
            f"a friction must be a Friction or a Fit, not {given!r:.60}: "
            'fid.load_model("model.json") reads a file'
        )
    refuse_temperature(friction.law, "a simulator or controller")
    return friction
