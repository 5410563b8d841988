"""Prediction over many samples: the physics step, repeated for all starts side by side."""

import math
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array, namespace, plain
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.mechanics import Plant

from .compiled.loops import RUNAWAY, are_many, machine_of, rolled_out
from .state import Instant, State
from .step import adaptive_step, euler_step, semi_implicit_step
from .step_size import StepSize, step_size_of

_ONE_STEP = {"euler": euler_step, "semi_implicit": semi_implicit_step}  # for each sample
MANY = 300  # samples of two joints: fewer are predicted before loops are compiled


def rollout(
    plant: Plant,
    friction: Friction,
    start: State,
    u: Array,
    dt: Array,
    *,
    method: str = "rk4",
    refine: int = 1,
    step_size: StepSize | None = None,
    base_motion: Array | None = None,
) -> State:
    """Motion q, w (T + 1, ..., n) from start states under the given motor torques.

    The start comes first; after a divergence it is NaN.

    Parameters
    ----------
    plant, friction
        Batch axes broadcast against those of the start: one for all, or one for each start.
    start : State, arrays of shape (..., n)
        A law with memory starts it with the motion, if the states have none.
    u : array, shape (T, ..., n) [N m], mean motor torque of each interval
    dt : array, shape (T, ...) [s], length of each interval
    method : "rk4" (the physics step, with stiction), "euler" or "semi_implicit" (one step a sample)
    refine : int
        Multiplies the number of RK4 steps.
    step_size : StepSize or None
        Of all intervals, in place of what friction and lengths ask for.
    base_motion : array, shape (T, ..., 9), or None
        Motion of a floating base in each interval, see `Plant.on_base`.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> from frictionid.mechanics import pendulum
    >>> plant = Plant.from_parameters(pendulum(), {"mass": 0.1, "length": 0.2})
    >>> tf = Friction(CoulombViscous(), np.array([[0.01, 0.0]]))
    >>> start = State(np.array([1.0]), np.array([0.0]))
    >>> motion = rollout(plant, tf, start, np.zeros((600, 1)), np.full(600, 1 / 60))
    >>> bool(motion.w[-1, 0] == 0.0)                            # it came to rest, exactly
    True
    """
    if method not in ("rk4", *_ONE_STEP):
        names = ", ".join(map(repr, ("rk4", *_ONE_STEP)))
        raise InputError(f"the step {method!r} is unknown; known are {names}")
    xp = namespace(start.q, u)
    sizes = [step_size] * len(dt) if step_size else []
    sizes = sizes or (_step_sizes(plant, friction, dt, refine) if method == "rk4" else [])
    state, alive = begin(Instant(plant, friction, start, u[0]), dt[0]), None
    many = are_many(len(u) * math.prod(state.q.shape[:-1]), MANY, plant.n)
    many = many and method == "rk4" and base_motion is None
    if many and (machine := machine_of(plant, friction, state.q, u)) is not None:
        counts = np.array(sizes, dtype=int)
        return rolled_out(machine, plant, friction.theta, state, u, dt, counts)
    q, w = [state.q], [state.w]
    for k in range(u.shape[0]):
        plant = plant if base_motion is None else plant.on_base(base_motion[k])
        now = Instant(plant, friction, state, u[k])
        with np.errstate(all="ignore"):  # a diverging motion overflows before it is frozen
            if method == "rk4":
                compiled = many and friction.law.sample_time is not None
                state = ahead(now, dt[k], sizes[k], compiled)
            else:
                state = _ONE_STEP[method](now, dt[k][..., None])
        state, alive = frozen(plant, state, alive)
        # a memory of samples takes in the newest one with the torque logged with it
        newest = u[min(k + 1, u.shape[0] - 1)]
        state = sampled(now._replace(state=state, u=newest), dt[k][..., None])
        q.append(masked(state.q, alive))
        w.append(masked(state.w, alive))
    return State(xp.stack(q), xp.stack(w))


def ahead(now: Instant, dt: Array, size: StepSize, many: bool) -> State:
    """State after dt (...) within a sample interval, in which a memory of samples stands still.

    many : whether there is enough to do for compiled loops
    """
    plant, friction, state, u = now
    if state.memory and friction.law.sample_time is not None:
        still = friction.law.while_held(friction.theta, state.memory)
        if still is not None:
            friction = replace(friction, law=still[0], theta=still[1])
            alone = now._replace(friction=friction, state=state._replace(memory=()))
            return ahead(alone, dt, size, many)._replace(memory=state.memory)
    machine = machine_of(plant, friction, state.q, u) if many else None
    if machine is None:
        return adaptive_step(now, dt[..., None], size)
    sizes = np.array([size])
    end = rolled_out(machine, plant, friction.theta, state, u[None], dt[None], sizes)
    return end._replace(q=end.q[1], w=end.w[1])


def begin(now: Instant, dt: Array) -> State:
    """Start state with the batch axes of everything that takes part, and with a memory.

    The torque of the instant and dt (...) [s] are those of the first interval.
    """
    plant, friction, (q, w, memory), u = now
    xp = namespace(q)
    batches = (friction.theta.shape[:-2], dt.shape, plant.p.shape[:-1])
    shape = np.broadcast_shapes(q.shape, u.shape, *((*batch, 1) for batch in batches))
    state = State(xp.broadcast_to(q, shape), xp.broadcast_to(w, shape), memory)
    if memory:
        return state
    x = now._replace(state=state).inputs
    return state._replace(memory=friction.law.start(friction.theta, x))


def diverged(plant: Plant, state: State) -> Array:
    """Rows (...) in which a joint is faster than any machine's, or no number."""
    xp = namespace(state.w)
    # a product, as sums over short last axes are slow
    return ~(xp.abs(state.w) @ (1.0 / plant.slow_like(state.w)) < RUNAWAY)


def _step_sizes(plant: Plant, friction: Friction, dt: Array, refine: int) -> list[StepSize]:
    """How each interval is divided: a gap in the recording must not refine all the others."""
    longest = plain(dt).reshape(len(dt), -1).max(axis=1)
    finest = step_size_of(plant, friction, float(longest.max()))
    counts = [int(np.ceil(finest.pieces * share - 1e-9)) for share in longest / longest.max()]
    return [StepSize(refine * count, finest.parts) for count in counts]


def sampled(now: Instant, dt: Array) -> State:
    """The state with the memory of laws that advance once a sample, dt (..., 1) after the last."""
    if not now.state.memory or now.friction.law.sample_time is None:
        return now.state
    return now.state._replace(memory=now.memory_after(dt))


def freeze(state: State, wild: Array, alive: Array | None) -> tuple[State, Array]:
    """Put diverged motions to rest, so that they stay finite, and remember them."""
    xp = namespace(state.w)
    still = xp.where(wild[..., None], xp.zeros_like(state.w), state.w)
    place = xp.where(wild[..., None], xp.zeros_like(state.q), state.q)
    alive = ~wild if alive is None else alive & ~wild
    return State(place, still, state.memory), alive


def frozen(plant: Plant, state: State, alive: Array | None) -> tuple[State, Array | None]:
    """The state with motions at rest that have just diverged, and which have not (...)."""
    wild = diverged(plant, state)
    return freeze(state, wild, alive) if bool(wild.any()) else (state, alive)


def masked(value: Array, alive: Array | None) -> Array:
    """Values (..., n), NaN in rows (...) that are not alive."""
    xp = namespace(value)
    return value if alive is None else xp.where(alive[..., None], value, float("nan"))
