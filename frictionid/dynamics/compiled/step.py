"""The physics step of one row, see `dynamics.step`."""

from __future__ import annotations

from frictionid.dynamics.compiled import layout as at
from frictionid.dynamics.compiled.crossing import break_away, cross
from frictionid.dynamics.compiled.stiction import set_stiction
from frictionid.dynamics.compiled.torque_balance import (
    braked,
    constrained,
    evaluate_dynamics,
    sliding_torque,
)
from frictionid.programs.loops import Numbers, called, kept

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
