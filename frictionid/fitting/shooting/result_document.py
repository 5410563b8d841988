"""What a fit by shooting estimated, for files, tables and pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.fitting.parameters.parameter_block import IDEAL, Parameter
from frictionid.fitting.shooting.combinations import CombinationLaw
from frictionid.fitting.shooting.covariance import Covariance
from frictionid.fitting.shooting.refine import Refined
from frictionid.friction.provenance import Bands, Estimate, Estimates

BEYOND = 1.5  # of the curves' velocities: that far the bands reach, to be seen growing


def refined_estimates(result: Refined, dataset: Dataset, grid: Array) -> Estimates:
    """Parameters with intervals, correlation, curves with bands, and how it went.

    Each parameter has its nominal value beside it: the data set's mechanism gives base parameters,
    its servo a motor's constants, a log without faults the rest; friction has none. Where
    recordings have masses of their own, base parameters are those of their mean. A network's
    combinations, whose values mean nothing, are left out: its uncertainty is in its bands.
    `bands` has the curve of each joint with half-widths at velocities (V, n), half as far again as
    those of the grid (V, n).
    """
    covariance = result.covariance
    named = [k for k, p in enumerate(covariance.parameters) if not _combines(result, p)]
    return Estimates(
        **vars(result.diagnostics),
        parameters=tuple(_estimates(covariance, dataset, named)),
        correlation=np.asarray(covariance.correlation)[np.ix_(named, named)],
        covariance=np.asarray(covariance.matrix)[np.ix_(named, named)],
        freedom=covariance.freedom,
        clusters=covariance.clusters,
        singular_values=covariance.singular,
        undetermined=covariance.undetermined,
        driven=any(bool(np.any(r.torque.value)) for r in dataset.recordings),
        bands=_bands(result, BEYOND * grid),
    )


def _estimates(
    covariance: Covariance, dataset: Dataset, named: Sequence[int]
) -> Iterator[Estimate]:
    """Some of the parameters with intervals and nominal values."""
    inner, outer = covariance.interval(0.9), covariance.interval(0.95)
    identified, error = covariance.identified, covariance.error
    base_shift = recordings_own(dataset)
    for k in named:
        p = covariance.parameters[k]
        shift = base_shift[p.place[0]] if p.block == "inertia" else 0.0
        (a, b), (low, high) = inner[k] + shift, outer[k] + shift
        yield Estimate(
            *(p.block, p.name, p.unit),
            p.place[0] if p.block != "inertia" and p.place else None,
            float(covariance.values[k] + shift),
            float(error[k]),
            (float(a), float(b)),
            (float(low), float(high)),
            bool(covariance.bound[k]),
            bool(identified[k]),
            p.prior if np.isfinite(p.prior) else None,
            _nominal(p, dataset, shift),
        )


def _combines(result: Refined, parameter: Parameter) -> bool:
    return parameter.block == "friction" and isinstance(result.fitted.law, CombinationLaw)


def recordings_own(dataset: Dataset) -> Array:
    """What the recordings' own parameters add to the table's base parameters (nb,), on average."""
    return np.asarray(plant_of(dataset).p).mean(axis=0) - _table_base(dataset)


def own_base(dataset: Dataset, parameters: Mapping[str, float]) -> dict[str, float]:
    """Base parameters under parameters that a model brings, on average over the recordings."""
    if not parameters:
        return {}
    p = np.asarray(plant_of(dataset, parameters).p).mean(axis=0)
    return dict(zip(dataset.mechanism.base_names, map(float, p), strict=True))


def _table_base(dataset: Dataset) -> Array:
    mechanism = dataset.mechanism
    return np.asarray(mechanism.base(mechanism.nominal()), dtype=float)


def _nominal(parameter: Parameter, dataset: Dataset, shift: float) -> float | None:
    if parameter.block == "inertia":
        return float(_table_base(dataset)[parameter.place[0]] + shift)
    if parameter.block == "actuator":
        value = getattr(dataset.recordings[0].servo, parameter.name, None)
        return None if value is None else float(value)
    return IDEAL.get(parameter.block)


def _bands(result: Refined, w: Array) -> Bands:
    """Curves (V, n) at velocities w (V, n) with their half-widths."""
    friction = result.friction
    curve = np.stack([friction.curve(w[:, j])[:, j] for j in range(friction.n)], axis=-1)
    return Bands(w, curve, *result.bands(w))
