"""The block of the machine's base inertial parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.mechanics import Mechanism, configurations
from frictionid.shooting.parameters.parameter_block import (
    Estimate,
    Parameter,
    ParameterBlock,
    Values,
    check_fixed,
    relative_deviation,
    with_known,
)

_KEPT = 0.05  # of the mass matrix that a step may leave in any direction


@dataclass(frozen=True)
class InertiaBlock(ParameterBlock):
    """Base parameters, but for those whose names are `fixed`.

    Steps are taken along a path on which M(q) stays positive definite for all q, see `inside`.
    `prior` is a standard deviation relative to each value.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    known: tuple[tuple[str, float], ...] = ()
    name, enters = "inertia", "base"

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        base, mechanism = np.asarray(estimate.calibration.base), estimate.mechanism
        names, units = mechanism.base_names, mechanism.base_units
        check_fixed(self.fixed, names, self.name, f"{mechanism.kind} has no base parameter")
        free = (
            Parameter(
                block=self.name,
                name=name,
                unit=unit,
                value=float(base[i]),
                prior=relative_deviation(self.prior, self.name, float(base[i])),
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
        base = inside(estimate.mechanism, np.asarray(estimate.calibration.base), new)
        return estimate._replace(calibration=replace(estimate.calibration, base=base))


def inside(mechanism: Mechanism, base: Array, wanted: Array) -> Array:
    """Base parameters on the way from `base` to the `wanted` ones, with M positive definite.

    Where M of the wanted ones, relative to M now, has no eigenvalue below 0.05 at any q they are
    reached; otherwise the path p + s (wanted - p) ends before it: s = 0.95 / (1 - smallest
    eigenvalue). So any step from an admissible machine leads to an admissible one.

    >>> from frictionid.mechanics import pendulum
    >>> m = pendulum()
    >>> inside(m, np.array([1.0, 2.0]), np.array([1.5, 3.0])).round(9)
    array([1.5, 3. ])
    >>> inside(m, np.array([1.0, 2.0]), np.array([-4.0, 2.0])).round(9)
    array([0.05, 2.  ])
    """
    q = configurations(mechanism.n, 13)
    now, then = (mechanism.inertia(p, q) for p in (np.asarray(base, float), wanted))
    root = np.linalg.inv(np.linalg.cholesky(now))
    least = float(np.linalg.eigvalsh(root @ then @ np.swapaxes(root, -1, -2)).min())
    share = 1.0 if least >= _KEPT else (1.0 - _KEPT) / (1.0 - least)
    return base + share * (wanted - base)
