"""End stops: a joint turns back at its furthest angle, by a torque that nobody has logged."""

from collections.abc import Iterator

import numpy as np

from frictionid.arrays import MAD

from .findings import Finding, finding
from .motion import Measured

WIDTH = 0.1  # [s] of the windows in which a joint turns back
NEAR, FEWEST = 0.03, 6  # of the range of angles: what counts as its end; windows there
SPEED = 0.2  # of the fast speed: what is slower rests against a stop
# What the balance lacks there, in multiples of what it usually lacks: median, and lower quartile
# (at most 3.0 and 2.8 in recordings of six real machines without stops).
CLEAR, MOSTLY = 8.0, 2.0


def stop_findings(measured: Measured) -> Iterator[Finding]:
    """A finding for each end of a joint's range at which it meets something that turns it back."""
    samples = measured.balances.samples
    windows = samples.windows(WIDTH)
    at = np.stack([windows.first, (windows.first + windows.last) // 2, windows.last])
    angle, begin, end = samples.q[at], samples.w[windows.first], samples.w[windows.last]
    turned = {}  # windows that come to the upper or lower end fast, and leave it slowly or back
    for sign in (1.0, -1.0):
        top = (sign * angle).max(axis=0)
        near = top > top.max(axis=0) - NEAR * np.ptp(samples.q, axis=0)
        fast = SPEED * measured.speeds.fast
        turned[sign] = near & (sign * begin > fast) & (sign * end < 0.5 * sign * begin)
    if not any((turns.sum(axis=0) >= FEWEST).any() for turns in turned.values()):
        return
    rows = measured.balances.rows(windows, reversals=True)
    left = rows.means(measured.torque) - rows.required(measured.nominal)
    usual = np.ones(left.shape[1])
    for j in range(len(usual)):  # what slides on shows friction, and how well all balances hold
        slides = rows.moving[:, j] & (begin[:, j] * end[:, j] > 0)
        shapes = rows.shapes(j)
        left[:, j] -= shapes @ np.linalg.lstsq(shapes[slides], left[slides, j])[0]
        usual[j] = MAD * np.median(np.abs(left[slides, j])) if slides.any() else np.inf
    for sign, turns in turned.items():
        for j in np.flatnonzero(turns.sum(axis=0) >= FEWEST).tolist():
            push = sign * left[turns[:, j], j] / max(float(usual[j]), 1e-300)
            if np.median(push) > CLEAR and np.quantile(push, 0.25) > MOSTLY:
                numbers = {"angle": float(sign * (sign * angle[..., j]).max())}
                unit = measured.mechanism.position_units[j]
                yield finding("end_stop", numbers, {"unit": unit}, j + 1)
