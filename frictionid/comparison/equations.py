"""What a fit says of its friction beyond its numbers: equations, and intervals of one-step fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.fitting.method import Fit
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


def with_intervals(friction: Friction, fit: Fit) -> Friction:
    """Friction (F, n, P) of a one-step fit, with the intervals of all data in its provenance.

    `half_widths` (n, P) of 95 % intervals of the noise alone, None where there is none, and what
    they hold in words. Networks and laws without derivatives have none; shooting has its own result
    document.
    """
    law = friction.law
    derivable = law.names and (law.has_gradient or law.has_memory)
    if fit.refined is not None or law.is_network or not derivable:
        return friction
    half = [[v if np.isfinite(v) else None for v in joint] for joint in fit.half_widths().tolist()]
    hold = "noise alone, not the bias of smoothed states"
    known = {"half_widths": half, "half_widths_hold": hold}
    return replace(friction, provenance={**friction.provenance, **known})
