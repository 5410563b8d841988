"""Ripple: friction that changes as a joint, or the gear behind it, turns round.

Tf = (1 + sum_k cos_k cos(k gear q) + sin_k sin(k gear q)) level(w) sgn(w) + Fv w

Meshing teeth, a bent shaft and a bearing out of round press more at some angles than at others
[Armstrong1994].
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.per_joint import smoothed_part

Base = Literal["coulomb_viscous", "coulomb_viscous_asymmetric", "stribeck", "stribeck_asymmetric"]


@dataclass(frozen=True)
class Ripple(Law):
    """A static law whose level varies with the angle, by `harmonics` of `gear` times the joint's.

    `base` is the law that it is laid over; its viscous friction does not ripple. The amplitudes
    `cos` and `sin` of each harmonic k are parts of the level, all of them together at most one, so
    that friction never drives. With gear = 1 they repeat with each turn of the joint, with the
    ratio of a gear with each turn of the motor.
    """

    base: Base = "coulomb_viscous"
    harmonics: Annotated[tuple[Count, ...], Field(min_length=1)] = (1,)
    gear: Positive = 1.0
    width: float = 0.02
    shape: str = "tanh"

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(set(self.harmonics)) < len(self.harmonics):
            raise InputError(f"Ripple: harmonics = {list(self.harmonics)} must differ")

    @cached_property
    def law(self) -> Any:
        """The law that the ripple is laid over."""
        return smoothed_part(self.base, self.width, self.shape)

    @property
    def names(self) -> tuple[str, ...]:
        waves = (f"{name}_{k}" for k in self.harmonics for name in ("cos", "sin"))
        return (*self.law.names, *waves)

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.law.units, *("1",) * (2 * len(self.harmonics)))

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        count = 2 * len(self.harmonics)
        return (*self.law.bounds, *((-1.0 / count, 1.0 / count),) * count)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        flat = (0.0,) * (2 * len(self.harmonics))
        return tuple((*start, *flat) for start in self.law.initial)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level, viscous = self._parts(theta, x)
        return self._height(theta, x) * level + viscous

    def gradient(self, theta: Array, x: Inputs) -> Array:
        own, _ = self._split(theta)
        level, _ = self._parts(theta, x)
        of_law = self.law.gradient(own, x)
        height = self._height(theta, x) + 0.0 * level
        columns = [height * of_law[..., i] for i in range(own.shape[-1] - 1)]
        columns += [of_law[..., -1] + 0.0 * level, *(level * wave for wave in self._waves(x))]
        return namespace(theta, x.w).stack(columns, axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._height(theta, x) * self.law.limit(self._split(theta)[0], x, memory)

    def _split(self, theta: Array) -> tuple[Array, Array]:
        """Parameters of the law, viscous friction last, and amplitudes of the waves."""
        size = theta.shape[-1] - 2 * len(self.harmonics)
        return theta[..., :size], theta[..., size:]

    def _parts(self, theta: Array, x: Inputs) -> tuple[Array, Array]:
        """Torque that ripples, level(w) sgn(w), and viscous friction, which does not."""
        own, _ = self._split(theta)
        viscous = own[..., -1] * x.w
        return self.law.torque(own, x, ()) - viscous, viscous

    def _waves(self, x: Inputs) -> Iterator[Array]:
        xp = namespace(x.q)
        for k in self.harmonics:
            yield xp.cos(k * self.gear * x.q)
            yield xp.sin(k * self.gear * x.q)

    def _height(self, theta: Array, x: Inputs) -> Array:
        """Level at this angle over its mean, >= 0."""
        _, amplitudes = self._split(theta)
        ripple: Any = sum(amplitudes[..., i] * wave for i, wave in enumerate(self._waves(x)))
        return 1.0 + ripple
