"""Momentum balances over short windows: what all checks of the mechanics are computed from.

Over a window [a, b], and for each joint on its own,

    ((M w)|b - (M w)|a - integral of dL/dq dt) / (b - a) = mean of (u - Tf)      [N m]

The left side is linear in the base parameters; the rows hold its response to parameter vectors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.check.motion import Motion, unit_balances
from frictionid.fitting.one_step.balances import Balances, Rows
from frictionid.mechanics import Mechanism

# Long enough that the noise of two velocities does not hide friction, short enough to lie between
# two reversals of a swinging joint.
WIDTH = 0.15
# Where the smoother's blur is below this share of a window, windows may be shorter, down to this
# [s], and may hold a reversal of the joint.
SHARP, SHORTEST = 1 / 30, 0.05
# Fewest windows of motion of a joint that a statement about it needs.
MIN_WINDOWS = 20


def unit_rows(
    mechanism: Mechanism, motions: Sequence[Motion], width: float = WIDTH, reversals: bool = False
) -> Rows:
    """Rows whose parameter vectors are the units of the base parameters: responses to them.

    width : [s] of a window, at least two samples; reversals : see `Balances.rows`
    """
    return windows_of(unit_balances(mechanism, motions), width, reversals)


def windows_of(balances: Balances, width: float = WIDTH, reversals: bool = False) -> Rows:
    """Rows of balances over all windows of a width [s]."""
    return balances.rows(balances.samples.windows(width), reversals=reversals)


def adaptive_rows(mechanism: Mechanism, motions: Sequence[Motion]) -> Rows:
    """Unit rows for the estimates, see `adapted`."""
    return adapted(unit_balances(mechanism, motions), motions)


def adapted(balances: Balances, motions: Sequence[Motion]) -> Rows:
    """Rows for the estimates: windows as short as the smoother's blur allows.

    Real friction is not quite Coulomb and viscous, so that least squares depend on which speeds and
    accelerations count. Without the reversals of `emps`, where friction is lower than at any speed,
    its Coulomb friction comes out 5 % higher and the viscous one 5 % lower; long windows take 1 %
    of its mass. Published values come from all samples. A noisy motion, however, is blurred, worst
    at reversals, where the acceleration jumps: at 60 Hz with 3 mrad, short windows and reversals
    cost 1 to 2 % of the inertias and 15 % of viscous friction (simulated), and are left out.
    """
    if is_blurred(motions):
        return windows_of(balances)
    return windows_of(balances, max(_blur(motions) / SHARP, SHORTEST), reversals=True)


def is_blurred(motions: Sequence[Motion]) -> bool:
    """Whether the smoother blurs the motions too much for shorter windows."""
    return _blur(motions) > SHARP * WIDTH


def _blur(motions: Sequence[Motion]) -> float:
    return float(np.median([m.blur.max() for m in motions]))
