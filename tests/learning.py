"""Laws with many numbers that the tests of shooting need: a network, and two that remember samples.

They are written once for NumPy and torch; theta holds all weights of a joint in one row.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from frictionid.arrays import namespace

FREE = (float("-inf"), float("inf"))


@dataclass(frozen=True)
class Static:
    """Tf = level(w) sgn(w), the level a small network of w, positive by construction."""

    hidden: tuple[int, ...] = (6, 6)
    speed: float = 4.0  # [rad/s]
    torque_scale: float = 0.1  # [N m]
    width: float = 0.02
    shape: str = "tanh"
    sample_time: ClassVar[float | None] = None
    uses_load: ClassVar[bool] = False

    @property
    def layers(self):
        return list(pairwise((1, *self.hidden, 1)))

    @property
    def names(self):
        return tuple(f"w{i}" for i in range(sum((a + 1) * b for a, b in self.layers)))

    @property
    def units(self):
        return ("1",) * len(self.names)

    @property
    def bounds(self):
        return (FREE,) * len(self.names)

    @property
    def initial(self):
        return ((0.0,) * len(self.names),)

    def drawn(self, n, seed=0):
        """Weights (n, P) at random."""
        rng = np.random.default_rng(seed)
        return np.stack(
            [
                np.concatenate(
                    [
                        part
                        for a, b in self.layers
                        for part in (rng.normal(size=a * b) / a**0.5, 0.5 * rng.normal(size=b))
                    ]
                )
                for _ in range(n)
            ]
        )

    def start(self, theta, x):
        return ()

    def torque(self, theta, x, memory):
        xp = namespace(theta, x.w)
        return self._level(theta, x.w) * xp.tanh(x.w / self.width)

    def advance(self, theta, x, memory, dt):
        return memory

    def limit(self, theta, x, memory):
        xp = namespace(theta, x.w)
        return self._level(theta, 0.0 * x.w + 1e-9 * xp.sign(x.w))

    def _level(self, theta, w):
        xp, at = namespace(theta, w), 0
        z = (w / self.speed)[..., None]
        for i, (a, b) in enumerate(self.layers):
            W = xp.reshape(theta[..., at : at + a * b], (*theta.shape[:-1], b, a))
            z = (W * z[..., None, :]).sum(-1) + theta[..., at + a * b : at + (a + 1) * b]
            z = z if i == len(self.layers) - 1 else xp.tanh(z)
            at += (a + 1) * b
        return self.torque_scale * xp.log1p(xp.exp(z[..., 0]))


@dataclass(frozen=True)
class Film:
    """Tf = (coulomb + peak exp(-z)) sgn(w) + viscous w, z an average of |w| over past samples."""

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "peak", "viscous", "share")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m", "N m s/rad", "1")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, float("inf")),) * 3 + ((0.01, 1.0),)
    initial: ClassVar[tuple[tuple[float, ...], ...]] = ((0.1, 0.0, 0.0, 0.5),)
    sample_time: ClassVar[float | None] = 1 / 60
    uses_load: ClassVar[bool] = False

    def start(self, theta, x):
        return (abs(x.w) + 0.0 * theta[..., 0],)

    def torque(self, theta, x, memory):
        xp = namespace(theta, x.w)
        return self.limit(theta, x, memory) * xp.tanh(x.w / self.width) + theta[..., 2] * x.w

    def advance(self, theta, x, memory, dt):
        return (memory[0] + theta[..., 3] * (abs(x.w) - memory[0]) + 0.0 * dt,)

    def limit(self, theta, x, memory):
        xp = namespace(theta, x.w)
        return theta[..., 0] + theta[..., 1] * xp.exp(-memory[0]) + 0.0 * x.w


@dataclass(frozen=True)
class Recurrent:
    """Tf = level(h) sgn(w), h three numbers that a recurrent network makes of |w| and u."""

    width: float = 0.02
    shape: str = "tanh"
    size: ClassVar[int] = 3
    names: ClassVar[tuple[str, ...]] = tuple(f"w{i}" for i in range(3 * 7 + 4))
    units: ClassVar[tuple[str, ...]] = ("1",) * 25
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (FREE,) * 25
    initial: ClassVar[tuple[tuple[float, ...], ...]] = ((0.0,) * 25,)
    sample_time: ClassVar[float | None] = 1 / 60
    uses_load: ClassVar[bool] = False

    def start(self, theta, x):
        return (0.0 * (x.w + theta[..., 0]),) * self.size

    def torque(self, theta, x, memory):
        xp = namespace(theta, x.w)
        return self.limit(theta, x, memory) * xp.tanh(x.w / self.width)

    def advance(self, theta, x, memory, dt):
        xp = namespace(theta, x.w)
        out = []
        for i, h in enumerate(memory):
            w = theta[..., 7 * i : 7 * i + 7]
            z = w[..., 0] * x.w / 4 + w[..., 1] * x.u + w[..., 2] + 0.0 * dt
            for k, other in enumerate(memory):
                z = z + 0.5 * w[..., 3 + k] * other
            out.append(h + (xp.tanh(z) - h) / (1 + xp.exp(w[..., 6])))
        return tuple(out)

    def limit(self, theta, x, memory):
        xp = namespace(theta, x.w)
        z = theta[..., 21] + sum(theta[..., 22 + i] * h for i, h in enumerate(memory))
        return 0.1 * xp.log1p(xp.exp(z)) + 0.0 * x.w
