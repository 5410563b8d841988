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
from frictionid.friction import Friction

_BASE = 0.2  # of the nominal value: usual deviation of a base parameter
_BLIND = 1e-13  # of the largest information


class Key(NamedTuple):
    """Name of a parameter's block, and its place there."""

    block: str
    place: tuple[int, ...]


class Unknown(NamedTuple):
    """A parameter that the data do not tell: itself, its neutral value, size, excess, and off.

    The neutral value of a base parameter is the nominal one, its size a fifth of that.

    excess : its variance between recordings over that by the curvature
    off : how far it is from neutral [sizes]
    """

    parameter: Parameter
    neutral: float
    size: float
    excess: float
    off: float

    @property
    def held(self) -> Parameter:
        """The parameter at its neutral value."""
        return self.parameter._replace(value=self.neutral, tolerance=0.0)

    @property
    def key(self) -> Key:
        """What tells it from others."""
        return Key(self.parameter.block, self.parameter.place)

    @property
    def sentence(self) -> str:
        """What was done, for people."""
        p = self.parameter
        return (
            f"{p.name} is not identified by these data, and stays at {self.neutral:.3g} {p.unit}."
        )

    def shown(self, before: float, after: float) -> bool:
        """Whether costs, in squares of the noise, are clearly worse after holding it.

        The farther from neutral it is, in units of its size, the more it takes to believe it.
        """
        return after - before > (CLEAR + self.off**2) * self.excess


def unknown_parameters(
    covariance: Covariance,
    friction: Friction,
    blocks: Sequence[ParameterBlock],
    curvature: Array,
    tried: Sequence[Key],
) -> tuple[Unknown, ...]:
    """Of each joint, and of the base parameters, the one that the data tell least.

    Base parameters only where they are offered: asked for, they are free. Without those that were
    tried before.

    curvature : (D, D), normal matrix of the fit
    """
    if friction.constraints is None:
        return ()
    information = np.diag(curvature)
    blind = information <= _BLIND * information.max(initial=0.0)
    variance = np.diag(solve_scaled(curvature, np.eye(len(curvature))))
    ratio = np.diag(covariance.matrix) / np.maximum(variance, 1e-300)
    usual = float(np.median(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else 1.0
    worst: dict[tuple[str, int], tuple[float, Unknown]] = {}
    for k, (neutral, size) in _neutral_values(covariance.parameters, friction, blocks).items():
        p = covariance.parameters[k]
        if Key(p.block, p.place) in tried or (covariance.bound[k] and not blind[k]):
            continue
        error, off = float(covariance.error[k]), abs(float(covariance.values[k]) - neutral)
        if off == 0.0 or error <= max(KNOWN * size, off / 2.0):
            continue
        excess = max(float(ratio[k]) if np.isfinite(ratio[k]) else usual, 1.0)
        group = p.block, p.place[0] if p.block == "friction" else 0
        if group not in worst or error / size > worst[group][0]:
            worst[group] = (error / size, Unknown(p, neutral, size, excess, off / size))
    return tuple(unknown for _, unknown in worst.values())


def _neutral_values(
    parameters: Sequence[Parameter], friction: Friction, blocks: Sequence[ParameterBlock]
) -> dict[int, tuple[float, float]]:
    """Neutral value and size of the parameters that have them, by their place among D."""
    out, limits = {}, friction.constraints
    assert limits is not None
    neutral = friction.law.neutral(np.asarray(friction.theta), limits.neutral)
    for k, p in enumerate(parameters):
        if p.block == "friction" and np.isfinite(limits.size[p.place]):
            out[k] = float(neutral[p.place]), float(limits.size[p.place])
    for block in (b for b in blocks if b.enters == "base" and b.offered):
        places = [k for k, p in enumerate(parameters) if p.block == block.name]
        base = [parameters[k] for k in places]
        for k, p, size in zip(places, base, block.sizes(base), strict=True):
            if not np.isfinite(p.tolerance) and size > 0:
                out[k] = p.value, _BASE * size
    return out


def at_neutral(
    blocks: Sequence[ParameterBlock], friction: Friction, unknown: Sequence[Unknown]
) -> tuple[tuple[ParameterBlock, ...], Friction]:
    """The blocks without parameters that are held, and friction (n, P) with these at neutral."""
    theta = np.array(friction.theta, dtype=float)
    held = [u for u in unknown if u.parameter.block == "friction"]
    for u in held:
        for place in u.parameter.places:
            theta[place] = u.neutral
    places = {place for u in held for place in u.parameter.places}
    names = tuple(u.parameter.name for u in unknown if u.parameter.block != "friction")
    new = []
    for block in blocks:
        if isinstance(block, FrictionBlock):
            block = _without(block, theta, places) if places else block
        elif block.enters == "base":
            block = replace(block, fixed=(*block.fixed, *names))
        new.append(block)
    return tuple(new), replace(friction, theta=theta)


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
