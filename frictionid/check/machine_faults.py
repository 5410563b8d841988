"""Faults of the machine itself: a joint that meets a stop, friction that changes meanwhile.

At a stop a joint turns back at its furthest angle, by a torque that nobody has logged.
"""

from collections.abc import Iterator

import numpy as np

from frictionid.arrays import MAD, Array
from frictionid.fitting.one_step.balances import Rows

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
    """A finding for each joint whose friction grows or falls, over all recordings or within each.

    The estimated friction of a joint, times the share of the motion that has gone by, is fitted
    beside friction of any shape and moderate changes of the mechanism, of all joints together.
    """
    rows, nominal = regression.rows, regression.measured.nominal
    each = estimate.value[nominal.shape[1] :]
    shapes = friction_columns(rows, FRICTION)
    n, width = regression.torque.shape[1], len(FRICTION)
    parts = [slice(j * width, (j + 1) * width) for j in range(n)]
    friction = np.stack([shapes[..., part] @ each[part] for part in parts])
    slides = np.flatnonzero(np.abs(friction).max(axis=(1, 2), initial=0.0))
    if not len(slides):
        return
    fit = nuisance_of(rows, nominal, PARAMETER_PRIOR).beside(regression.torque)
    target = regression.torque - rows.required(nominal)
    left = {}
    for course, progress in _courses(rows).items():
        columns = friction[slides] * (progress - 0.5)[:, None]
        left[course] = fit.estimate(target, *columns)
    course, (change, error, _) = min(left.items(), key=lambda item: item[1][2])
    for j, size, wrong in zip(slides.tolist(), change.tolist(), error.tolist(), strict=True):
        if abs(size) > max(LEAST, ERRORS * wrong) and wrong < KNOWN:
            words = {"size": abs(size), "way": "grows" if size > 0 else "falls", "course": course}
            yield finding("friction_drift", {"change": size, "error": wrong}, words, j + 1)


def _courses(rows: Rows) -> dict[str, Array]:
    """Share (K,) of the motion that has gone by: of all recordings, and of each for itself."""
    first = np.full(int(rows.recording.max()) + 1, np.inf)
    np.minimum.at(first, rows.recording, rows.start)
    time = rows.start - first[rows.recording]
    rank = np.argsort(np.lexsort((rows.start, rows.recording)))
    courses = {"in the course of the recordings": rank / max(len(rank) - 1, 1)}
    if len(first) > 1:
        courses["within each recording"] = time / max(float(time.max()), 1e-300)
    return courses
