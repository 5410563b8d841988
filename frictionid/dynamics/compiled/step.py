"""The physics step of one row, see `dynamics.step`."""

from __future__ import annotations

import math

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.compiled import layout as at
from frictionid.dynamics.compiled.crossing import break_away, cross
from frictionid.dynamics.compiled.torque_balance import (
    below_break_away,
    braked,
    constrained,
    evaluate_dynamics,
    set_levels,
    sliding_torque,
    smooth_torque,
    sticking_torque,
)
from frictionid.mechanics import Plant
from frictionid.programs.loops import Numbers, called, compiled, kept, pointer

_FIRM = 0.9  # of the break-away level: joints held by more may break away soon


@called
def set_stiction(machine: at.Machine, row: Numbers, n: int) -> None:
    """Set the row's stiction: joints that stick, and how the others slide."""
    slow = False
    for j in range(n):
        row[at.DIRECTION * n + j] = np.sign(row[at.W * n + j])
        row[at.BRAKING * n + j] = row[at.MARGIN * n + j] = 0.0
        row[at.STICKING * n + j] = row[at.FIRM * n + j] = 0.0
        slow = slow or abs(row[at.W * n + j]) <= (0.0 if machine.sharp else row[at.SLOW * n + j])
    if machine.breaks and slow:
        _near_rest(machine, row, n)


@called
def _near_rest(machine: at.Machine, row: Numbers, n: int) -> None:
    """The same where some joint is slow."""
    torque, resting = at.SPARE + 1, at.SPARE + 2
    evaluate_dynamics(machine, row, n, at.Q, at.W)
    set_levels(machine, row, n, at.Q)
    if machine.sharp:
        sliding_torque(machine, row, n, at.Q, at.W, at.DIRECTION, at.TF)
    else:
        smooth_torque(machine, row, n, at.Q, at.W, at.TF)
        _set_minimum_braking(row, n)
        braked(row, n)
    for j in range(n):
        row[resting * n + j] = 1.0 if row[at.W * n + j] == 0.0 else 0.0
    sticking_torque(row, n, at.TF, resting, torque)
    for j in range(n):
        held, low, high = row[torque * n + j], row[at.LOW * n + j], row[at.HIGH * n + j]
        rests = row[resting * n + j] != 0.0
        sticks = rests and below_break_away(row, n, torque, j)
        row[at.STICKING * n + j] = 1.0 if sticks else 0.0
        if rests:
            # a joint that breaks away slides against the friction that could not hold it
            row[at.DIRECTION * n + j] = np.sign(held)
        row[at.FIRM * n + j] = 1.0 if sticks and -_FIRM * low < held < _FIRM * high else 0.0
        row[at.MARGIN * n + j] = min(high - held, low + held)


@called
def _set_minimum_braking(row: Numbers, n: int) -> None:
    """Break-away level against the velocity of slow joints under a load below it, else zero."""
    torque, slow = at.SPARE + 1, at.SPARE + 2
    for j in range(n):
        row[slow * n + j] = 1.0 if abs(row[at.W * n + j]) <= row[at.SLOW * n + j] else 0.0
    sticking_torque(row, n, at.TF, slow, torque)
    for j in range(n):
        w = row[at.W * n + j]
        if row[slow * n + j] != 0.0 and w != 0.0 and below_break_away(row, n, torque, j):
            row[at.BRAKING * n + j] = row[at.HIGH * n + j] if w > 0.0 else -row[at.LOW * n + j]


_MARGIN = 1.2  # accelerations grow towards rest, by the Stribeck peak


@called
def accelerate(machine: at.Machine, row: Numbers, n: int, q: int, w: int, out: int) -> None:
    """Joint accelerations under the row's stiction."""
    evaluate_dynamics(machine, row, n, q, w)
    sliding_torque(machine, row, n, q, w, at.DIRECTION, at.TF)
    braked(row, n)
    left = at.SPARE
    for j in range(n):
        row[left * n + j] = row[at.F * n + j] - row[at.TF * n + j]
    constrained(row, n, left, at.STICKING, out)


@kept
def begin_substep(machine: at.Machine, row: Numbers, n: int) -> None:
    """Set stiction and accelerations where a substep begins."""
    set_stiction(machine, row, n)
    accelerate(machine, row, n, at.Q, at.W, at.ACCELERATION)


@called
def is_near_rest(row: Numbers, n: int, dt: float) -> bool:
    """Whether a joint is slow, or will be within dt, where a substep begins."""
    near = False
    for j in range(n):
        w, a, slow = row[at.W * n + j], row[at.ACCELERATION * n + j], row[at.SLOW * n + j]
        stops = w * a < 0.0 and abs(w) < _MARGIN * abs(a) * dt + slow
        near = near or ((stops or abs(w) <= slow) and row[at.FIRM * n + j] == 0.0)
    return near


@kept
def substep(machine: at.Machine, row: Numbers, n: int, dt: float) -> bool:
    """One substep that has begun; whether a joint crossed w = 0."""
    for j in range(n):
        row[at.Q_BEFORE * n + j] = row[at.Q * n + j]
        row[at.W_BEFORE * n + j] = row[at.W * n + j]
    _rk4(machine, row, n, dt)
    crossed = cross(machine, row, n, dt)
    if not crossed:
        break_away(machine, row, n, dt)
    return crossed


@called
def _rk4(machine: at.Machine, row: Numbers, n: int, dt: float) -> None:
    """Runge-Kutta of order 4."""
    q0, w0, a1 = at.Q_BEFORE, at.W_BEFORE, at.ACCELERATION
    q, w2, w3, w4 = at.SPARE + 1, at.SPARE + 2, at.SPARE + 3, at.SPARE + 4
    a2, a3, a4 = at.SPARE + 5, at.SPARE + 6, at.SPARE + 7
    for j in range(n):
        row[w2 * n + j] = row[w0 * n + j] + dt / 2 * row[a1 * n + j]
        row[q * n + j] = row[q0 * n + j] + dt / 2 * row[w0 * n + j]
    accelerate(machine, row, n, q, w2, a2)
    for j in range(n):
        row[w3 * n + j] = row[w0 * n + j] + dt / 2 * row[a2 * n + j]
        row[q * n + j] = row[q0 * n + j] + dt / 2 * row[w2 * n + j]
    accelerate(machine, row, n, q, w3, a3)
    for j in range(n):
        row[w4 * n + j] = row[w0 * n + j] + dt * row[a3 * n + j]
        row[q * n + j] = row[q0 * n + j] + dt * row[w3 * n + j]
    accelerate(machine, row, n, q, w4, a4)
    for j in range(n):
        way = row[w0 * n + j] + 2 * row[w2 * n + j] + 2 * row[w3 * n + j] + row[w4 * n + j]
        change = row[a1 * n + j] + 2 * row[a2 * n + j] + 2 * row[a3 * n + j] + row[a4 * n + j]
        row[at.Q * n + j] = row[q0 * n + j] + dt / 6 * way
        row[at.W * n + j] = row[w0 * n + j] + dt / 6 * change


@called
def adaptive_step(
    machine: at.Machine, row: Numbers, n: int, dt: float, pieces: int, fine: int
) -> None:
    """Advance by dt in some pieces, those finely in which a joint comes near rest."""
    for _ in range(pieces):
        begin_substep(machine, row, n)
        count = fine if is_near_rest(row, n, dt / pieces) else 1
        for k in range(count):
            if k:
                begin_substep(machine, row, n)
            substep(machine, row, n, dt / pieces / count)


def rolled_out(
    machine: at.Machine,
    plant: Plant,
    theta: Array,
    start: tuple[Array, Array],
    u: Array,
    dt: Array,
    sizes: Array,
    runaway: float,
) -> tuple[Array, Array]:
    """Motion q, w (T + 1, ..., n) from start states (..., n); NaN after a divergence.

    Parameters
    ----------
    plant, theta (..., n, P), u (T, ..., n), dt (T, ...)
        Their batch axes broadcast against those of the start, which has all of them.
    sizes : int array, shape (T, 2): pieces of each interval, and their substeps near rest
    runaway : times as fast as slow joints, rows have diverged
    """
    shape, n = start[0].shape, plant.n
    batch, T = shape[:-1], len(u)

    count = math.prod(batch)

    def rows(x: Array, *own: int) -> Array:
        wide = np.array(np.broadcast_to(x, (*batch, *own)), order="C")
        return wide.reshape(count, math.prod(own))

    q, w = (np.empty((T + 1, *shape)) for _ in start)
    q[0], w[0] = start
    flat = [x.reshape(T + 1, count, n) for x in (q, w)]
    driven = rows(np.moveaxis(u, 0, -2), T, n).reshape(count, T, n)
    each = rows(np.moveaxis(dt, 0, -1), T)
    shared = plant.mechanism.motors, plant.slow_like(np.zeros(n))
    p, own = rows(plant.p, plant.p.shape[-1]), rows(theta, *theta.shape[-2:])
    _rollout(machine, *shared, p, own, *flat, driven, each, sizes, runaway)
    return q, w


@compiled
def _rollout(
    machine: at.Machine,
    motors: Array,
    slow: Array,
    p: Array,
    theta: Array,
    q: Array,
    w: Array,
    u: Array,
    dt: Array,
    sizes: Array,
    runaway: float,
) -> None:
    B, T, n = u.shape
    numbers = at.new_row(machine, motors, slow, 0)
    row = pointer(numbers)
    for b in range(B):
        at.set_parameters(machine, row, n, p[b], theta[b])
        at.set_state(row, n, q[0, b], w[0, b], u[b, 0])
        alive = True
        for k in range(T):
            if alive:
                for j in range(n):
                    row[at.U * n + j] = u[b, k, j]
                adaptive_step(machine, row, n, dt[b, k], sizes[k, 0], sizes[k, 1])
                total = 0.0
                for j in range(n):
                    total += abs(row[at.W * n + j]) / slow[j]
                alive = total < runaway
            for j in range(n):
                q[k + 1, b, j] = row[at.Q * n + j] if alive else np.nan
                w[k + 1, b, j] = row[at.W * n + j] if alive else np.nan
    numbers[0] = 0.0  # they live until here
