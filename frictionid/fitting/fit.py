"""What a fit says of its parameters: the estimates of a friction, by whatever method."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.friction import Friction
from frictionid.friction.provenance import Estimate

_NORMAL = 1.96, 1.645  # half-widths of 95 and 90 % over standard errors


def estimates_of(friction: Friction, joints: Sequence[str] = ()) -> tuple[Estimate, ...]:
    """Estimates of a fitted friction (n, P): those of shooting or of pooling, else of its numbers.

    Intervals of a one-step fit are those of its provenance; where that has none, nothing is said
    to be unidentified. A network's weights and terms that a sparse law does not have are left out.

    joints : names; "joint 1" and so on where they are missing
    """
    source, law = friction.provenance, friction.law
    fitted = source.refined or source.pooled
    if fitted is not None or law.is_network:
        return () if fitted is None else fitted.parameters
    theta, half = np.asarray(friction.theta, dtype=float), source.half_widths
    has = law.has_parameters(len(theta)) & ((theta != 0) | (not law.is_sparse))
    names = joints or [f"joint {j + 1}" for j in range(len(theta))]
    return tuple(
        _estimate(friction, names[j], (j, i), None if half is None else float(half[j, i]))
        for j, i in np.argwhere(has).tolist()
    )


def _estimate(
    friction: Friction, joint: str, place: tuple[int, int], half: float | None
) -> Estimate:
    """A parameter of a one-step fit with half the width of its interval, NaN for an endless one."""
    j, i = place
    name, value = friction.law.names[i], float(friction.theta[place])
    reach = np.inf if half is None or np.isnan(half) else half
    error = reach / _NORMAL[0]
    inner = _NORMAL[1] * error
    return Estimate(
        *("friction", f"{name} of {joint}", friction.units_at(j)[i], j, value, error),
        (value - inner, value + inner),
        (value - reach, value + reach),
        identified=half is None or reach <= abs(value),
    )
