"""Ripple: friction that changes as a joint, or the gear behind it, turns round.

Tf = (1 + sum_k cos_k cos(k gear q) + sin_k sin(k gear q)) level(w) sgn(w) + Fv w

Meshing teeth, a bent shaft and a bearing out of round press more at some angles than at others
[Armstrong1994].
"""

from dataclasses import dataclass
from typing import Any

from frictionid.arrays import Array, namespace
from frictionid.config import Positive
from frictionid.friction import Inputs, LawParameter, Memory

from .cogging import Harmonics, Periodic
from .combined import CombinedLaw

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
