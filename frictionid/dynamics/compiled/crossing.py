"""Joints of one row that cross w = 0 or break away within a substep.

See `dynamics.zero_crossing` and `dynamics.break_away`.
"""

from __future__ import annotations

from frictionid.dynamics.compiled import layout as at
from frictionid.dynamics.compiled.torque_balance import (
    balance,
    below_break_away,
    constrained,
    sliding_torque,
    sticking_torque,
)
from frictionid.programs.loops import Numbers, called


@called
def cross(machine: at.Machine, row: Numbers, n: int, dt: float) -> bool:
    """Let joints stop or pass whose velocity changed its sign; whether there is one."""
    crossed = False
    for j in range(n):
        row[at.W_END * n + j] = row[at.W * n + j]
        crossed = crossed or row[at.DIRECTION * n + j] * row[at.W * n + j] < 0.0
    if not (machine.breaks and crossed):
        return False
    balance(machine, row, n, at.Q, at.W)
    _set_stops(row, n)
    _set_other_side(machine, row, n)
    at_stake = _set_turned(row, n, dt)
    _set_jump(row, n, at_stake)
    _set_state_after(row, n, dt)
    return True


@called
def _set_stops(row: Numbers, n: int) -> None:
    """Set which joints stop, and which pass at what share of the substep."""
    torque, candidates = at.SPARE + 1, at.SPARE + 3
    for j in range(n):
        crosses = row[at.DIRECTION * n + j] * row[at.W * n + j] < 0.0
        row[candidates * n + j] = 1.0 if crosses or row[at.STICKING * n + j] != 0.0 else 0.0
    sticking_torque(row, n, at.TF, candidates, torque)
    for j in range(n):
        crosses = row[at.DIRECTION * n + j] * row[at.W * n + j] < 0.0
        stops = crosses and below_break_away(row, n, torque, j)
        before = row[at.W_BEFORE * n + j]
        row[at.SHARE * n + j] = before / (before - row[at.W * n + j]) if crosses else 0.0
        row[at.JUMP * n + j] = 0.0
        row[at.STOPS * n + j] = 1.0 if stops else 0.0
        row[at.PASSES * n + j] = 1.0 if crosses and not stops else 0.0
        row[at.HELD * n + j] = 1.0 if stops or row[at.STICKING * n + j] != 0.0 else 0.0


@called
def _set_other_side(machine: at.Machine, row: Numbers, n: int) -> None:
    """Set friction since the crossing: that of joints that pass is that of the other side."""
    other = at.SPARE + 3
    for j in range(n):
        row[other * n + j] = -row[at.DIRECTION * n + j]
    sliding_torque(machine, row, n, at.Q, at.W, other, at.SINCE)
    for j in range(n):
        if row[at.PASSES * n + j] == 0.0:
            row[at.SINCE * n + j] = row[at.TF * n + j]


@called
def _set_turned(row: Numbers, n: int, dt: float) -> bool:
    """Stop joints that stop, too, as one no longer pulls at them; whether any is at stake."""
    w, turned, held = at.SPARE + 4, at.SPARE + 5, at.SPARE + 6
    at_stake, some = False, False
    _velocity_after(row, n, dt, w)
    for j in range(n):
        at_stake = at_stake or row[at.STICKING * n + j] != 0.0
        back = row[at.DIRECTION * n + j] * row[w * n + j] < 0.0
        turns = back and row[at.HELD * n + j] == 0.0 and row[at.PASSES * n + j] == 0.0
        some = some or turns
        row[turned * n + j] = 1.0 if turns else 0.0
        row[held * n + j] = 1.0 if turns else row[at.HELD * n + j]
    if not some:
        return at_stake
    torque, first = at.SPARE + 1, 1.0
    sticking_torque(row, n, at.SINCE, held, torque)
    for j in range(n):
        if row[at.STOPS * n + j] != 0.0:
            first = min(first, row[at.SHARE * n + j])
    for j in range(n):
        if row[turned * n + j] != 0.0 and below_break_away(row, n, torque, j):
            row[at.STOPS * n + j] = row[at.HELD * n + j] = 1.0
            row[at.SHARE * n + j] = first
            at_stake = True
    return at_stake


@called
def _set_jump(row: Numbers, n: int, at_stake: bool) -> None:
    """Set the change of the accelerations since the crossing.

    It may free a joint that is at stake: at rest before, or as a joint no longer pulls at it.
    """
    left, before = at.SPARE + 5, at.SPARE + 6
    if not at_stake:
        for j in range(n):
            row[left * n + j] = row[at.TF * n + j] - row[at.SINCE * n + j]
        constrained(row, n, left, at.HELD, at.JUMP)
        return
    torque, still = at.SPARE + 1, at.SPARE + 7
    sticking_torque(row, n, at.SINCE, at.HELD, torque)
    for j in range(n):
        held = row[at.HELD * n + j] != 0.0
        freed = held and not below_break_away(row, n, torque, j)
        row[still * n + j] = 1.0 if held and not freed else 0.0
        row[left * n + j] = row[at.F * n + j] - (
            row[torque * n + j] if freed else row[at.SINCE * n + j]
        )
    constrained(row, n, left, still, at.JUMP)
    for j in range(n):
        row[left * n + j] = row[at.F * n + j] - row[at.TF * n + j]
    constrained(row, n, left, at.HELD, before)
    for j in range(n):
        row[at.JUMP * n + j] -= row[before * n + j]


@called
def _velocity_after(row: Numbers, n: int, dt: float, out: int) -> float:
    """Set velocities at the end of the substep; the time since the crossing.

    Where a joint stops, M w is kept but for the impulses on joints that stick.
    """
    since, stopped, momentum = 0.0, False, at.SPARE + 7
    for j in range(n):
        stopped = stopped or row[at.STOPS * n + j] != 0.0
        if row[at.PASSES * n + j] + row[at.STOPS * n + j] > 0.0:
            since = max(since, (1.0 - row[at.SHARE * n + j]) * dt)
    for i in range(n):
        row[out * n + i] = row[at.W_END * n + i]
        row[momentum * n + i] = 0.0
        for j in range(n):
            row[momentum * n + i] += row[(at.M + i) * n + j] * row[at.W_END * n + j]
    if stopped:
        constrained(row, n, momentum, at.HELD, out)
    for j in range(n):
        row[out * n + j] += row[at.JUMP * n + j] * since
    return since


@called
def _set_state_after(row: Numbers, n: int, dt: float) -> None:
    """Set the state behind the crossing."""
    w = at.SPARE + 4
    since = _velocity_after(row, n, dt, w)
    for j in range(n):
        if row[at.STOPS * n + j] != 0.0:
            way = row[at.SHARE * n + j] * dt / 2 * row[at.W_BEFORE * n + j]
            row[at.Q * n + j] = row[at.Q_BEFORE * n + j] + way + row[at.JUMP * n + j] * since**2 / 2
        else:
            row[at.Q * n + j] += (row[w * n + j] - row[at.W_END * n + j]) * since / 2
        row[at.W * n + j] = row[w * n + j]


@called
def break_away(machine: at.Machine, row: Numbers, n: int, dt: float) -> None:
    """Let joints slide whose load has grown beyond their break-away level."""
    moves, rests = False, False
    for j in range(n):
        moves = moves or row[at.W * n + j] != 0.0
        rests = rests or (row[at.STICKING * n + j] != 0.0 and row[at.W * n + j] == 0.0)
    if not (moves and rests):  # where nothing moves, no load changes
        return
    balance(machine, row, n, at.Q, at.W)
    torque, broken, still, some = at.SPARE + 1, at.SPARE + 2, at.SPARE + 3, False
    sticking_torque(row, n, at.TF, at.STICKING, torque)
    for j in range(n):
        held = row[at.STICKING * n + j] != 0.0
        breaks = held and not below_break_away(row, n, torque, j)
        row[broken * n + j] = 1.0 if breaks else 0.0
        row[still * n + j] = 1.0 if held and not breaks else 0.0
        some = some or breaks
    if some:
        _slide(row, n, torque, broken, still, dt)


@called
def _slide(row: Numbers, n: int, torque: int, broken: int, still: int, dt: float) -> None:
    """Accelerations grow evenly, from nothing, since the load has passed the level."""
    jump, left, before = at.SPARE + 4, at.SPARE + 5, at.SPARE + 6
    for j in range(n):
        free = row[torque * n + j] if row[broken * n + j] != 0.0 else row[at.TF * n + j]
        row[left * n + j] = row[at.F * n + j] - free
    constrained(row, n, left, still, jump)
    for j in range(n):
        row[left * n + j] = row[at.F * n + j] - row[at.TF * n + j]
    constrained(row, n, left, at.STICKING, before)
    since = 0.0
    for j in range(n):
        row[jump * n + j] -= row[before * n + j]
        if row[broken * n + j] != 0.0:
            excess = abs(row[jump * n + j]) * row[(at.M + j) * n + j]
            whole = max(excess + max(row[at.MARGIN * n + j], 0.0), 1e-300)
            since = max(since, excess / whole * dt)
    for j in range(n):
        row[at.Q * n + j] += row[jump * n + j] * since**2 / 6
        row[at.W * n + j] += row[jump * n + j] * since / 2
