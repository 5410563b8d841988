"""Friction as an equation, with an interval or error behind each coefficient."""

from __future__ import annotations

from dataclasses import replace

from frictionid.comparison.methods import Fit
from frictionid.friction import Friction


def with_equations(fit: Fit) -> Friction:
    """Friction (F, n, P) of a fit; its provenance has a line for each joint of all data.

    Laws that are not sparse have none. Behind each coefficient stands its 95 % interval where the
    recipe shoots, and else its standard error in a one-step fit; `equation_errors` says which.
    """
    friction, last = fit.friction, fit.friction[-1]
    if not last.law.is_sparse:
        return friction
    bars = fit.error_bars()
    own = {
        "equation": last.law.equation(last.theta, bars.size, last.position_units),
        "equation_errors": bars.meaning,
    }
    return replace(friction, provenance={**friction.provenance, **own})
