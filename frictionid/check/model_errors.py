"""Errors of the nominal mechanism, tested one at a time.

Torque gains, rotors, base parameters, and friction that grows with the motor's torque: each is
fitted alone, with the friction of each joint free. `rivals` decides what that means.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.partial_regression import PartialRegression
from frictionid.fitting.one_step.balances import Rows
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
