"""The physics step: one place for what happens between two samples.

    M(q) dw/dt = h(q, w) + B u - A' Tf

under held u, or u - K q - B w of a controller, see `Plant.feedback`. It is integrated by RK4 on
the friction law, in substeps that its slope and the controller need, halved near rest where a
part crosses it, breaks away, or its acceleration bends. Parts are the joints (A = 1), and those
that turn with several of them. Around A w = 0 friction is set-valued: `stiction` says which parts
stick, `zero_crossing` which stop, `break_away` which begin to move.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from frictionid.arrays import Array, namespace, solve
from frictionid.friction import Memory
from frictionid.friction.coordinates import of_parts, onto_joints, resting_parts

from .state import Instant, State, rows_of
from .step_size import StepSize
from .torque_balance import Stiction, constrained, friction_torque
from .zero_crossing import (
    Crossing,
    Substep,
    after_break_away,
    after_crossing,
    stiction,
)

_MARGIN = 1.2  # accelerations grow towards rest, by the Stribeck peak
_BEND = 0.01  # of a slow speed


def adaptive_step(now: Instant, dt: Array, step_size: StepSize) -> State:
    """State after dt in some pieces, each halved for the rows in which it is too long near rest.

    Batch axes of plant, friction, state, held u (..., n) [N m] and dt (..., 1) [s] broadcast.

    >>> import numpy as np
    >>> from frictionid.friction import Friction
    >>> from frictionid.friction.laws import CoulombViscous
    >>> from frictionid.mechanics import Plant, pendulum
    >>> plant = Plant.from_parameters(pendulum(), {"mass": 0.1, "length": 0.2})
    >>> tf = Friction(CoulombViscous(), np.array([[0.1, 0.0]]))
    >>> raised = State(np.array([0.4]), np.array([0.0]))       # gravity 0.076, break-away 0.1 N m
    >>> now = Instant(plant, tf, raised, np.zeros(1))
    >>> adaptive_step(now, np.array([1.0]), StepSize(200, 1)).q
    array([0.4])
    """
    part = dt / step_size.pieces
    for _ in range(step_size.pieces):
        now = now._replace(state=_halved(now, part, step_size.parts))
    return now.state


def _halved(now: Instant, dt: Array, parts: int) -> State:
    """State after dt (..., 1) in at most some parts, a power of two.

    A substep near rest is taken back, and its time halved, where a part crosses w = 0 or breaks
    away in it, or accelerations bend; with memory, which bends unseen, always.
    """
    near, begin = near_rest(now, dt)
    whole = substep(now, dt, begin)
    again = near if now.remembers else near & whole.uneven
    if parts == 1 or not bool(again.any()):
        return whole.state
    late, part = (now.rows(again), rows_of(dt, again, 1)) if now.has_rows else (now, dt)
    half = _halved(late, part / 2, parts // 2)
    state = _halved(late._replace(state=half), part / 2, parts // 2)
    return _joined(again, state, whole.state) if now.has_rows else state


def _joined(which: Array, part: State, whole: State) -> State:
    """A state with rows (...) of another."""
    batch, xp = whole.q.shape[:-1], namespace(whole.q)
    memory = (1.0 * xp.broadcast_to(z, (*batch, z.shape[-1])) for z in whole.memory)
    out = State(1.0 * whole.q, 1.0 * whole.w, tuple(memory))
    for x, rows in ((out.q, part.q), (out.w, part.w), *zip(out.memory, part.memory, strict=True)):
        x[which] = rows
    return out


# What is known where a substep begins: its stiction, and accelerations (..., n).
Begin = tuple[Stiction, Array]


def near_rest(now: Instant, dt: Array) -> tuple[Array, Begin]:
    """Rows (...) with a joint that is slow, or will be within dt, unless it sticks; the begin."""
    held, turns = stiction(now), now.turns
    a = acceleration(now, held)
    w, change = of_parts(now.state.w, turns), of_parts(a, turns)
    firm = namespace(w).zeros_like(w) != 0.0 if held.firm is None else held.firm
    near: Any = parts_near_rest(w, change, now.plant.slow_like(w), firm, dt).any(-1)
    return near, (held, a)


def parts_near_rest(w: Array, change: Array, slow: Array, firm: Array, dt: Array) -> Array:
    """Parts (..., m) that are slow, or will be within dt at a rate of change; not firm ones."""
    speed = namespace(w).abs(w)
    stops = (w * change < 0) & (speed < _MARGIN * namespace(w).abs(change) * dt + slow)
    return (stops | (speed <= slow)) & ~firm


class Substepped(NamedTuple):
    """State after a substep, the stiction in it, the rows (...) that crossed w = 0, if any.

    uneven : rows (...) in which something crossed, broke away, or bent: a shorter one is better
    """

    state: State
    stiction: Stiction
    crossing: tuple[Array, Crossing] | None
    uneven: Array


def substep(now: Instant, dt: Array, begin: Begin | None = None) -> Substepped:
    """State after one substep, and what happened in it."""
    held = stiction(now) if begin is None else begin[0]
    state, memory = now.state, advanced(now, dt / 2)
    # accelerations are those of the begin where the memory does not advance in it
    first = begin[1] if begin is not None and memory is state.memory else None

    def at(q: Array, w: Array) -> Instant:
        return now._replace(state=State(q, w, memory))

    q, w, bend = rk4(lambda q, w: acceleration(at(q, w), held), state.q, state.w, dt, first)
    memory = advanced(at(q, w), dt / 2)
    part = Substep(state, at(q, w), held, dt)
    crossed = after_crossing(part)
    if crossed is not None:
        part = part._replace(end=part.end._replace(state=crossed[0]))
    after = after_break_away(part, None if crossed is None else crossed[1])
    turns = now.turns
    bend, ends = of_parts(bend, turns), resting_parts(after.w, turns)
    firm = namespace(w).ones_like(ends) if held.firm is None else held.firm
    uneven = is_uneven(bend, now.velocities, ends, firm, now.plant.slow_like(bend))
    if crossed is not None:
        uneven = uneven | crossed[1]
    if turns is not None and held.sticking is not None:  # joints that other parts hold, too
        after = after._replace(w=resting_parts(after.w, turns)[..., : now.plant.n])
    return Substepped(after, held, None if crossed is None else crossed[1:], uneven)


def is_uneven(bend: Array, begins: Array, ends: Array, firm: Array, slow: Array) -> Array:
    """Rows (...) in which accelerations bend much, see `rk4`, or a part leaves rest, or may.

    begins, ends : velocities (..., m) of the parts; firm : (..., m), whether what rests stays there
    """
    rests: Any = (ends == 0.0) & (firm != 0.0)
    even: Any = (namespace(bend).abs(bend) <= _BEND * slow) & ((begins != 0.0) | rests)
    return ~even.all(-1)


def rk4(
    accelerate: Callable[[Array, Array], Array],
    q: Array,
    w: Array,
    dt: Array,
    first: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Angles and velocities after dt by the Runge-Kutta method of order 4, dw/dt = accelerate.

    Beside them how far velocities are from those by the trapezoidal rule: how accelerations bend.

    first : accelerations at q and w, where they are known
    """
    a1 = accelerate(q, w) if first is None else first
    w2 = w + dt / 2 * a1
    a2 = accelerate(q + dt / 2 * w, w2)
    w3 = w + dt / 2 * a2
    a3 = accelerate(q + dt / 2 * w2, w3)
    w4 = w + dt * a3
    a4 = accelerate(q + dt * w3, w4)
    mean = (a1 + 2 * a2 + 2 * a3 + a4) / 6
    return q + dt / 6 * (w + 2 * w2 + 2 * w3 + w4), w + dt * mean, dt * (mean - (a1 + a4) / 2)


def acceleration(now: Instant, stiction: Stiction | None = None) -> Array:
    """Joint accelerations dw/dt (..., n) [rad/s^2]."""
    M, h = now.plant.dynamics(now.state.q, now.state.w)
    Tf = friction_torque(now.friction, now.inputs, now.state.memory, stiction)
    turns = now.turns
    left = h + now.driven - onto_joints(Tf, turns)
    if stiction is None or stiction.sticking is None:
        return solve(M, left)
    return constrained(M, left, stiction.sticking, turns)


def advanced(now: Instant, dt: Array) -> Memory:
    """Memory after dt, of laws whose memory advances with each substep; else as it is."""
    return now.memory_after(dt) if now.remembers else now.state.memory


def euler_step(now: Instant, dt: Array) -> State:
    """State after dt by explicit Euler, q' = q + w dt: the study's step, kept for comparison."""
    q, w, _ = now.state
    return State(q + dt * w, w + dt * acceleration(now), advanced(now, dt))


def semi_implicit_step(now: Instant, dt: Array) -> State:
    """State after dt by semi-implicit Euler, q' = q + w' dt: what backward differences imply."""
    after = euler_step(now, dt)
    return after._replace(q=now.state.q + dt * after.w)
