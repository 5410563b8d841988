"""Faults of the machine itself: a joint that meets a stop, friction that changes meanwhile.

At a stop a joint turns back at its furthest angle, by a torque that nobody has logged.
"""

from collections.abc import Iterator

import numpy as np

from frictionid.arrays import MAD

from .findings import Finding, finding
from .motion import Measured
from .partial_regression import PARAMETER_PRIOR, nuisance_of
from .regression import FRICTION, Estimate, Regression, friction_columns

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


# A change of friction is named from this share, where it is known to this share and clear.
LEAST, KNOWN, ERRORS = 0.15, 0.1, 4.0


def drift_findings(regression: Regression, estimate: Estimate) -> Iterator[Finding]:
    """A finding for each joint whose friction grows or falls from the first to the last motion.

    The estimated friction of a joint, times the share of the motion that has gone by, is fitted
    beside friction of any shape and moderate changes of the mechanism, of all joints together.
    """
    rows, nominal = regression.rows, regression.measured.nominal
    each = estimate.value[nominal.shape[1] :]
    progress = np.argsort(np.lexsort((rows.start, rows.recording))) / max(len(rows.start) - 1, 1)
    columns = friction_columns(rows, FRICTION) * (progress - 0.5)[:, None, None]
    n, width = regression.torque.shape[1], len(FRICTION)
    parts = [slice(j * width, (j + 1) * width) for j in range(n)]
    changes = [columns[..., part] @ each[part] for part in parts]
    slides = [j for j in range(n) if np.abs(changes[j]).max(initial=0.0) > 0.0]
    if not slides:
        return
    fit = nuisance_of(rows, nominal, PARAMETER_PRIOR).beside(regression.torque)
    target = regression.torque - rows.required(nominal)
    change, error, _ = fit.estimate(target, *(changes[j] for j in slides))
    for j, size, wrong in zip(slides, change.tolist(), error.tolist(), strict=True):
        if abs(size) > max(LEAST, ERRORS * wrong) and wrong < KNOWN:
            words = {"size": abs(size), "way": "grows" if size > 0 else "falls"}
            yield finding("friction_drift", {"change": size, "error": wrong}, words, j + 1)
