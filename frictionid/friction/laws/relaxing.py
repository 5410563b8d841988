"""Laws with a memory that relaxes: bristles that bend before a joint slips, and a lubricating film.

LuGre's bristles bend, and then slide at the Stribeck level [CanudasDeWit1995], [Olsson1998]:

dz/dt = w - s0 |w| z / g(w),   Tf = s0 z + s1(w) dz/dt + Fv w,   g(w) = Fc + Fp exp(-(w/ws)^2)

With a constant s1 this can drive. Here s1(w) = damping exp(-(w/damping_velocity)^2), and never more
than 4 g(w)/|w|, nor than 4 g(w)/width: with x = s0 z, what friction takes less what the bristles
store is

w Tf - d(s0 z^2/2)/dt = |w| x^2/g + (s1 |w|/g) x dz/dt + s1 (dz/dt)^2 + Fv w^2

and s1 |w| <= 4 g is what makes this quadratic form positive.

A lubricating film follows the speed late, and the level follows the film [Olsson1998]:

dz/dt = (|w| - z) / lag,   Tf = g(z) sgn(w) + Fv w

Only the film lags: a low-pass behind the whole friction curve would creep at rest and drive. A
joint that stands still breaks away at the level of the film's momentary height z, so that the level
grows while it stands.
"""

from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, LawParameter, Memory

from .levels import COARSE_VELOCITIES, COULOMB, LOSS, VISCOUS, Level, no_limit, stribeck_factor

PRESLIDING = LawParameter("presliding", "rad", 1e-5, 1.0, (0.002, 0.006, 0.02, 0.06), size=0.03)
# what is faster than a millisecond is no memory
_LAG = LawParameter("lag", "s", 1e-3, 1.0, (0.01, 0.06), stepwise=True, size=0.05)
_TINY = 1e-12  # no division by zero where there is no friction, or no motion


@dataclass(frozen=True)
class BristleLaw(Law):
    """A law whose memory is the bend z [rad] of bristles, which hold a joint at rest.

    It starts as in steady sliding; of a joint at rest the bend is not known, and is taken to grow
    over `width` [rad/s]. There is no break-away level.
    """

    width: float = 0.02
    shape: str = "tanh"
    limit = no_limit

    def steady(self, theta: Array, w: Array) -> Array:
        """Bend (..., n) in steady sliding [rad], > 0."""
        return theta[..., 2]

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (self.steady(theta, x.w) * self.sign(x.w),)

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array]:
        # the exact solution: it neither overshoots nor limits the step
        steady, xp = self.steady(theta, x.w), namespace(theta, x.w)
        return xp.sign(x.w) * steady, xp.exp(-xp.abs(x.w) * dt / steady)

    def sharpened(self) -> Law:
        """The law itself: its smoothing says how the bristles start, they hold the joint."""
        return self


@dataclass(frozen=True)
class Dahl(BristleLaw):
    """Tf = coulomb z/presliding + viscous w, with dz/dt = w - |w| z/presliding [Dahl1968].

    `presliding` is the angle by which the joint gives before it slips: its stiffness is coulomb /
    presliding [N m/rad]. Memory is the bend z [rad]. It starts as in steady sliding; of a joint at
    rest the bend is not known, and is taken to grow over `width` [rad/s]. At rest the spring holds
    the joint, there is no break-away level.

    motor_load : true lets the level grow with the motor torque u, coulomb + loss |u|, as in
        `MotorLoad`: the spring is stiffer under load
    """

    motor_load: bool = False

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        return (COULOMB, VISCOUS, PRESLIDING, *((LOSS,) if self.motor_load else ()))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = theta[..., 0]
        if self.motor_load:
            level = level + theta[..., 3] * namespace(x.u).abs(x.u)
        return level * memory[0] / theta[..., 2] + theta[..., 1] * x.w


@dataclass(frozen=True)
class LuGre(BristleLaw):
    """Tf = stiffness z + damping(w) dz/dt + viscous w, LuGre's bristles at the Stribeck level.

    They bend by z, up to `presliding` [rad], before a joint breaks away. Their stiffness is s0 =
    break-away level / presliding [N m/rad], with the mean of the levels of both sides, so that
    Stribeck friction is the limit of small `presliding`. Memory is their deflection z [rad]. It
    starts as in steady sliding; at rest it is not known, and is taken to grow over `width` [rad/s].
    At rest the bristles hold the joint, there is no break-away level. After the level's parameters,
    theta holds viscous, presliding, damping, damping_velocity.

    symmetric : false gives each direction a Coulomb level and a peak; the bristles are the same
    """

    symmetric: bool = True
    kind = "lugre"

    @property
    def level(self) -> Level:
        """The level at which they slide."""
        return Level(self.symmetric, velocities=COARSE_VELOCITIES)

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        # bristles bend slowly: at a tenth of the fastest speed it may well be as large as the level
        damping = LawParameter("damping", "N m s/rad", size=10.0)
        velocity = LawParameter("damping_velocity", "rad/s", initial=(0.1,))
        presliding = PRESLIDING._replace(beside=damping.name)
        return (*self.level.parameters, VISCOUS, presliding, damping, velocity)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        w, z, xp = x.w, memory[0], namespace(theta, x.w)
        fading = theta[..., -2] * stribeck_factor(w, theta[..., -1])
        # below `width` the limit grows no further: a law without one is too steep to be resolved,
        # and data that do not show the damping would lead there
        speed = xp.maximum(xp.abs(w), self.width + 0.0 * w)
        damping = xp.minimum(fading, 4.0 * self.level.at(theta, w, w) / speed)
        stiffness = self.level.mean_at_rest(theta) / theta[..., -3]
        rate = w - xp.abs(w) * z / self.steady(theta, w)
        return stiffness * z + damping * rate + theta[..., -4] * w

    def steady(self, theta: Array, w: Array) -> Array:
        """Deflection (..., n) in steady sliding [rad]: presliding g(w)/s0; presliding if g = 0."""
        level, top = self.level.at(theta, w, w), self.level.mean_at_rest(theta)
        xp = namespace(level, top)
        share = level / xp.where(top == 0, xp.ones_like(top), top)
        share = xp.where(top == 0, xp.ones_like(share), share)
        return theta[..., -3] * xp.maximum(share, _TINY + 0.0 * share)


@dataclass(frozen=True)
class FilmLag(Law):
    """Tf = (coulomb + peak exp(-(z/stribeck_velocity)^2)) sgn(w) + viscous w, z = |w| after `lag`.

    The film z follows the speed with the time constant `lag` [s]. Memory is the film's height
    z >= 0, written as the speed [rad/s] at which it would be steady; it starts so, and advances by
    the exact solution for a constant speed.

    symmetric : false gives each direction a Coulomb level and a peak; the film is one for both
    """

    width: float = 0.02
    shape: str = "tanh"
    symmetric: bool = True

    @property
    def level(self) -> Level:
        """The level of the film."""
        return Level(self.symmetric, velocities=COARSE_VELOCITIES)

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        *levels, velocity = self.level.parameters
        return (*levels, velocity._replace(stepwise=True), VISCOUS, _LAG)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (namespace(x.w).abs(x.w) + 0.0 * theta[..., 0],)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = self.sign(x.w)
        return self.level.at(theta, memory[0], x.w) * sign + theta[..., -2] * x.w

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array]:
        xp = namespace(x.w, theta)
        return xp.abs(x.w), xp.exp(-dt / theta[..., -1])

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.level.at(theta, memory[0], x.w) + 0.0 * x.w
