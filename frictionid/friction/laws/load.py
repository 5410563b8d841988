"""Friction that grows with the load: of the bearing, of the motor, and of a gear between them.

The bearing load [N] is that of `Mechanism.load`: the force that a joint passes on to all bodies
beyond it, in friction-free motion. Fast swings and heavy tools press joints together, and the more
they are pressed, the more they rub [Armstrong1994]. Of trees of rigid bodies the load [N m] is what
friction and the rotor leave of the motor torque, see `predicted_load`.

A gear rubs the more, the more torque it transmits, by tooth flanks that slide under pressure. What
presses them is the motor's torque u on one side and the external torque te on the other; what te is
the mechanism says: on the joint of a pendulum it is the torque of gravity, -m g l sin q, no bearing
force. These are the extended friction models M3 to M6 of servos [Duclusaud2025].
"""

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.config import NotNegative
from frictionid.friction import Inputs, Law, LawParameter, Memory

from .levels import (
    COARSE_VELOCITIES,
    COULOMB,
    LOAD,
    LOSS,
    PEAK,
    VISCOUS,
    VISCOUS_TERM,
    Level,
    LevelLaw,
    Term,
)


@dataclass(frozen=True)
class LoadDependent(LevelLaw):
    """Tf = (coulomb + load_coefficient load) sgn(w) + viscous w; with `stribeck` a peak, too.

    `load_coefficient` is the coefficient of friction times the radius at which the bearing rubs.

    stribeck : true adds the peak of Stribeck friction to the level, peak exp(-(w/ws)^2)
    """

    stribeck: bool = False
    uses_load = True
    terms: ClassVar = (Term(LOAD, lambda x: x.load, rubbing=True), VISCOUS_TERM)

    @property
    def level(self) -> Level:
        return Level(peaked=self.stribeck)


@dataclass(frozen=True)
class MotorLoad(LevelLaw):
    """Tf = (coulomb + loss |u|) sgn(w) + viscous w, with sgn smoothed over `width`.

    `loss` is the share of the motor torque u that the gear swallows: it passes on 1 - loss of it
    while the motor drives, and holds back 1 + loss of it while it brakes. Without motor torque this
    is Coulomb and viscous friction. Where torque is fitted by Coulomb and viscous friction alone,
    the Coulomb level takes up the mean loss and is too high for motions with less torque.

    squared : true adds `rise` u^2 to the level: more is lost the harder the motor pulls. It may
        stand for the gear, and for what weakens the motor at high currents and is in no log: a
        supply that gives in, heat, saturation
    """

    squared: bool = False
    level: ClassVar = Level(peaked=False)

    @property
    def terms(self) -> tuple[Term, ...]:
        loss = Term(LOSS, lambda x: namespace(x.u).abs(x.u), rubbing=True)
        rise = Term(LawParameter("rise", "1/(N m)", size=1.0), lambda x: x.u**2, rubbing=True)
        return (VISCOUS_TERM, loss, *((rise,) if self.squared else ()))


_SMALLEST = 1e-300


def _share(name: str, *initial: float) -> LawParameter:
    return LawParameter(name, "1", high=1.0, initial=initial, size=0.3)


@dataclass(frozen=True)
class GearLoad(Law):
    """Tf = (level + left peaks) sgn(w) + viscous w, the model M6 of servos [Duclusaud2025].

        level = coulomb + |motor u - external te|
        left  = exp(-(|w|/stribeck_velocity)^exponent)
        peaks = peak + |peak_motor u - peak_external te| + square
        square = quadratic_external te^2 where |u| > |te|, else quadratic_motor u^2,
                 and only where u and te oppose each other

    with te = -moment sin q, `moment` = m g l [N m] of the pendulum that the joint carries, in all
    recordings the same; 0 is a gear that nothing but its motor loads. Without squares this is M5;
    with equal coefficients of u and te, M4; without peaks M3, or M1 without any load. sgn is
    smoothed over `width`.
    """

    moment: NotNegative
    width: float = 0.02
    shape: str = "tanh"
    parameters: ClassVar = (
        COULOMB,
        VISCOUS,
        # fits do not start at zero: there |motor u - external te| has no slope
        _share("motor", 0.2),
        _share("external", 0.05),
        PEAK,
        _share("peak_motor", 0.05),
        _share("peak_external", 0.05),
        LawParameter("quadratic_motor", "1/(N m)", size=1.0),
        LawParameter("quadratic_external", "1/(N m)", size=1.0),
        LawParameter("stribeck_velocity", "rad/s", initial=COARSE_VELOCITIES),
        LawParameter("exponent", "1", 0.5, 10.0, (2.0,)),
    )

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        left = namespace(theta, x.w).exp(-self._power(theta, x))
        level = self._level(theta, x) + left * self._peaks(theta, x)
        return level * self.sign(x.w) + theta[..., 1] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        power = self._power(theta, x)
        left = xp.exp(-power)
        zero = 0.0 * left
        sign = self.sign(x.w) + zero
        u, te = x.u, self._external(x)
        levels = _size_slopes(theta[..., 2], theta[..., 3], u, te)
        peaks = (*_size_slopes(theta[..., 5], theta[..., 6], u, te), *_squares(u, te))
        falls = sign * left * power * self._peaks(theta, x)
        columns = [
            *(sign, x.w + zero, *(slope * sign for slope in levels), left * sign),
            *(slope * left * sign for slope in peaks),
            *(falls * theta[..., 10] / theta[..., 9], -falls * xp.log(self._speed(theta, x))),
        ]
        return xp.stack(columns, axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._level(theta, x) + self._peaks(theta, x) + 0.0 * x.w

    def _external(self, x: Inputs) -> Array:
        return -self.moment * namespace(x.q).sin(x.q)

    def _level(self, theta: Array, x: Inputs) -> Array:
        return theta[..., 0] + _size(theta[..., 2] * x.u - theta[..., 3] * self._external(x))

    def _peaks(self, theta: Array, x: Inputs) -> Array:
        te = self._external(x)
        by_motor, by_external = _squares(x.u, te)
        square = theta[..., 7] * by_motor + theta[..., 8] * by_external
        return theta[..., 4] + _size(theta[..., 5] * x.u - theta[..., 6] * te) + square

    def _speed(self, theta: Array, x: Inputs) -> Array:
        """Speed in Stribeck velocities; hardly above zero at rest, where it has a logarithm."""
        return (namespace(theta, x.w).abs(x.w) + _SMALLEST) / theta[..., 9]

    def _power(self, theta: Array, x: Inputs) -> Array:
        return self._speed(theta, x) ** theta[..., 10]


def _size(x: Array) -> Array:
    """|x|, written so that complex steps pass through it."""
    return namespace(x).where(x < 0.0, -x, x)


def _size_slopes(motor: Array, external: Array, u: Array, te: Array) -> tuple[Array, Array]:
    """Slopes of |motor u - external te| in both coefficients."""
    sign = namespace(motor, u).where(motor * u - external * te < 0.0, -1.0, 1.0)
    return sign * u, -sign * te


def _squares(u: Array, te: Array) -> tuple[Array, Array]:
    """u^2 and te^2 where they count: the smaller one's, and only where u and te are opposed."""
    xp = namespace(u, te)
    opposed = xp.where(u * te < 0.0, 1.0, 0.0)
    motor_wins, zero = xp.abs(u) > xp.abs(te), 0.0 * u * te
    return opposed * xp.where(motor_wins, zero, u**2), opposed * xp.where(motor_wins, te**2, zero)
