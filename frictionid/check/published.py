"""Somebody's published model against the data: how far its numbers differ from least squares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.regression import Estimate
from frictionid.fitting.one_step.balances import Rows
from frictionid.friction import Friction

# Incompatible: the residual is this many times that of least squares, and some number differs by
# this share and this many standard errors.
WORSE, OFF, ERRORS = 1.5, 0.2, 4.0
# Mean of sgn(w) beyond which a window counts as motion in one direction.
ONE_WAY = 0.999


class Compared(NamedTuple):
    """A published model beside the least squares of the data.

    names, published, estimated, error (P,) : base parameters, and Coulomb and viscous per joint ;
    spread, best (n,) [N m] : RMS residual of the published model and of least squares, over the
    windows in which the joint moves in one direction
    """

    names: tuple[str, ...]
    published: Array
    estimated: Array
    error: Array
    spread: Array
    best: Array


def compared(
    rows: Rows, torque: Array, estimate: Estimate, parameters: Array, friction: Friction
) -> Compared:
    """Published numbers, estimates and residuals side by side.

    parameters : (R, nb) base parameters of the published model. Its friction curve is read as
    Coulomb and viscous friction by a line through the speeds that occur.
    """
    n = torque.shape[1]
    left = torque - rows.required(parameters)
    names, values = list(estimate.names[: parameters.shape[1]]), list(parameters[0])
    spread, best = np.full((2, n), np.nan)
    for j in range(n):
        # at a reversal a curve's mean is not its value at the mean velocity
        use = one_way(rows, j)
        w = rows.w[use, j]
        if not len(w):
            continue
        curve = friction.curve(w)[:, j]
        spread[j] = np.sqrt(np.mean((left[use, j] - curve) ** 2))
        best[j] = np.sqrt(np.mean(estimate.residual[use, j] ** 2))
        names += [f"coulomb_{j + 1}", f"viscous_{j + 1}"]
        values += list(np.linalg.lstsq(np.column_stack([np.sign(w), w]), curve, rcond=None)[0])
    at = [estimate.names.index(name) for name in names]
    value, error = estimate.value[at], estimate.error[at]
    return Compared(tuple(names), np.array(values), value, error, spread, best)


def one_way(rows: Rows, j: int) -> Array:
    """Windows (K,) in which joint j moves in one direction: there friction has a speed."""
    return np.asarray(rows.moving[:, j] & (np.abs(rows.friction[:, j, 0]) > ONE_WAY))


def incompatible(model: Compared) -> list[Finding]:
    """A finding with figures where the published numbers contradict the data."""
    off = np.abs(model.published - model.estimated)
    wrong = (off > ERRORS * model.error) & (off > OFF * np.abs(model.estimated))
    ratio = float(np.nanmax(model.spread / np.maximum(model.best, 1e-300)))
    if not wrong.any() or ratio < WORSE:
        return []
    figures = "; ".join(
        f"{name} {p:.3g} published, {v:.3g} +- {e:.1g} from the data"
        for name, p, v, e, w in zip(*model[:4], wrong, strict=True)
        if w
    )
    return [
        Finding(
            "published",
            "good",  # the data are not to blame
            f"the published numbers are incompatible with the data: {figures}; they leave "
            f"{ratio:.1f} times the residual of least squares",
            "check what they were fitted to before using them",
            None,
            {"ratio": ratio},
        )
    ]
