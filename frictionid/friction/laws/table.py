"""Friction as a tabulated curve: levels at speeds, for each direction, straight between them.

Compensation by such tables is as old as that by laws [Armstrong1994].
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import LEVEL, Speeds, by_side, check_increasing, on_side
from frictionid.friction.smooth_sign import smooth_sign


@dataclass(frozen=True)
class Table(Law):
    """Tf = level(|w|) sgn(w), the level interpolated between its values at `speeds` [rad/s].

    `up` values hold for w > 0, `down` ones for w < 0. Below the first speed and beyond the last one
    the level stays as it is there. Levels are not negative: friction does not drive.

    >>> import numpy as np
    >>> from frictionid.friction import Friction
    >>> law = Table((1.0, 3.0))
    >>> law.names
    ('up_1', 'up_3', 'down_1', 'down_3')
    >>> tf = Friction(law, np.array([[0.1, 0.2, 0.3, 0.4]]))
    >>> tf.curve(np.array([-9.0, -2.0, 0.5, 2.0]))[:, 0]
    array([-0.4 , -0.35,  0.1 ,  0.15])
    """

    speeds: Speeds = (0.3, 1.0, 3.0, 10.0)
    width: float = 0.02
    shape: str = "tanh"
    is_linear = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_increasing("Table: speeds", self.speeds)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{side}_{v:g}" for side in ("up", "down") for v in self.speeds)

    @property
    def units(self) -> tuple[str, ...]:
        return ("N m",) * (2 * len(self.speeds))

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (LEVEL,) * (2 * len(self.speeds))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = before = self._value(theta, x, 0)
        # speed by speed: all of them at once, for all folds along all nodes, are gigabytes
        for i, climbed in enumerate(self._climbed(x), 1):
            value = self._value(theta, x, i)
            level = level + (value - before) * climbed
            before = value
        return level * smooth_sign(x.w, self.width, self.shape)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        sign = smooth_sign(x.w, self.width, self.shape)
        edges = [1.0 + 0.0 * x.w, *self._climbed(x), 0.0 * x.w]
        shares = [(a - b) * sign for a, b in zip(edges[:-1], edges[1:], strict=True)]
        up, down = zip(*(by_side(x.w, share) for share in shares), strict=True)
        zero = 0.0 * (theta[..., 0] + x.w)
        return xp.stack([part + zero for part in (*up, *down)], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._value(theta, x, 0)

    def _value(self, theta: Array, x: Inputs, i: int) -> Array:
        return on_side(x.w, theta[..., i], theta[..., len(self.speeds) + i])

    def _climbed(self, x: Inputs) -> Iterator[Array]:
        """Part (..., n) of each step between speeds that lies below |w|."""
        xp = namespace(x.w)
        speed = xp.abs(x.w)
        for low, high in pairwise(self.speeds):
            share = (speed - low) / (high - low)
            yield xp.minimum(xp.maximum(share, 0.0 * share), 1.0 + 0.0 * share)
