"""Laws with memory that the tests of the core need: a continuous one and a sampled one."""

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import namespace


@dataclass(frozen=True)
class Sampled:
    """Tf = gain times the mean of the newest three samples of (w + u): advances once a sample."""

    names: ClassVar[tuple[str, ...]] = ("gain",)
    units: ClassVar[tuple[str, ...]] = ("N m s/rad",)
    bounds: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, float("inf")),)
    initial: ClassVar[tuple[tuple[float, ...], ...]] = ((0.1,),)
    sample_time: ClassVar[float | None] = 1 / 60
    uses_load: ClassVar[bool] = False

    def start(self, theta, x):
        now = x.w + x.u + 0.0 * theta[..., 0]
        return (now, now, now)

    def torque(self, theta, x, memory):
        return theta[..., 0] * (memory[0] + memory[1] + memory[2]) / 3 + 0.0 * x.w

    def advance(self, theta, x, memory, dt):
        return (*memory[1:], x.w + x.u + 0.0 * theta[..., 0] + 0.0 * dt)

    def limit(self, theta, x, memory):
        return 0.0 * (theta[..., 0] + x.w)


@dataclass(frozen=True)
class Follower:
    """Tf = gain z with dz/dt = (w - z)/0.1 s from z = 0: a poor law, but its steps are known."""

    names: ClassVar[tuple[str, ...]] = ("gain",)
    sample_time: ClassVar[float | None] = None
    uses_load: ClassVar[bool] = False

    def start(self, theta, x):
        return (0.0 * (theta[..., 0] + x.w),)

    def torque(self, theta, x, memory):
        return memory[0] * theta[..., 0] + 0.0 * x.w

    def advance(self, theta, x, memory, dt):
        share = namespace(dt).exp(-dt / 0.1)
        return (x.w + (memory[0] - x.w) * share + 0.0 * theta[..., 0],)

    def limit(self, theta, x, memory):
        return 0.0 * (theta[..., 0] + x.w)
