"""Torques on the joints of one row, and the friction that keeps some of them from moving.

Vectors of the joints are lines of the row's table, given by their numbers.
"""

from __future__ import annotations

from frictionid.dynamics.compiled import layout as at
from frictionid.programs.loops import Numbers, called, inlined, run_at

_SWEEPS = 50
_SETTLED = 1e-12  # [N m]


@called
def inverse_of_free(row: Numbers, n: int, matrix: int, held: int, out: int) -> None:
    """Inverse (n, n) of the part of a matrix whose joints are not held, zero for the others.

    held : line, or NONE
    """
    first = held >= 0 and row[held * n + 0] != 0.0
    if n == 1:
        row[out * n + 0] = 0.0 if first else 1.0 / row[matrix * n + 0]
        return
    if n > 2:
        _inverse_of_many(row, n, matrix, held, out)
        return
    second = held >= 0 and row[held * n + 1] != 0.0
    a, b, c, d = (
        row[matrix * n + 0],
        row[matrix * n + 1],
        row[(matrix + 1) * n + 0],
        row[(matrix + 1) * n + 1],
    )
    if first or second:
        row[out * n + 1] = row[(out + 1) * n + 0] = 0.0
        row[out * n + 0] = 0.0 if first else 1.0 / a
        row[(out + 1) * n + 1] = 0.0 if second else 1.0 / d
    else:
        det = a * d - b * c
        row[out * n + 0], row[out * n + 1] = d / det, -b / det
        row[(out + 1) * n + 0], row[(out + 1) * n + 1] = -c / det, a / det


@called
def _inverse_of_many(row: Numbers, n: int, matrix: int, held: int, out: int) -> None:
    """The same by elimination with pivots."""
    left = at.left_of(n)
    for i in range(n):
        for j in range(n):
            own = 1.0 if i == j else 0.0
            fixed = held >= 0 and (row[held * n + i] != 0.0 or row[held * n + j] != 0.0)
            row[(out + i) * n + j] = own
            row[(left + i) * n + j] = own if fixed else row[(matrix + i) * n + j]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(row[(left + i) * n + k]) > abs(row[(left + best) * n + k]):
                best = i
        pivot = row[(left + best) * n + k]
        for j in range(n):
            a, b = row[(left + best) * n + j], row[(out + best) * n + j]
            row[(left + best) * n + j], row[(out + best) * n + j] = (
                row[(left + k) * n + j],
                row[(out + k) * n + j],
            )
            row[(left + k) * n + j], row[(out + k) * n + j] = a / pivot, b / pivot
        for i in range(n):
            factor = row[(left + i) * n + k]
            if i != k and factor != 0.0:
                for j in range(n):
                    row[(left + i) * n + j] -= factor * row[(left + k) * n + j]
                    row[(out + i) * n + j] -= factor * row[(out + k) * n + j]
    for j in range(n):
        if held >= 0 and row[held * n + j] != 0.0:
            row[(out + j) * n + j] = 0.0


@called
def constrained(row: Numbers, n: int, f: int, held: int, out: int) -> None:
    """Solution of M a = f - T with a = 0 for joints that are held, T = 0 for the others."""
    inverse = at.inverse_of(n)
    inverse_of_free(row, n, at.M, held, inverse)
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += row[(inverse + i) * n + j] * row[f * n + j]
        row[out * n + i] = total


@inlined
def evaluate_dynamics(machine: at.Machine, row: Numbers, n: int, q: int, w: int) -> None:
    """Set M and f = h + B u at a state."""
    motion = at.motion_of(n)
    for j in range(n):
        row[motion * n + j] = row[q * n + j]
        row[(motion + 1) * n + j] = row[w * n + j]
    run_at(machine.dynamics, row, motion * n, at.M * n)
    for j in range(n):
        row[at.F * n + j] = row[(at.M + n) * n + j] + row[at.MOTORS * n + j] * row[at.U * n + j]


@inlined
def _read_law(machine: at.Machine, row: Numbers, n: int, q: int) -> int:
    """Set what a law reads besides velocities; the line of these."""
    law = at.law_of(n, machine)
    for j in range(n):
        row[(law + 1) * n + j] = row[q * n + j]
        row[(law + 2) * n + j] = row[at.U * n + j]
    return law


@inlined
def sliding_torque(
    machine: at.Machine, row: Numbers, n: int, q: int, w: int, direction: int, out: int
) -> None:
    """Friction torques of joints that slide in a direction."""
    law = _read_law(machine, row, n, q)
    for j in range(n):
        side, speed = row[direction * n + j], row[w * n + j]
        if machine.breaks and machine.beyond > 0.0 and side != 0.0:
            speed = side * max(side * speed, machine.beyond)
        row[law * n + j] = speed
    run_at(machine.torque, row, law * n, out * n)


@called
def smooth_torque(machine: at.Machine, row: Numbers, n: int, q: int, w: int, out: int) -> None:
    """Friction torques of the law as it is."""
    law = _read_law(machine, row, n, q)
    for j in range(n):
        row[law * n + j] = row[w * n + j]
    run_at(machine.torque, row, law * n, out * n)


@inlined
def braked(row: Numbers, n: int) -> None:
    """Raise friction torques to the minimum braking torque."""
    for j in range(n):
        least = row[at.BRAKING * n + j]
        if least > 0.0:
            row[at.TF * n + j] = max(row[at.TF * n + j], least)
        elif least < 0.0:
            row[at.TF * n + j] = min(row[at.TF * n + j], least)


@called
def set_levels(machine: at.Machine, row: Numbers, n: int, q: int) -> None:
    """Set the break-away levels of negative and of positive friction."""
    law = _read_law(machine, row, n, q)
    for j in range(n):
        row[law * n + j] = -1.0
    run_at(machine.limit, row, law * n, at.LOW * n)
    for j in range(n):
        row[law * n + j] = 1.0
    run_at(machine.limit, row, law * n, at.HIGH * n)


@called
def balance(machine: at.Machine, row: Numbers, n: int, q: int, w: int) -> None:
    """Set M, f, the friction of joints that slide as the row's stiction says, and its levels."""
    evaluate_dynamics(machine, row, n, q, w)
    sliding_torque(machine, row, n, q, w, at.DIRECTION, at.TF)
    braked(row, n)
    set_levels(machine, row, n, q)


@called
def below_break_away(row: Numbers, n: int, torque: int, j: int) -> bool:
    """Whether a friction torque of joint j is within its break-away levels."""
    return -row[at.LOW * n + j] < row[torque * n + j] < row[at.HIGH * n + j]


@called
def sticking_torque(row: Numbers, n: int, friction: int, candidates: int, out: int) -> None:
    """Friction that keeps the candidates from accelerating, see `dynamics.torque_balance`."""
    a, mobility = at.SPARE, at.mobility_of(n)
    for j in range(n):
        row[out * n + j] = row[at.F * n + j] - row[friction * n + j]
    constrained(row, n, out, candidates, a)
    for i in range(n):
        total = row[at.F * n + i]
        for j in range(n):
            total -= row[(at.M + i) * n + j] * row[a * n + j]
        clipped = min(max(total, -row[at.LOW * n + i]), row[at.HIGH * n + i])
        row[out * n + i] = clipped if row[candidates * n + i] != 0.0 else row[friction * n + i]
    inverse_of_free(row, n, at.M, at.NONE, mobility)
    for _ in range(_SWEEPS):
        moved = False
        for j in range(n):
            if row[candidates * n + j] != 0.0:
                total = 0.0
                for i in range(n):
                    total += row[(mobility + j) * n + i] * (row[at.F * n + i] - row[out * n + i])
                wanted = max(
                    row[out * n + j] + total / row[(mobility + j) * n + j], -row[at.LOW * n + j]
                )
                wanted = min(wanted, row[at.HIGH * n + j])
                moved = moved or abs(wanted - row[out * n + j]) > _SETTLED
                row[out * n + j] = wanted
        if not moved:
            break
