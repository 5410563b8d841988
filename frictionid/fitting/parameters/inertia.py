"""The block of the machine's base inertial parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.parameters.parameter_block import (
    Estimate,
    Parameter,
    ParameterBlock,
    Values,
    check_fixed,
    relative_deviation,
    with_known,
)
from frictionid.mechanics import Mechanism, configurations

_KEPT = 0.05  # of the nominal mass matrix that is left in any direction


@dataclass(frozen=True)
class InertiaBlock(ParameterBlock):
    """Base parameters, but for those whose names are `fixed`.

    M(q) stays positive definite for all q, see `inside`. `prior` is a standard deviation relative
    to each value; of a value that is zero, to the mean size of those with the same unit. The
    inertia of a rotor does not become negative.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    known: tuple[tuple[str, float], ...] = ()
    name, enters = "inertia", "base"

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        base, mechanism = np.asarray(estimate.calibration.base), estimate.mechanism
        names, units = mechanism.base_names, mechanism.base_units
        check_fixed(self.fixed, names, self.name, f"{mechanism.kind} has no base parameter")
        sizes = _sizes(base, units)
        rotors = {p.name for p in mechanism.parameters if p.rotor}
        free = (
            Parameter(
                block=self.name,
                name=name,
                unit=unit,
                value=float(base[i]),
                low=0.0 if name in rotors else -np.inf,
                prior=relative_deviation(self.prior, self.name, sizes[i]),
                place=(i,),
            )
            for i, (name, unit) in enumerate(zip(names, units, strict=True))
            if name not in self.fixed
        )
        return with_known(free, self.known)

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        new = np.array(estimate.calibration.base, dtype=float)
        for parameter, value in values:
            new[parameter.place] = value
        nominal = estimate.mechanism.base(estimate.mechanism.nominal())
        base = inside(estimate.mechanism, np.asarray(nominal, dtype=float), new)
        return estimate._replace(calibration=replace(estimate.calibration, base=base))


def _sizes(base: Array, units: tuple[str, ...]) -> list[float]:
    """Sizes of base parameters: of one that is zero, the mean of those with its unit."""
    pairs = [(abs(float(b)), unit) for b, unit in zip(base, units, strict=True)]
    mean = {unit: float(np.mean([b for b, own in pairs if own == unit])) for unit in units}
    return [b or mean[unit] for b, unit in pairs]


def inside(mechanism: Mechanism, base: Array, wanted: Array) -> Array:
    """Base parameters on the way from `base` to the `wanted` ones, with M positive definite.

    Where M of the wanted ones, relative to that of `base`, the nominal machine, has no eigenvalue
    below 0.05 at any q, they are reached; otherwise the way p + s (wanted - p) ends before it:
    s = 0.95 / (1 - smallest eigenvalue). So steps may go on along the border.

    >>> from frictionid.mechanics import pendulum
    >>> m = pendulum()
    >>> inside(m, np.array([1.0, 2.0]), np.array([1.5, 3.0])).round(9)
    array([1.5, 3. ])
    >>> inside(m, np.array([1.0, 2.0]), np.array([-4.0, 2.0])).round(9)
    array([0.05, 2.  ])
    """
    q = configurations(mechanism.n, 13)
    now, then = (mechanism.inertia(p, q) for p in (base, wanted))
    root = np.linalg.inv(np.linalg.cholesky(now))
    least = float(np.linalg.eigvalsh(root @ then @ np.swapaxes(root, -1, -2)).min())
    share = 1.0 if least >= _KEPT else (1.0 - _KEPT) / (1.0 - least)
    return base + share * (wanted - base)
