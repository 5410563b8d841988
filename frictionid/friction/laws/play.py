"""Play: friction that a joint reaches through a gap, as that of a motor behind gears with backlash.

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
