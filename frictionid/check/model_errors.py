"""Errors of the nominal mechanism, tested one at a time.

Torque gains, rotors, base parameters, and friction that grows with the motor's torque: each is
fitted alone, with the friction of each joint free. `rivals` decides what that means.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.partial_regression import PartialRegression
from frictionid.check.regression import Estimate
from frictionid.fitting.one_step.balances import Rows
from frictionid.friction import Friction
from frictionid.mechanics import Plant


class ModelError(NamedTuple):
    """A change that would correct the nominal mechanism, or its friction.

    kind, words ; size and error in `unit`; share: relative to the nominal value (gain - 1, or the
    largest change of a base parameter); left: sum of squares over the one without any change; own:
    the same in the balance of the joint that it changes most
    """

    kind: str
    words: str
    size: float
    error: float
    unit: str
    share: float
    left: float
    own: float = 1.0


class _Candidate(NamedTuple):
    """An error to test: its column [N m per unit], and the relative size of one unit."""

    kind: str
    words: str
    column: Array
    unit: str
    share: float


def model_errors(
    plant: Plant, rows: Rows, torque: Array, fit: PartialRegression
) -> tuple[ModelError, ...]:
    """All errors, the one that explains most first.

    plant : nominal, one batch entry per recording ; rows : of unit vectors ; torque (K, n) [N m] ;
    fit : of these rows, with the friction of each joint free
    """
    nominal = np.asarray(plant.p)
    target = torque - rows.required(nominal)
    without = max(float(np.sum(fit.residual(target) ** 2)), 1e-300)
    out = []
    for kind, words, column, unit, share in _candidates(plant, rows, torque):
        size, error, left = fit.estimate(target, column)
        own = fit.left_in_row(target, column, size) if kind in ("gain", "rotor") else 1.0
        if kind == "gain":  # the joint feels 1 - c of what is logged
            size, share = 1 - size, -size
        else:
            share *= size
        out.append(ModelError(kind, words, size, error, unit, share, left / without, own))
    return tuple(sorted((e for e in out if np.isfinite(e.error)), key=lambda e: e.left))


def _candidates(plant: Plant, rows: Rows, torque: Array) -> Iterator[_Candidate]:
    mechanism, nominal = plant.mechanism, np.asarray(plant.p)[0]
    motors = [j for j, driven in enumerate(mechanism.driven) if driven]
    if len(motors) > 1:
        yield _Candidate("gain", "gain of all torques", torque, "", 1.0)
    for j in motors:
        own = torque * (np.arange(torque.shape[1]) == j)
        yield _Candidate("gain", f"gain of torque {j + 1}", own, "", 1.0)
    sliding = rows.friction[..., 0]  # mean of sgn(w)
    for j in motors:
        own = np.abs(torque) * sliding * (np.arange(torque.shape[1]) == j)
        words = f"the friction of joint {j + 1} grows with its torque"
        yield _Candidate("load", words, own, "", 1.0)
    parameters = {name: float(value[0]) for name, value in plant.parameters.items()}
    for name in (p.name for p in mechanism.parameters if p.rotor):
        # base parameters are linear in a rotor inertia
        larger = {**parameters, name: parameters[name] + 1.0}
        change = mechanism.base(larger) - mechanism.base(parameters)
        share = float(np.max(np.abs(change) / np.maximum(np.abs(nominal), 1e-12)))
        words = f"rotor inertia missing ({name})"
        yield _Candidate("rotor", words, rows.regressor @ change, "kg m^2", share)
    for i, (name, unit) in enumerate(zip(mechanism.base_names, mechanism.base_units, strict=True)):
        if nominal[i]:
            share = 1 / abs(float(nominal[i]))
            yield _Candidate("base", name, rows.regressor[..., i], unit, share)


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
