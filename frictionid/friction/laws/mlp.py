"""A network of the velocity: a friction curve of any shape, whose physics hold by construction.

The study learns friction by networks behind a physics step [DeMeester2020].

The form of the level, and what its options promise, are those of `network_law`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import Hidden, outputs, slopes
from frictionid.friction.laws.levels import above_zero
from frictionid.friction.laws.network_law import (
    HEAD,
    Features,
    NetworkLaw,
    Scale,
    fine,
    fine_slope,
    level_of,
    level_slopes,
    side_of,
    stacked,
    within,
)
from frictionid.friction.smooth_sign import smooth_sign


@dataclass(frozen=True)
class MLP(NetworkLaw):
    """Tf = level sgn(w), the level a network of speed and direction with `hidden` tanh units.

    odd : the same level in both directions; else the direction is an input of the network
    dissipative : the level is positive; else friction may drive, and the break-away level is zero
        where it does
    monotone_tail : beyond the measured speeds, `reach`, the level does not fall
    others : how many other joints' velocities are inputs as well, those that come next, then from
        the first on; where a joint is at rest, its break-away level is that with others at rest
    width, shape : smoothing of sgn(w) [rad/s]

    The parameters are the scales `torque` and `reach`, the `tail`, the reach of each other joint,
    and the network's weights.
    """

    hidden: Hidden = (16, 16)
    odd: bool = False
    dissipative: bool = True
    monotone_tail: bool = True
    others: Annotated[int, Field(ge=0)] = 0
    width: float = 0.02
    shape: str = "tanh"

    @property
    def scales(self) -> tuple[Scale, ...]:
        reach = HEAD[1]
        return HEAD + tuple(reach._replace(name=f"reach_{i + 1}") for i in range(self.others))

    @property
    def sizes(self) -> tuple[int, ...]:
        return (1 + (not self.odd) + self.others, *self.hidden, 1)

    def initial_parameters(self, sizes: Array, rng: np.random.Generator) -> Array:
        theta = super().initial_parameters(sizes, rng)
        for i in range(self.others):
            theta[..., 3 + i] = np.roll(sizes[..., 1], -i - 1, axis=-1)
        return theta

    def gradient(self, theta: Array, x: Inputs) -> Array:
        w, xp, reach = x.w, namespace(theta, x.w), theta[..., 1]
        side, share = side_of(w), xp.abs(w) / reach
        z = self._inputs(theta, xp.abs(w), side, w)
        y, by_weights, by_z = slopes(self._weights(theta), z, self.sizes)
        of = level_slopes(theta, y, share, self.dissipative, self.monotone_tail)
        by_share = by_z[..., 0] * fine_slope(share) + of.tail
        columns = [of.by_torque, of.by_y * (-by_share * share / reach), of.by_tail]
        for i, other in enumerate(self._others(w)):
            part = other / theta[..., 3 + i]
            inside = xp.where(xp.abs(part) < 1.0, part, 0.0 * part)
            sign = side if self.odd else 1.0
            by_part = -by_z[..., i - self.others] * sign * inside
            columns.append(of.by_y * (by_part / theta[..., 3 + i]))
        head = xp.stack([column + 0.0 * y for column in columns], axis=-1)
        whole = xp.concat([head, of.by_y[..., None] * by_weights], axis=-1)
        return whole * smooth_sign(w, self.width, self.shape)[..., None]

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        still = 0.0 * x.w
        z = self._inputs(theta, still, side_of(x.w), still)
        return above_zero(self.level(theta, z, still))

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        speed = namespace(x.w).abs(x.w)
        z = self._inputs(theta, speed, side_of(x.w), x.w)
        return Features(z, speed / theta[..., 1], smooth_sign(x.w, self.width, self.shape))

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        y = outputs(self._weights(theta), z, self.sizes)[..., 0]
        return level_of(theta, y, share, self.dissipative, self.monotone_tail)

    def _weights(self, theta: Array) -> Array:
        return theta[..., 3 + self.others :]

    def _inputs(self, theta: Array, speed: Array, side: Array, w: Array) -> Array:
        """Inputs of the network (..., n, a)."""
        own = [fine(speed / theta[..., 1])] + ([] if self.odd else [side])
        others = [within(o / theta[..., 3 + i]) for i, o in enumerate(self._others(w))]
        return stacked([*own, *(side * o if self.odd else o for o in others)])

    def _others(self, w: Array) -> Iterator[Array]:
        """Velocities (..., n) of the next joint, of the one after it, and so on; 0 if none."""
        n = w.shape[-1]
        for i in range(1, self.others + 1):
            order = [(j + i) % n for j in range(n)]
            yield w[..., order] if i < n else 0.0 * w
