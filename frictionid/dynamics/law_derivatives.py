"""How a friction torque changes with what it depends on: the law's own slopes, or differences."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.coordinates import is_coupled_by_load, of_parts, torque_map
from frictionid.friction.wrapped import WrappedLaw
from frictionid.mechanics import Plant

from .state import Instant, State
from .torque_balance import (
    Stiction,
    least_sliding_speed,
    sharpened,
    sliding_velocity,
)

# Central differences: the cube root of rounding, times the scale on which friction changes
SPEED = 1e-6  # [rad/s], and [rad], [N m]
_THETA = 1e-6  # of the value


class FreeTheta(NamedTuple):
    """Which entries of theta are free: joint or other part, and place (F,) of each.

    combinations : (F, r), where what is free are r combinations of each joint's entries
    runs, terms : so many runs of so many entries are the last ones, coefficients of Chebyshev's
        polynomials of one number: slopes by the first two of a run tell those by the others
    """

    joint: Array
    place: Array
    combinations: Array | None = None
    runs: int = 0
    terms: int = 0

    @property
    def directions(self) -> int:
        """Number D of what is free."""
        if self.combinations is None:
            return len(self.joint)
        return (int(self.joint.max()) + 1) * self.combinations.shape[1]

    @property
    def telling(self) -> Array:
        """Whether slopes by an entry (F,) tell those by others, or its own."""
        behind = np.arange(len(self.joint)) - (len(self.joint) - self.runs * self.terms)
        return (behind < 0) | (behind % max(self.terms, 1) < 2)

    def of_parts(self, slopes: Array, parts: int) -> Array:
        """Slopes (..., m, D) of all parts, from slopes (..., F) of each entry's own part."""
        return self.combined(slopes[..., None, :] * (self.joint == np.arange(parts)[:, None]))

    def combined(self, each: Array) -> Array:
        """Slopes (..., m, D) by what is free, from slopes (..., m, F) by its entries."""
        if self.combinations is None:
            return each
        r = self.combinations.shape[1]
        mine = np.arange(self.directions) // r == self.joint[:, None]
        return each @ (np.tile(self.combinations, self.directions // r) * mine)


class Slopes(NamedTuple):
    """Friction torque (K, m) [N m] of all parts and its partial derivatives.

    by_q, by_w, by_u (K, m, n) by those of the joints, of motor torques in closed loop; by_memory
    (K, e, m), of each part's own entries; by_theta (K, m, F), by each free entry of theta; by_base
    (K, m, nb), by free base parameters, which the loads of gears follow.
    """

    torque: Array
    by_q: Array
    by_w: Array
    by_u: Array
    by_memory: Array
    by_theta: Array
    by_base: Array


class LawReads(NamedTuple):
    """What a law looks at besides a joint's velocity: angle, motor torque, others' velocities."""

    q: bool
    u: bool
    others: bool = False


def reads_of(law: Law, theta: Array, x: Inputs) -> LawReads:
    """What the torque of a law depends on at inputs (K, n)."""
    memory = law.start(theta, x)  # of the motion before, whatever is changed now
    dt = np.full((1,), law.sample_time or 0.01)

    def torque(x: Inputs) -> Array:
        return law.torque(theta, x, law.advance(theta, x, memory, dt))

    here = torque(x)
    turned = torque(x._replace(q=x.q + 0.3))
    pushed = torque(x._replace(u=x.u + 0.1 * (1.0 + np.abs(x.u).max())))
    changed = [torque(x._replace(w=x.w + 0.3 * joint)) != here for joint in np.eye(x.w.shape[-1])]
    others = any(np.delete(joints, j, axis=1).any() for j, joints in enumerate(changed))
    return LawReads(not np.array_equal(here, turned), not np.array_equal(here, pushed), others)


def slopes(
    now: Instant, free: FreeTheta, base: tuple[int, ...], reads: LawReads, stiction: Stiction
) -> Slopes:
    """Friction torque and its slopes at states (K, n), of parts that slide to their side."""
    plant, friction, state, u = now
    theta, memory, law = friction.theta, state.memory, sharpened(friction, stiction)

    def sliding(q: Array, w: Array, u: Array, theta: Array = theta, plant: Plant = plant) -> Inputs:
        x = Instant(plant, replace(friction, theta=theta), State(q, w), u).inputs
        least = least_sliding_speed(friction.law)
        return x._replace(w=sliding_velocity(x.w, stiction.direction, least))

    def torque(x: Inputs) -> Array:
        return law.torque(theta, x, memory)

    at = (state.q, state.w, u)
    x, each = sliding(*at), of_parts(state.w, now.turns)
    w, moves = x.w, (x.w == each)[..., None]
    here, K = torque(x), len(w)
    if law.uses_load:
        by_q, by_w, by_u = _through_load(lambda *v: torque(sliding(*v)), at)
    else:
        eye, A = np.eye(w.shape[-1]), plant.mechanism.friction_map

        def diagonal(name: str) -> Array:
            return by_input(torque, x, name)[..., None] * eye

        by_q = diagonal("q") @ A if reads.q else np.zeros((K, *A.shape))
        by_u = diagonal("u") @ torque_map(plant.mechanism) if reads.u else np.zeros((K, *A.shape))
        if reads.others:
            columns = [by_input(torque, x, "w", joint) for joint in eye]
            by_w = np.stack(columns, axis=-1) * moves @ A
        else:
            by_w = diagonal("w") * moves @ A
        if reads.u and plant.feedback is not None:
            by_q = by_q - by_u * plant.feedback[..., 0, None, :]
            by_w = by_w - by_u * plant.feedback[..., 1, None, :]
    gradient, of_memory = _own_slopes(law, theta, x, memory, len(free.place) > 0)
    if is_coupled_by_load(plant.mechanism, law):
        of_theta = free.combined(
            _by_theta_of_all(theta, free, lambda t: law.torque(t, sliding(*at, t), memory), here)
        )
        of_base = _by_base(plant, base, lambda other: torque(sliding(*at, plant=other)))
    else:
        of_base = np.zeros((*here.shape, len(base)))
        each = by_theta(theta, free, lambda t: law.torque(t, x, memory), gradient, 0.0 * x.w)
        of_theta = free.of_parts(each, w.shape[-1])
    entries = np.stack(of_memory, axis=-2) if memory else np.zeros((K, 0, w.shape[-1]))
    return Slopes(here, by_q, by_w, by_u, entries, of_theta, of_base)


def difference(
    function: Callable[[Any], Array], value: Array, step: Array | float, size: Array | float
) -> Array:
    """Slope of a function by central difference, of values a step of some size up and down."""
    return (function(value + step) - function(value - step)) / (2 * size)


def by_input(
    function: Callable[[Inputs], Array], x: Inputs, name: str, joints: Array | float = 1.0
) -> Array:
    """Slope of a function of the inputs in one of them, of all joints or those that are one."""
    value, step = getattr(x, name), SPEED * joints
    return difference(lambda v: function(x._replace(**{name: v})), value, step, SPEED)


def _own_slopes(
    law: Law, theta: Array, x: Inputs, memory: Memory, free: bool
) -> tuple[Array | None, Memory]:
    """Derivatives of the torque by theta (K, n, P), of laws that know them, and by the memory.

    free : whether anything of theta is; otherwise only the memory's are needed
    """
    if not memory:
        return (law.gradient(theta, x) if free else None), ()
    alone = None if free else law.memory_slopes(theta, x, memory)
    if alone is not None:
        return None, alone
    return law.slopes(theta, x, memory) or (
        None,
        by_memory(lambda m: law.torque(theta, x, m), memory),
    )


def _through_load(
    torque: Callable[..., Array], values: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """Slopes (K, m, n) by q, w and u of a torque that depends on the motion of all joints."""

    def slopes_by(part: int) -> Array:
        def moved(value: Array) -> Array:
            return torque(*values[:part], value, *values[part + 1 :])

        steps = SPEED * np.eye(values[part].shape[-1])
        return np.stack([difference(moved, values[part], s, SPEED) for s in steps], axis=-1)

    return slopes_by(0), slopes_by(1), slopes_by(2)


def by_memory(function: Callable[[Memory], Array], memory: Memory) -> Memory:
    """Slopes of a function of the memory, entry by entry, each joint's in its own."""

    def slope(i: int) -> Array:
        step = 1e-6 * (1e-3 + np.abs(memory[i]))
        return difference(
            lambda entry: function((*memory[:i], entry, *memory[i + 1 :])), memory[i], step, step
        )

    return tuple(map(slope, range(len(memory))))


def by_theta(
    theta: Array,
    free: FreeTheta,
    function: Callable[[Array], Array],
    gradient: Array | None,
    zero: Array,
) -> Array:
    """Slopes (..., K, F) of a function of theta in its free entries, in those entries' joints.

    gradient : (K, n, P), of a law that knows it; otherwise differences
    """
    if gradient is not None:
        return gradient[..., free.joint, free.place]
    columns = {}
    for place in np.unique(free.place):
        step = np.zeros_like(theta)
        step[..., place] = _theta_step(theta[..., place])
        columns[int(place)] = difference(function, theta, step, step[..., place]) + zero
    chosen = zip(free.place, free.joint, strict=True)
    rows = [columns[int(place)][..., int(joint)] for place, joint in chosen]
    return np.stack(rows, axis=-1) if rows else np.empty((*zero.shape[:-1], 0))


def _by_theta_of_all(
    theta: Array, free: FreeTheta, function: Callable[[Array], Array], zero: Array
) -> Array:
    """Slopes (K, m, F) of a function (K, m) of theta in its free entries, in all joints."""
    rows = [np.empty((*zero.shape, 0))]
    for joint, place in zip(free.joint, free.place, strict=True):
        step = np.zeros_like(theta)
        step[..., joint, place] = _theta_step(theta[..., joint, place])
        size = step[..., joint, place, None]
        rows.append(difference(function, theta, step, size)[..., None])
    return np.concatenate(rows, axis=-1)


def _by_base(plant: Plant, base: tuple[int, ...], function: Callable[[Plant], Array]) -> Array:
    """Slopes (K, m, nb) of a function (K, m) of a plant in some of its base parameters."""
    out = np.zeros((*function(plant).shape, len(base)))
    for i, k in enumerate(base):
        size = _theta_step(plant.p[..., k : k + 1])
        step = size * np.eye(plant.p.shape[-1])[k]
        out[..., i] = difference(lambda p: function(replace(plant, p=p)), plant.p, step, size)
    return out


def _theta_step(value: Array) -> Array:
    return _THETA * np.maximum(1e-3, np.abs(value))


# --- Laws of tensors ------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class SmoothedLaw(WrappedLaw):
    """A law around another, with the other's smoothing at rest, of `width` and `shape`."""

    width: float = field()  # without the default of `Law`
    shape: str = field()

    def __post_init__(self) -> None:
        """The other law has checked its smoothing."""

    def __repr__(self) -> str:
        return repr(self.law)

    @property
    def inner(self) -> Law:
        """The other law, with the smoothing that is asked for."""
        return self.law.with_width(self.width)


_ROOM = 4_000_000  # numbers of rows' own parameters at a time


@dataclass(frozen=True, eq=False, repr=False)
class TensorLaw(SmoothedLaw):
    """A law that computes with tensors like a given one, NumPy outside."""

    like: Array

    def start(self, theta: Array, x: Inputs) -> Memory:
        return tuple(map(_numpy, self.inner.start(self._in(theta), x.each(self._in))))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        inner = x.each(self._in)
        return _numpy(self.inner.torque(self._in(theta), inner, self._all(memory)))

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        inner, z = x.each(self._in), self._all(memory)
        return tuple(map(_numpy, self.inner.advance(self._in(theta), inner, z, self._in(dt))))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        inner = x.each(self._in)
        return _numpy(self.inner.limit(self._in(theta), inner, self._all(memory)))

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return self.gradient_along(theta, (x,), (), np.zeros((len(x.w), 1)))

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory]:
        zero = np.zeros((len(x.w), 1))
        parts = [self._back(theta, (x,), memory, zero, rows) for rows in self._rows(theta, zero)]
        by_memory = zip(*(part[1] for part in parts), strict=True)
        return np.concatenate([part[0] for part in parts]), tuple(map(np.concatenate, by_memory))

    def gradient_along(
        self, theta: Array, path: Sequence[Inputs], memory: Memory, dt: Array
    ) -> Array:
        """Derivatives (K, n, P) of the torque at the end of K short paths.

        path : inputs (K, n) at each sample, of which the first finds the memory (K, n) as given
        dt : (K, 1) [s] between the samples
        """
        parts = self._rows(theta, dt)
        return np.concatenate([self._back(theta, path, memory, dt, rows)[0] for rows in parts])

    def _rows(self, theta: Array, dt: Array) -> list[slice]:
        most = max(1, _ROOM // int(np.prod(theta.shape)))
        return [slice(i, i + most) for i in range(0, len(dt), most)]

    def _back(
        self, theta: Array, path: Sequence[Inputs], memory: Memory, dt: Array, rows: slice
    ) -> tuple[Array, Memory]:
        span = self._in(dt[rows])
        # numbers of its own for every row: one pass back then gives the derivatives of all rows
        leaf = self._in(np.broadcast_to(theta, (len(dt[rows]), *theta.shape))).requires_grad_()
        first = tuple(z.requires_grad_() for z in self._all([entry[rows] for entry in memory]))
        z = first
        inner = [x.each(lambda value: self._in(value[rows])) for x in path]
        for x in inner[1:]:
            z = self.inner.advance(leaf, x, z, span)
        self.inner.torque(leaf, inner[-1], z).sum().backward()
        # an entry that the torque does not read has no derivative
        none = np.zeros_like(path[0].w[rows])
        by_memory = tuple(none if z.grad is None else _numpy(z.grad) for z in first)
        return _numpy(leaf.grad), by_memory

    def _all(self, values: Sequence[Array]) -> tuple[Any, ...]:
        return tuple(self._in(value) for value in values)

    def _in(self, x: Array) -> Any:
        xp = namespace(self.like)
        return xp.asarray(np.array(x, dtype=float), device=self.like.device)


def _numpy(x: Any) -> Array:
    return x.detach().cpu().numpy()
