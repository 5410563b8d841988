"""Parameters of a law that the data do not tell: they stay at the law's neutral values.

A parameter is not identified where its standard error between recordings exceeds half of its usual
size, and its interval holds the neutral value. It is held there, and the others are fitted on, as
long as that does not make the fit clearly worse: the deviance counts samples as independent, and is
divided by the ratio of the parameter's variance between recordings to that by the curvature
[Ribatet2012].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.fit import Covariance
from frictionid.fitting.one_step.spread import CLEAR, KNOWN
from frictionid.fitting.parameters.blocks import FrictionBlock
from frictionid.fitting.parameters.parameter_block import Parameter, ParameterBlock
from frictionid.fitting.shooting.sandwich import solve_scaled
from frictionid.friction import Constraints, Friction


class Unknown(NamedTuple):
    """A parameter that the data do not tell: itself, its neutral value and size, and its excess.

    excess : its variance between recordings over that by the curvature
    """

    parameter: Parameter
    neutral: float
    size: float
    excess: float

    @property
    def held(self) -> Parameter:
        """The parameter at its neutral value."""
        return self.parameter._replace(value=self.neutral, tolerance=0.0)

    @property
    def sentence(self) -> str:
        """What was done, for people."""
        p = self.parameter
        return (
            f"{p.name} is not identified by these data, and stays at {self.neutral:.3g} {p.unit}."
        )

    def shown(self, before: float, after: float) -> bool:
        """Whether costs, in squares of the noise, are clearly worse after holding it."""
        return after - before > CLEAR * self.excess


def unknown_parameters(
    covariance: Covariance,
    limits: Constraints | None,
    curvature: Array,
    tried: Sequence[tuple[int, ...]],
) -> tuple[Unknown, ...]:
    """Of each joint the parameter of friction that the data tell least, without those tried before.

    curvature : (D, D), normal matrix of the fit
    """
    if limits is None:
        return ()
    variance = np.diag(solve_scaled(curvature, np.eye(len(curvature))))
    ratio = np.diag(covariance.matrix) / np.maximum(variance, 1e-300)
    usual = float(np.median(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else 1.0
    worst: dict[int, tuple[float, Unknown]] = {}
    for k, p in enumerate(covariance.parameters):
        if p.block != "friction" or p.place in tried or covariance.bound[k]:
            continue
        neutral, size = float(limits.neutral[p.place]), float(limits.size[p.place])
        error, off = float(covariance.error[k]), abs(float(covariance.values[k]) - neutral)
        if not np.isfinite(size) or off == 0.0 or error <= max(KNOWN * size, off / 2.0):
            continue
        excess = max(float(ratio[k]) if np.isfinite(ratio[k]) else usual, 1.0)
        joint = p.place[0]
        if joint not in worst or error / size > worst[joint][0]:
            worst[joint] = (error / size, Unknown(p, neutral, size, excess))
    return tuple(unknown for _, unknown in worst.values())


def at_neutral(
    blocks: Sequence[ParameterBlock], friction: Friction, unknown: Sequence[Unknown]
) -> tuple[tuple[ParameterBlock, ...], Friction]:
    """The blocks without parameters that are held, and friction (n, P) with these at neutral."""
    theta = np.array(friction.theta, dtype=float)
    places = {place for u in unknown for place in u.parameter.places}
    for u in unknown:
        for place in u.parameter.places:
            theta[place] = u.neutral
    new = tuple(_without(b, theta, places) if isinstance(b, FrictionBlock) else b for b in blocks)
    return new, replace(friction, theta=theta)


def _without(block: FrictionBlock, theta: Array, places: set[tuple[int, ...]]) -> FrictionBlock:
    free = block.support or tuple((int(j), int(i)) for j, i in np.ndindex(*theta.shape))
    return replace(block, support=tuple(place for place in free if place not in places))


def with_held(covariance: Covariance, held: Sequence[Unknown]) -> Covariance:
    """The covariance with parameters at their neutral values, as uncertain as their size says."""
    count = len(held)
    if not count:
        return covariance
    D = len(covariance.values)
    matrix = np.zeros((D + count, D + count))
    matrix[:D, :D] = covariance.matrix
    matrix[range(D, D + count), range(D, D + count)] = [u.size**2 for u in held]
    no, yes = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    return replace(
        covariance,
        parameters=(*covariance.parameters, *(u.held for u in held)),
        values=np.append(covariance.values, [u.neutral for u in held]),
        matrix=matrix,
        bound=np.append(covariance.bound, no),
        meaningless=np.append(covariance.meaningless, yes),
    )
