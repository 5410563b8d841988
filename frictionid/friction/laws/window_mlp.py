"""A network of the velocity and of its past samples: friction that remembers a window.

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
    rise,
    side_of,
    softplus,
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
        xp, side = namespace(theta, x.w), side_of(x.w)
        reach, tail = theta[..., 1], theta[..., 2]
        share = xp.abs(x.w) / reach
        z = self._inputs(theta, x, xp.abs(x.w), memory)
        y, by_weights, by_z = slopes(theta[..., 3:], z, self.sizes)
        slope = softplus(tail) if self.monotone_tail else tail
        y = y + slope * share
        sign = smooth_sign(x.w, self.width, self.shape)
        by_y = sign * theta[..., 0] * (rise(y) if self.dissipative else 1.0 + 0.0 * y)
        by_tail = share * (rise(tail) if self.monotone_tail else 1.0)
        by_past = [by_z[..., i + 1 + (not self.odd)] for i in range(len(memory))]
        by_reach = -(by_z[..., 0] * fine_slope(share) + slope) * share / reach
        by_memory = []
        for i, (entry, own) in enumerate(zip(memory, by_past, strict=True)):
            part = entry / reach
            if i and self.presliding:
                way = 1.0 + xp.abs(x.q - entry) / self.presliding
                by_memory.append(-by_y * own * side / (self.presliding * way * way))
                continue
            if self.presliding:
                rate = side * fine_slope(xp.abs(part))
            else:
                one = 1.0 + 0.0 * part
                inside = xp.where(xp.abs(part) < 1.0, one, 0.0 * part)
                rate = inside * (side if self.odd else one)
            by_memory.append(by_y * own * rate / reach)
            by_reach = by_reach - own * rate * part / reach
        of_torque = (softplus(y) if self.dissipative else y) * sign
        head = xp.stack([of_torque, by_y * by_reach, by_y * by_tail], axis=-1)
        return xp.concat([head, by_y[..., None] * by_weights], axis=-1), tuple(by_memory)

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
