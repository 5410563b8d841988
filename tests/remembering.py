"""Laws with memory that the tests of the core need: continuous ones and a sampled one."""

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import namespace
from frictionid.laws.sign import smooth_sign


@dataclass(frozen=True)
class FilmLag:
    """Tf = (coulomb + peak exp(-(z/ws)^2)) s(w) + viscous w, with a film dz/dt = (|w| - z)/tau.

    The film's height z starts settled and advances by the exact solution for constant |w|.
    """

    width: float = 0.02
    names: ClassVar[tuple[str, ...]] = ("coulomb", "peak", "ws", "viscous", "tau")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m", "rad/s", "N m s/rad", "s")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, float("inf")),) * 5
    initial: ClassVar[tuple[tuple[float, ...], ...]] = ((0.1, 0.1, 1.0, 0.0, 0.02),)
    sample_time: ClassVar[float | None] = None
    uses_load: ClassVar[bool] = False

    def start(self, theta, x):
        return (abs(x.w) + 0.0 * theta[..., 0],)

    def torque(self, theta, x, memory):
        z = memory[0]
        xp = namespace(z)
        level = theta[..., 0] + theta[..., 1] * xp.exp(-((z / theta[..., 2]) ** 2))
        return level * smooth_sign(x.w, self.width) + theta[..., 3] * x.w

    def advance(self, theta, x, memory, dt):
        z = memory[0]
        share = namespace(z).exp(-dt / theta[..., 4])
        return (abs(x.w) + (z - abs(x.w)) * share,)

    def limit(self, theta, x, memory):
        return theta[..., 0] + theta[..., 1] + 0.0 * x.w


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
