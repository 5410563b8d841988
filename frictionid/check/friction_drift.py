"""Friction that changes in the course of the recordings, as where a machine warms up."""

from collections.abc import Iterator

import numpy as np

from .findings import Finding, finding
from .partial_regression import nuisance_of
from .regression import FRICTION, Estimate, Regression, friction_columns

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
    fit = nuisance_of(rows, nominal, uncertain_mechanism=True).beside(regression.torque)
    target = regression.torque - rows.required(nominal)
    change, error, _ = fit.estimate(target, *(changes[j] for j in slides))
    for j, size, wrong in zip(slides, change.tolist(), error.tolist(), strict=True):
        if abs(size) > max(LEAST, ERRORS * wrong) and wrong < KNOWN:
            words = {"size": abs(size), "way": "grows" if size > 0 else "falls"}
            yield finding("friction_drift", {"change": size, "error": wrong}, words, j + 1)
