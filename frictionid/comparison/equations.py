"""Friction as an equation, with an interval behind each coefficient."""

from __future__ import annotations

from dataclasses import replace

from frictionid.comparison.methods import Fit
from frictionid.friction import Friction


def with_equations(fit: Fit) -> Friction:
    """Friction (F, n, P) of a fit; its provenance has a line for each joint of all data.

    Laws that are not sparse have none. Intervals of 95 % are those of shooting where the recipe
    shoots, and else those of the one-step fit.
    """
    friction, last = fit.friction, fit.friction[-1]
    if not last.law.is_sparse:
        return friction
    lines = last.law.equation(last.theta, fit.half_widths(), last.angle_unit)
    return replace(friction, provenance={**friction.provenance, "equation": lines})
