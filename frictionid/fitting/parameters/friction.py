"""The block of the friction law's own parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.fitting.parameters.parameter_block import (
    Estimate,
    Parameter,
    ParameterBlock,
    Values,
    check_fixed,
    relative_deviation,
)
from frictionid.friction import Friction, SpeedRange, constraints_of


@dataclass(frozen=True)
class FrictionBlock(ParameterBlock):
    """Parameters of the law, but for those whose names are `fixed`.

    `prior` is a standard deviation relative to each value. `support` are the places (joint,
    parameter) that may be free, None for all: see `on_support`. Those of equal joints, as the
    friction's constraints name them, are shared.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    support: tuple[tuple[int, int], ...] | None = None
    name, enters = "friction", "friction"

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        law, theta = estimate.friction.law, np.asarray(estimate.friction.theta)
        check_fixed(self.fixed, law.names, self.name, f"{law} has no parameter")
        joints = estimate.mechanism.friction_names
        has = law.has_parameters(len(theta))
        own = estimate.friction.constraints
        own = own or constraints_of(law, _no_range(len(theta)))
        owner = own.owner
        return tuple(
            Parameter(
                block=self.name,
                name=f"{name} of {joints[j]}",
                unit=estimate.friction.units_at(j)[i],
                value=float(theta[j, i]),
                low=float(own.low[j, i]),
                high=float(own.high[j, i]),
                prior=min(
                    relative_deviation(self.prior, self.name, float(theta[j, i])),
                    float(own.deviation[j, i]),
                ),
                place=(j, i),
                mean=float(own.mean[j, i]) if np.isfinite(own.deviation[j, i]) else None,
                shared=tuple(
                    (f"{name} of {joints[k]}", (int(k), i))
                    for k in np.flatnonzero(owner == j)
                    if k != j
                ),
            )
            for j in np.unique(owner).tolist()
            for i, name in enumerate(law.names)
            if name not in self.fixed
            and has[j, i]
            and (self.support is None or (j, i) in self.support)
        )

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        theta = np.array(estimate.friction.theta, dtype=float)
        for parameter, value in values:
            for place in parameter.places:
                theta[place] = value
        return estimate._replace(friction=replace(estimate.friction, theta=theta))


def _no_range(n: int) -> SpeedRange:
    """Range of speeds of n joints about whose motion nothing is known."""
    return SpeedRange(np.full(n, 1e-9), np.full(n, np.inf))


def on_support(blocks: Sequence[ParameterBlock], friction: Friction) -> tuple[ParameterBlock, ...]:
    """The blocks; where the law is sparse, friction's only frees what the friction (n, P) has."""
    if not friction.law.is_sparse:
        return tuple(blocks)
    has = tuple((int(j), int(i)) for j, i in np.argwhere(np.asarray(friction.theta) != 0))
    return tuple(replace(b, support=has) if isinstance(b, FrictionBlock) else b for b in blocks)
