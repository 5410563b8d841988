"""Laws times a factor: of the angle (ripple), the temperature (thermal) or a gap (play).

Ripple: friction that changes as a joint, or the gear behind it, turns round.

    Tf = (1 + sum_k cos_k cos(k gear q) + sin_k sin(k gear q)) level(w) sgn(w) + Fv w

Meshing teeth, a bent shaft and a bearing out of round press more at some angles than at others
[Armstrong1994].

Thermal: friction of a joint that warms up, its levels and viscous terms follow a temperature.

    Fc(T) = Fc (1 + a (T - T0)),   Fv(T) = Fv exp(-b (T - T0))

Viscous friction falls with the temperature as the viscosity of the lubricant, exponentially, the
level by a straight line, after the measurements of a robot's joint in [Bittencourt2012]. There a
part of viscous friction is constant beside it, and of the level the peak alone changes.

Play: friction that a joint reaches through a gap, as that of a motor behind gears with backlash.

    Tf = share law(w) + joint(w)
    z' = z + dq, held within +-(gap/2 + h)
    share = (z sgn(w) - gap/2 + h)/(2 h), held within 0 and 1;   h = |w| closing/2

z [rad] is where the joint stands between the sides of the gap. There it moves alone, beyond them it
takes the friction with it: the play operator [Nordin2002]. Contact closes within the time
`closing`, half of it before the side and half behind it, so that substeps of any speed see it, and
the impulse of friction is neither larger nor later than that of a sharp contact. Sharp, a substep
crosses the gap at once, and predictions jump with its width.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

from frictionid.arrays import Array, namespace
from frictionid.config import Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, LawParameter, Memory

from .combined import CombinedLaw
from .position_torques import Harmonics, Periodic

_MOST = 0.5


@dataclass(frozen=True)
class Ripple(Periodic, CombinedLaw):
    """Tf = (1 + sum_k cos_k cos(k gear q) + sin_k sin(k gear q)) level(w) sgn(w) + viscous w.

    `harmonics` are the k of `gear` times the joint's angle. `base` is the law that it is laid over,
    "coulomb_viscous" or "stribeck", also as a table with settings such as { kind = "stribeck",
    symmetric = false }; its viscous friction does not ripple.
    The amplitudes `cos` and `sin` of each harmonic k are parts of the level, up to a half each;
    where they add up to less than -1, the level is zero, as friction never drives. Of "auto" least
    squares chooses those of 1 to 96 that the data show. With gear = 1 they repeat with each turn of
    the joint, with the ratio of a gear with each turn of the motor.
    """

    base: Any = "coulomb_viscous"
    harmonics: Harmonics = (1,)
    gear: Positive = 1.0
    width: float = 0.02
    shape: str = "tanh"
    made_of = ("base",)
    kinds = ("coulomb_viscous", "stribeck")
    label = "Ripple"

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        names = self.amplitudes
        return (
            *self.inner.parameters,
            *(LawParameter(name, "1", -_MOST, _MOST, size=0.3, optional=True) for name in names),
        )

    def of_parts(self, what: str, theta: Array, x: Inputs, memory: Memory) -> Array:
        height = self._height(theta, x)
        if what == "limit":
            return height * self.inner.limit(self._split(theta)[0], x, memory)
        level, viscous = self._parts(theta, x)
        return height * level + viscous

    def gradient(self, theta: Array, x: Inputs) -> Array:
        numbers, _ = self._split(theta)
        level, _ = self._parts(theta, x)
        of_law = self.inner.gradient(numbers, x)
        height = self._height(theta, x) + 0.0 * level
        columns = [height * of_law[..., i] for i in range(numbers.shape[-1] - 1)]
        xp = namespace(theta, x.w)
        rubbing = xp.where(height > 0.0, level, 0.0 * level)
        columns += [of_law[..., -1] + 0.0 * level, *(rubbing * wave for wave in self.waves(x.q))]
        return xp.stack(columns, axis=-1)

    def _split(self, theta: Array) -> tuple[Array, Array]:
        """Parameters of the law, viscous friction last, and amplitudes of the waves."""
        size = theta.shape[-1] - 2 * len(self.orders)
        return theta[..., :size], theta[..., size:]

    def _parts(self, theta: Array, x: Inputs) -> tuple[Array, Array]:
        """Torque that ripples, level(w) sgn(w), and viscous friction, which does not."""
        numbers, _ = self._split(theta)
        viscous = numbers[..., -1] * x.w
        return self.inner.torque(numbers, x, ()) - viscous, viscous

    def _height(self, theta: Array, x: Inputs) -> Array:
        """Level at this angle over its mean, >= 0."""
        _, amplitudes = self._split(theta)
        ripple: Any = sum(amplitudes[..., i] * wave for i, wave in enumerate(self.waves(x.q)))
        height: Any = 1.0 + ripple
        return namespace(height).maximum(height, 0.0 * height)


_LEVEL = "N m"  # units of parameters that are levels of friction, and of viscous terms
_VISCOUS = ("N m s/rad", "N m s^2/rad^2")
_WARMING = (
    LawParameter("coulomb_slope", "1/K", -0.05, 0.05, size=0.01),
    LawParameter("viscous_decay", "1/K", -0.05, 0.2, size=0.05),
)


@dataclass(frozen=True)
class Thermal(CombinedLaw):
    """Tf = Fc (1 + a (T - T0)) sgn(w) + Fv exp(-b (T - T0)) w: friction of a joint that warms up.

    law : name of a static law, whose parameters keep their names, and are those at T0; one with
        settings is a table such as { kind = "stribeck", symmetric = false }
    reference : T0 [degC]

    Of any law, `coulomb_slope` a [1/K] belongs to all parameters that are torques,
    `viscous_decay` b [1/K] to those that are torques per velocity or its square; velocities and
    shares of a load stay. Levels do not fall below zero. T [degC] is that of the joint; where none
    is known, that is T0.

    >>> Thermal().names
    ('coulomb', 'viscous', 'coulomb_slope', 'viscous_decay')
    """

    law: Any = "coulomb_viscous"
    reference: float = 25.0
    width: float = 0.02
    shape: str = "tanh"
    uses_temperature = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inner.has_memory or not self.inner.names:
            why = "has a memory" if self.inner.has_memory else "is no friction"
            raise InputError(f"thermal: law = {self.inner.kind!r} {why}: name a static law")

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        return (*self.inner.parameters, *_WARMING)

    def at_temperature(self, theta: Array, temperature: Array) -> tuple[Law, Array]:
        level, viscous = self._factors(theta, temperature)
        columns = [
            theta[..., i] * (level if unit == _LEVEL else viscous if unit in _VISCOUS else 1.0)
            for i, unit in enumerate(self.inner.units)
        ]
        xp = namespace(theta, temperature)
        return self.inner, xp.stack(xp.broadcast_arrays(*columns), axis=-1)

    def of_parts(self, what: str, theta: Array, x: Inputs, memory: Memory) -> Array:
        torque: Array = getattr(self.inner, what)(self._warm(theta, x), x, ())
        return torque

    def gradient(self, theta: Array, x: Inputs) -> Array:
        slopes = self.inner.gradient(self._warm(theta, x), x)
        zero = 0.0 * slopes[..., 0]
        warmer = zero if x.temperature is None else x.temperature - self.reference + zero
        level, viscous = self._factors(theta, x.temperature)
        rising = namespace(zero).where(level > 0.0, warmer, zero)
        columns, by_slope, by_decay = [], zero, zero
        for i, unit in enumerate(self.inner.units):
            column = slopes[..., i]
            if unit == _LEVEL:
                columns.append(column * level)
                by_slope = by_slope + column * theta[..., i] * rising
            elif unit in _VISCOUS:
                columns.append(column * viscous)
                by_decay = by_decay - column * theta[..., i] * viscous * warmer
            else:
                columns.append(column)
        return namespace(zero).stack([*columns, by_slope, by_decay], axis=-1)

    def _warm(self, theta: Array, x: Inputs) -> Array:
        """Parameters of the law at the temperature of inputs."""
        warm = x.temperature
        return theta[..., :-2] if warm is None else self.at_temperature(theta, warm)[1]

    def _factors(self, theta: Array, temperature: Array | None) -> tuple[Array, Array]:
        """Factors (..., n) of levels and of viscous terms."""
        a, b, xp = theta[..., -2], theta[..., -1], namespace(theta)
        warmer = 0.0 * a if temperature is None else temperature - self.reference
        level = 1.0 + a * warmer
        return xp.maximum(level, 0.0 * level), xp.exp(-b * warmer)


_GAP = LawParameter("gap", "rad", 1e-4, 1.0, (0.002, 0.006, 0.02, 0.06), stepwise=True, size=0.03)
_SLOW = 0.02  # [rad/s], contact closes no more sharply than at this speed


@dataclass(frozen=True)
class Play(CombinedLaw):
    """Tf = share(z, gap) law(w) + joint(w), share = 1 at the side it moves to, 0 within the gap.

    law : name of the static law behind the play, whose parameters keep their names; one with
        settings is a table such as { kind = "stribeck", symmetric = false }
    joint : name of one that acts all the time, its parameters begin with "joint_"
    closing : [s] within which contact closes

    `gap` [rad] is how far the joint moves between the sides, where `law` does not act. Memory is
    the place z [rad] between them. It starts at the side to which the joint moves, in the middle
    where it is at rest. The smallest gap, 0.1 mrad, is none: `law` acts all the time.

    >>> Play().names
    ('coulomb', 'viscous', 'gap')
    """

    law: Any = "coulomb_viscous"
    joint: Any = "none"
    closing: Positive = 0.01
    width: float = 0.02
    shape: str = "tanh"
    made_of = ("law", "joint")

    def __post_init__(self) -> None:
        super().__post_init__()
        for law in self.parts:
            if law.has_memory:
                raise InputError(f"play: {law.kind!r} has a memory: play is of a law without")
        if not self.law.names:
            raise InputError("play: law = 'none' is no friction behind the play: name another law")

    @cached_property
    def parameters(self) -> tuple[LawParameter, ...]:
        behind, joint = (law.parameters for law in self.parts)
        return (*behind, _GAP, *(p._replace(name=f"joint_{p.name}") for p in joint))

    @cached_property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        pairs = product(_GAP.initial, self.starts_together())
        return tuple((*behind, gap, *joint) for gap, (behind, joint) in pairs)

    @property
    def longest_substep(self) -> float:  # type: ignore[override]
        """A sixteenth of the time within which contact closes: a quarter makes the gap smaller."""
        return self.closing / 16

    def finer(self) -> Law:
        """With contact that closes in half the time: the bias of the gap is half as large."""
        return replace(self, closing=self.closing / 2)

    def start(self, theta: Array, x: Inputs) -> Memory:
        xp, reach = namespace(theta, x.w), self._reach(theta, x.w)
        return (xp.where(xp.abs(x.w) > _SLOW, xp.sign(x.w) * reach, 0.0 * reach),)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        xp, reach = namespace(theta, x.w), self._reach(theta, x.w)
        return (xp.minimum(xp.maximum(memory[0] + x.w * dt, -reach), reach),)

    def of_parts(self, what: str, theta: Array, x: Inputs, memory: Memory) -> Array:
        behind, joint = (getattr(law, what) for law in self.parts)
        half = self._half(x.w if what == "torque" else 0.0 * x.w)
        share, gap = self._share(theta, x, memory, half), len(self.inner.names)
        return share * behind(theta[..., :gap], x, ()) + joint(theta[..., gap + 1 :], x, ())

    def _reach(self, theta: Array, w: Array) -> Array:
        """Largest |z| [rad]: beyond the side by half the way over which contact closes."""
        return theta[..., len(self.inner.names)] / 2 + self._half(w)

    def _half(self, w: Array) -> Array:
        """Half the way over which contact closes [rad]."""
        xp = namespace(w)
        return self.closing / 2 * xp.maximum(xp.abs(w), _SLOW + 0.0 * w)

    def _share(self, theta: Array, x: Inputs, memory: Memory, half: Array) -> Array:
        """Share (..., n) of the friction behind the play that acts on the joint."""
        xp, gap = namespace(theta, x.w), theta[..., len(self.inner.names)]
        ahead = xp.where(x.w >= 0.0, memory[0], -memory[0])
        share = (ahead - gap / 2 + half) / (2 * half)
        share = xp.where(gap <= _GAP.low, 1.0 + 0.0 * share, share)
        return xp.minimum(xp.maximum(share, 0.0 * share), 1.0 + 0.0 * share)
