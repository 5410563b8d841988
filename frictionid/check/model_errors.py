"""Errors of the nominal mechanism, tested one at a time: torque gains, rotors, base parameters.

Each error is fitted alone, with friction free. The one that leaves the least is named if it is
large and explains much; errors that do nearly as well are named beside it, for the data then cannot
distinguish them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows
from frictionid.check.partial_regression import partial_regression
from frictionid.mechanics import Mechanism, Plant

# Nominal numbers of real machines are rarely better than this share.
LARGE = 0.1
# Another gear or torque constant stays within these factors; beyond them something else is wrong.
GAINS = (0.2, 5.0)
# An error is named where it removes this share of the sum of squares ...
EXPLAINS = 0.3
# ... and others are named beside it that leave less than this much more than it.
ALIKE = 1.1


class ModelError(NamedTuple):
    """A change that would correct the nominal mechanism.

    kind, words ; size and error in `unit`; share: relative to the nominal value (gain - 1, or the
    largest change of a base parameter); left: sum of squares over the one without any change
    """

    kind: str
    words: str
    size: float
    error: float
    unit: str
    share: float
    left: float


class _Candidate(NamedTuple):
    """An error to test: its column [N m per unit], and the relative size of one unit."""

    kind: str
    words: str
    column: Array
    unit: str
    share: float


def model_errors(plant: Plant, rows: Rows, torque: Array) -> tuple[ModelError, ...]:
    """All errors, the one that explains most first.

    plant : nominal, one batch entry per recording ; rows : of unit vectors ; torque (K, n) [N m]
    """
    nominal = np.asarray(plant.p)
    fit = partial_regression(rows, torque, nominal)
    target = torque - rows.required(nominal)
    without = max(float(np.sum(fit.residual(target) ** 2)), 1e-300)
    out = []
    for kind, words, column, unit, share in _candidates(plant, rows, torque):
        size, error, left = fit.estimate(target, column)
        if (
            kind == "gain"
        ):  # torque minus c times torque fits: the joint feels 1 - c of what is logged
            out.append(ModelError(kind, words, 1 - size, error, unit, -size, left / without))
        else:
            out.append(ModelError(kind, words, size, error, unit, size * share, left / without))
    return tuple(sorted((e for e in out if np.isfinite(e.error)), key=lambda e: e.left))


def errors_named(errors: Sequence[ModelError]) -> list[ModelError]:
    """The errors to be named, those that the data cannot distinguish side by side; or none."""
    possible = [e for e in errors if e.kind != "rotor" or e.size > 0]
    if not possible or 1 - possible[0].left < EXPLAINS:
        return []
    best = possible[0]
    if best.kind == "gain" and not GAINS[0] < best.size < GAINS[1]:
        return []
    if abs(best.share) < LARGE or abs(best.size - (best.kind == "gain")) < 4 * best.error:
        return []
    return [e for e in possible if e.left <= ALIKE * best.left]


def free_share(rows: Rows, torque: Array, nominal: Array) -> float:
    """Sum of squares with all base parameters free, over the one with the nominal ones."""
    fit = partial_regression(rows, torque, nominal)
    target = fit.residual(torque - rows.required(nominal))
    columns = fit.residual(np.moveaxis(rows.regressor, -1, 0)).T
    size = np.sqrt((columns**2).sum(0))
    if not np.abs(torque).any():  # only ratios show: hold the largest
        size[np.argmax(size * np.abs(nominal[0]))] = 0.0
    columns = columns[:, size > 0] / size[size > 0]
    left = target - columns @ np.linalg.lstsq(columns, target, rcond=1e-7)[0]
    return float(left @ left) / max(float(target @ target), 1e-300)


def _candidates(plant: Plant, rows: Rows, torque: Array) -> Iterator[_Candidate]:
    mechanism, nominal = plant.mechanism, np.asarray(plant.p)[0]
    motors = [j for j, driven in enumerate(mechanism.description.driven) if driven]
    if len(motors) > 1:
        yield _Candidate("gain", "gain of all torques", torque, "", 1.0)
    for j in motors:
        own = torque * (np.arange(torque.shape[1]) == j)
        yield _Candidate("gain", f"gain of torque {j + 1}", own, "", 1.0)
    parameters = {name: float(value[0]) for name, value in plant.parameters.items()}
    for name in _rotors(mechanism):
        # base parameters are linear in a rotor inertia
        larger = {**parameters, name: parameters[name] + 1.0}
        change = mechanism.base(larger) - mechanism.base(parameters)
        share = float(np.max(np.abs(change) / np.maximum(np.abs(nominal), 1e-12)))
        words = f"rotor inertia missing ({name})"
        yield _Candidate("rotor", words, rows.regressor @ change, "kg m^2", share)
    for i, base in enumerate(mechanism.description.base):
        if nominal[i]:
            share = 1 / abs(float(nominal[i]))
            yield _Candidate("base", base.name, rows.regressor[..., i], base.unit, share)


def _rotors(mechanism: Mechanism) -> list[str]:
    symbols: set[Any] = set()
    for inertia, _ in mechanism.description.rotors:
        symbols |= inertia.free_symbols
    names = {str(s) for s in symbols}
    return [name for name in mechanism.defaults if name in names]
