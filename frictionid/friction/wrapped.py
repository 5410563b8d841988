"""Laws around another law: their base, memory that stands still, lines beyond known speeds."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

from pydantic import Field

from frictionid.arrays import Array, like, namespace
from frictionid.config import Positive

from .law import Inputs, Law, LawParameter, Memory

_LAST = 0.01  # of the speed: the line goes on as the last per cent of the curve


def _of_the_law(name: str) -> Any:
    """A property that is that of the law inside."""
    return property(lambda wrapped: getattr(wrapped.law, name))


@dataclass(frozen=True)
class WrappedLaw(Law):
    """A law around another, `law`, whose parameters and memory are the other's."""

    law: Law
    parameters = _of_the_law("parameters")
    initial = _of_the_law("initial")
    sample_time = _of_the_law("sample_time")
    longest_substep = _of_the_law("longest_substep")
    uses_load = _of_the_law("uses_load")
    reads_window = _of_the_law("reads_window")
    uses_temperature = _of_the_law("uses_temperature")

    @property
    def inner(self) -> Law:
        """The other law, as it is asked."""
        return self.law

    def passed_on(self, theta: Array, x: Inputs) -> tuple[Array, Inputs]:
        """What the other law is given for its parameters and its inputs."""
        return theta, x

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self.inner.start(*self.passed_on(theta, x))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.torque(*self.passed_on(theta, x), memory)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.inner.advance(*self.passed_on(theta, x), memory, dt)

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array] | None:
        return self.inner.relaxation(*self.passed_on(theta, x), dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.limit(*self.passed_on(theta, x), memory)


@dataclass(frozen=True)
class HeldLaw(Law):
    """A law whose memory, of so many `entries`, stands still: its last parameters are these.

    It is friction without memory, as that of samples is from one to the next.

    width, shape : smoothing of sgn(w) of the law [rad/s]
    """

    law: Law
    entries: int
    width: float = 0.0
    shape: str = "tanh"
    uses_load = _of_the_law("uses_load")

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        names = (f"memory_{i}" for i in range(self.entries))
        return (*self.law.parameters, *(LawParameter(name, "", -float("inf")) for name in names))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._law.torque(*self._parts(theta, x))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._law.limit(*self._parts(theta, x))

    @cached_property
    def _law(self) -> Law:
        return self.law.with_width(self.width)

    def _parts(self, theta: Array, x: Inputs) -> tuple[Array, Inputs, Memory]:
        first = theta.shape[-1] - self.entries
        return theta[..., :first], x, tuple(theta[..., first + i] for i in range(self.entries))


def held(law: Law, theta: Array, memory: Memory) -> tuple[Law, Array]:
    """A law without memory, and its theta, that is as another one while its memory stands still.

    >>> import numpy as np
    >>> from frictionid.friction import at_rest
    >>> from frictionid.friction.laws import WindowMLP
    >>> law, x = WindowMLP(), at_rest(np.array([0.3]))
    >>> theta = np.array(law.initial)
    >>> memory = law.start(theta, at_rest(np.array([0.1])))
    >>> still, numbers = held(law, theta, memory)
    >>> bool((still.torque(numbers, x, ()) == law.torque(theta, x, memory)).all())
    True
    """
    faster = law.while_held(theta, memory)
    if faster is not None:
        return faster
    xp = namespace(theta)
    shape = (*memory[0].shape, theta.shape[-1])
    whole = [xp.broadcast_to(theta, shape), *(entry[..., None] for entry in memory)]
    return HeldLaw(law, len(memory), law.width, law.shape), xp.concat(whole, axis=-1)


@dataclass(frozen=True)
class LinearOutside(WrappedLaw):
    """The law `law` up to a speed of each joint [rad/s], and from there on a straight line.

    Tf = law(w) where |w| <= speed, law(+-speed) + slope (w -+ speed) beyond

    Data say nothing of faster motion, and an exported friction must say something. The line goes
    on with the slope of the last per cent of the speeds. It never falls, so that it cannot come to
    drive. Memory advances as at the last measured speed.

    >>> import numpy as np
    >>> from frictionid.friction import Friction
    >>> from frictionid.friction.laws import Quadratic
    >>> law = LinearOutside(Quadratic(), (2.0,))
    >>> theta = np.array([[0.1, 0.0, 0.01]])
    >>> Friction(law, theta).curve(np.array([1.0, 2.0, 4.0]))[:, 0].round(3)
    array([0.11, 0.14, 0.22])
    """

    speeds: Annotated[tuple[Positive, ...], Field(min_length=1)]
    kind = ""
    is_network = _of_the_law("is_network")

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        top = like(self.speeds, x.w)
        _, inside = self.passed_on(theta, x)

        def slope(side: float) -> Array:
            near, end = (
                self.law.torque(theta, x._replace(w=share * top + 0.0 * inside.w), memory)
                for share in (side * (1.0 - _LAST), side)
            )
            rise = (end - near) / (side * _LAST * top)
            return namespace(rise).maximum(rise, 0.0 * rise)

        within = self.law.torque(theta, inside, memory)
        beyond = x.w - inside.w
        return within + namespace(x.w).where(x.w > 0, slope(1.0), slope(-1.0)) * beyond

    def sharpened(self) -> Law:
        """The sharpened law, continued beyond the same speeds."""
        return LinearOutside(self.law.sharpened(), self.speeds)

    def passed_on(self, theta: Array, x: Inputs) -> tuple[Array, Inputs]:
        xp, top = namespace(x.w), like(self.speeds, x.w)
        return theta, x._replace(w=xp.minimum(xp.maximum(x.w, -top), top))
