"""A network of the velocity and of its past samples: friction that remembers [DeMeester2020].

Or of the way since these samples: bristles bend by less than a joint moves from one to the next,
but its angle is known at any time.
"""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.config import Count, NotNegative, Positive
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import Hidden, outputs, slopes
from frictionid.friction.laws.levels import above_zero
from frictionid.friction.laws.network_law import (
    Features,
    NetworkLaw,
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
class WindowMLP(NetworkLaw):
    """Tf = level sgn(w), the level a network of w and of the newest `samples` of the velocity.

    sample_time : [s] between those samples; the memory begins as if the velocity had been constant
    hidden, odd, dissipative, monotone_tail, width, shape : as in `MLP`
    presliding : [rad], where positive the network reads instead how far the joint has moved since
        each of those samples, finely where that is no more than this, and the newest velocity
    """

    samples: Count = 9
    sample_time: Positive = 1 / 60
    hidden: Hidden = (16, 16)
    odd: bool = False
    dissipative: bool = True
    monotone_tail: bool = True
    width: float = 0.02
    shape: str = "tanh"
    presliding: NotNegative = 0.0
    reads_window = True

    @property
    def sizes(self) -> tuple[int, ...]:
        return (1 + (not self.odd) + self.samples + (self.presliding > 0), *self.hidden, 1)

    def start(self, theta: Array, x: Inputs) -> Memory:
        w = x.w + 0.0 * theta[..., 0]
        if not self.presliding:
            return (w,) * self.samples
        return (w, *(x.q - k * self.sample_time * w for k in range(self.samples)))

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory]:
        xp, reach = namespace(theta, x.w), theta[..., 1]
        share = xp.abs(x.w) / reach
        z = self._inputs(theta, x, xp.abs(x.w), memory)
        y, by_weights, by_z = slopes(theta[..., 3:], z, self.sizes)
        of = level_slopes(theta, y, share, self.dissipative, self.monotone_tail)
        by_entry, by_reach = self._by_memory(x, memory, reach, by_z)
        by_reach = by_reach - (by_z[..., 0] * fine_slope(share) + of.tail) * share / reach
        head = xp.stack([of.by_torque, of.by_y * by_reach, of.by_tail], axis=-1)
        by_theta = xp.concat([head, of.by_y[..., None] * by_weights], axis=-1)
        sign = smooth_sign(x.w, self.width, self.shape)
        return by_theta * sign[..., None], tuple(of.by_y * sign * entry for entry in by_entry)

    def _by_memory(
        self, x: Inputs, memory: Memory, reach: Array, by_z: Array
    ) -> tuple[list[Array], Array]:
        """Derivatives (..., n) of the network's output in each entry, and in reach through them."""
        xp, side = namespace(x.w), side_of(x.w)
        by_entry, by_reach = [], 0.0 * reach
        for i, entry in enumerate(memory):
            own = by_z[..., i + 1 + (not self.odd)]
            if i and self.presliding:
                way = 1.0 + xp.abs(x.q - entry) / self.presliding
                by_entry.append(-own * side / (self.presliding * way * way))
                continue
            part = entry / reach
            rate = own * self._rate(part, side) / reach
            by_entry.append(rate)
            by_reach = by_reach - rate * part
        return by_entry, by_reach

    def _rate(self, part: Array, side: Array) -> Array:
        """Derivative of the input that a velocity over reach makes."""
        xp, one = namespace(part), 1.0 + 0.0 * part
        if self.presliding:
            return side * fine_slope(xp.abs(part))
        return xp.where(xp.abs(part) < 1.0, one, 0.0 * part) * (side if self.odd else one)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        newest = x.w + 0.0 * memory[0]
        if not self.presliding:
            return (newest, *memory[:-1])
        return (newest, x.q + 0.0 * newest, *memory[1:-1])

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = self.level(theta, self._inputs(theta, x, 0.0 * x.w, memory), 0.0 * x.w)
        return above_zero(level)

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        speed = namespace(x.w).abs(x.w)
        z = self._inputs(theta, x, speed, memory)
        return Features(z, speed / theta[..., 1], smooth_sign(x.w, self.width, self.shape))

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        y = outputs(theta[..., 3:], z, self.sizes)[..., 0]
        return level_of(theta, y, share, self.dissipative, self.monotone_tail)

    def _inputs(self, theta: Array, x: Inputs, speed: Array, memory: Memory) -> Array:
        reach, side = theta[..., 1], side_of(x.w)
        own = [fine(speed / reach)] + ([] if self.odd else [side])
        if not self.presliding:
            past = [within(w / reach) for w in memory]
            return stacked([*own, *(side * w if self.odd else w for w in past)])
        # in the direction of the motion: bristles still bent the other way drive it
        newest = side * side_of(memory[0]) * fine(namespace(x.w).abs(memory[0]) / reach)
        ways = [side * (x.q - q) / self.presliding for q in memory[1:]]
        return stacked([*own, newest, *(way / (1.0 + namespace(way).abs(way)) for way in ways)])
