"""The variational equation of one row as machine code, see `variational_equation`."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.compiled import layout as at
from frictionid.dynamics.compiled import tangent_layout as more
from frictionid.dynamics.compiled.tangent_layout import TangentMachine
from frictionid.dynamics.compiled.torque_balance import (
    constrained,
    evaluate_dynamics,
    inverse_of_free,
)
from frictionid.programs.loops import Numbers, called, run_at

_GRAZE = 0.1  # of a slow speed


@called
def advance_tangent(
    tangent: TangentMachine,
    row: Numbers,
    n: int,
    T: Numbers,
    D: int,
    spare: Numbers,
    free: Array,
    base: Array,
    by: Array,
    h: float,
    crossed: bool,
) -> None:
    """Advance derivatives T (2n, D) over the substep of h [s] that the row has just made.

    spare : (3n, D); free (F, 2): joint of free friction parameters, and which of
    those with slopes they are; base: places of base
    parameters; by (E, n): derivatives of the motor torque
    """
    for j in range(n):
        if row[at.STICKING * n + j] != 0.0:
            for d in range(D):
                T[(n + j) * D + d] = 0.0
    if crossed:
        _keep_start(tangent, row, n, T, D, spare)
    _set_slopes(tangent, row, n, h)
    for j in range(n):
        for d in range(D):
            T[j * D + d] += h / 2 * T[(n + j) * D + d]
    _set_torque_change(tangent, row, n, T, D, spare, free, base, by)
    A = more.extra_of(n, tangent.machine) + more.inverse_of(n, tangent) + n
    for i in range(n):
        for j in range(n):
            factor = h * row[(A + i) * n + j]
            for d in range(D):
                T[(n + i) * D + d] -= factor * spare[j * D + d]
        for d in range(D):
            T[i * D + d] += h / 2 * T[(n + i) * D + d]
    if crossed:
        _cross(tangent, row, n, T, D, spare, h)


@called
def _keep_start(
    tangent: TangentMachine, row: Numbers, n: int, T: Numbers, D: int, spare: Numbers
) -> None:
    """Keep M of a crossing, and the derivatives of the velocities before it."""
    crossing = more.extra_of(n, tangent.machine) + more.crossing_of(n, tangent)
    for i in range(n):
        for j in range(n):
            row[(crossing + i) * n + j] = row[(at.M + i) * n + j]
        for d in range(D):
            spare[(n + i) * D + d] = T[(n + i) * D + d]


@called
def _set_slopes(tangent: TangentMachine, row: Numbers, n: int, h: float) -> None:
    """Set the derivatives of the torques in the middle of the substep, and what they divide by."""
    machine = tangent.machine
    extra = more.extra_of(n, machine)
    q, w, a = extra + more.Q_MIDDLE, extra + more.W_MIDDLE, extra + more.A_MIDDLE
    for j in range(n):
        w0, w1 = row[at.W_BEFORE * n + j], row[at.W * n + j]
        row[q * n + j] = (row[at.Q_BEFORE * n + j] + row[at.Q * n + j]) / 2 + (w0 - w1) * h / 8
        row[w * n + j] = (w0 + w1) / 2
    evaluate_dynamics(machine, row, n, q, w)
    _set_friction_slopes(tangent, row, n, q, w)
    for j in range(n):
        row[at.SPARE * n + j] = row[at.F * n + j] - row[(extra + more.SLOPES) * n + j]
    constrained(row, n, at.SPARE, at.STICKING, a)
    _evaluate_partials(tangent, row, n, q, w, a)
    partials = extra + more.partials_of(tangent)
    for j in range(n):
        row[(partials + n + j) * n + j] += row[(extra + more.SLOPES + 1) * n + j]
        row[(partials + j) * n + j] += row[(extra + more.SLOPES + 2) * n + j]
    inner = extra + more.inverse_of(n, tangent)
    for i in range(n):
        for j in range(n):
            row[(inner + i) * n + j] = (
                row[(at.M + i) * n + j] + h / 2 * row[(partials + n + i) * n + j]
            )
    inverse_of_free(row, n, inner, at.STICKING, inner + n)


@called
def _evaluate_partials(
    tangent: TangentMachine, row: Numbers, n: int, q: int, w: int, a: int
) -> None:
    """Set the partial derivatives of M a - h; lines of zeros: -1."""
    base = tangent.machine.base
    extra, motion = more.extra_of(n, tangent.machine), at.motion_of(n)
    own = extra + more.motion_of(tangent)
    for j in range(n):
        row[own * n + j] = row[q * n + j]
        row[(own + 1) * n + j] = row[w * n + j] if w >= 0 else 0.0
        row[(own + 2) * n + j] = row[a * n + j] if a >= 0 else 0.0
    for k in range(base):
        row[(own + 3) * n + k] = row[(motion + 2) * n + k]
    run_at(tangent.partials, row, own * n, (extra + more.partials_of(tangent)) * n)


@called
def _set_friction_slopes(tangent: TangentMachine, row: Numbers, n: int, q: int, w: int) -> None:
    """Set the friction torques at a state and their slopes, of joints that slide to their side."""
    machine = tangent.machine
    law, slopes = at.law_of(n, machine), more.extra_of(n, machine) + more.SLOPES
    for j in range(n):
        side, speed = row[at.DIRECTION * n + j], row[w * n + j]
        if machine.breaks and machine.beyond > 0.0 and side != 0.0:
            speed = side * max(side * speed, machine.beyond)
        row[law * n + j] = speed
        row[(law + 1) * n + j] = row[q * n + j]
        row[(law + 2) * n + j] = row[at.U * n + j]
    run_at(tangent.slopes, row, law * n, slopes * n)
    for j in range(n):
        if row[law * n + j] != row[w * n + j]:  # evaluated at the side of its smoothing
            row[(slopes + 1) * n + j] = 0.0
    brakes = False
    for j in range(n):
        brakes = brakes or row[at.BRAKING * n + j] != 0.0
    if brakes:
        _set_break_away_slopes(tangent, row, n, law, slopes)


@called
def _set_break_away_slopes(
    tangent: TangentMachine, row: Numbers, n: int, law: int, slopes: int
) -> None:
    """The same of friction that is at its break-away level, whatever w is."""
    limits = more.extra_of(n, tangent.machine) + more.limits_of(tangent)
    for j in range(n):
        row[law * n + j] = row[at.BRAKING * n + j] if row[at.BRAKING * n + j] != 0.0 else 1.0
    run_at(tangent.limits, row, law * n, limits * n)
    for j in range(n):
        least, own = row[at.BRAKING * n + j], row[slopes * n + j]
        if (least > 0.0 and own < least) or (least < 0.0 and own > least):
            row[slopes * n + j] = least
            row[(slopes + 1) * n + j] = row[(slopes + 2) * n + j] = row[(slopes + 3) * n + j] = 0.0
            for k in range(tangent.free):
                row[(slopes + 4 + k) * n + j] = np.sign(least) * row[(limits + 1 + k) * n + j]


@called
def _set_torque_change(
    tangent: TangentMachine,
    row: Numbers,
    n: int,
    T: Numbers,
    D: int,
    change: Numbers,
    free: Array,
    base: Array,
    by: Array,
) -> None:
    """Set derivatives (n, D) of the joints' torques at constant a."""
    D = D
    extra = more.extra_of(n, tangent.machine)
    slopes, partials = extra + more.SLOPES, extra + more.partials_of(tangent)
    for i in range(n):
        for d in range(D):
            change[i * D + d] = 0.0
        for j in range(n):
            by_q, by_w = row[(partials + i) * n + j], row[(partials + n + i) * n + j]
            for d in range(D):
                change[i * D + d] += by_q * T[j * D + d] + by_w * T[(n + j) * D + d]
    first = 2 * n
    for k in range(len(free)):
        joint = free[k, 0]
        change[joint * D + first + k] += row[(slopes + 4 + free[k, 1]) * n + joint]
    first += len(free)
    for k in range(len(base)):
        for i in range(n):
            entry = i * tangent.machine.base + base[k]
            change[i * D + first + k] += row[(partials + 2 * n) * n + entry]
    first += len(base)
    for k in range(len(by)):
        for i in range(n):
            share = row[(slopes + 3) * n + i] - row[at.MOTORS * n + i]
            change[i * D + first + k] += share * by[k, i]


@called
def _cross(
    tangent: TangentMachine, row: Numbers, n: int, T: Numbers, D: int, spare: Numbers, h: float
) -> None:
    """Change the derivatives where joints cross w = 0, see `crossing_tangent`."""
    D = D
    stops, passes = False, False
    for d in range(D):
        spare[0 * D + d] = 0.0
    for j in range(n):
        stops = stops or row[at.STOPS * n + j] != 0.0
        passes = passes or row[at.PASSES * n + j] != 0.0
        share = h / 2 if row[at.STOPS * n + j] != 0.0 else 0.0
        # minus the derivative of the time since the crossing; bounded where w = 0 is just met
        w0, w1 = row[at.W_BEFORE * n + j], row[at.W_END * n + j]
        part = h / max((w0 - w1) ** 2, (_GRAZE * row[at.SLOW * n + j]) ** 2)
        part = part if row[at.PASSES * n + j] != 0.0 else 0.0
        for d in range(D):
            T[j * D + d] -= share * T[(n + j) * D + d]
            spare[0 * D + d] += part * (w0 * T[(n + j) * D + d] - w1 * spare[(n + j) * D + d])
    if passes:
        for i in range(n):
            for d in range(D):
                T[(n + i) * D + d] -= row[at.JUMP * n + i] * spare[0 * D + d]
    if stops:
        _hand_on(tangent, row, n, T, D, spare)


@called
def _hand_on(
    tangent: TangentMachine, row: Numbers, n: int, T: Numbers, D: int, spare: Numbers
) -> None:
    """A joint that stops hands its momentum on."""
    D = D
    M = more.extra_of(n, tangent.machine) + more.crossing_of(n, tangent)
    inverse = at.inverse_of(n)
    inverse_of_free(row, n, M, at.HELD, inverse)
    for i in range(n):
        for d in range(D):
            spare[i * D + d] = 0.0
        for j in range(n):
            kept = 0.0
            for k in range(n):
                kept += row[(inverse + i) * n + k] * row[(M + k) * n + j]
            for d in range(D):
                spare[i * D + d] += kept * T[(n + j) * D + d]
    for i in range(n):
        for d in range(D):
            T[(n + i) * D + d] = spare[i * D + d]


@called
def displace(
    tangent: TangentMachine,
    row: Numbers,
    n: int,
    T: Numbers,
    D: int,
    base: Array,
    moment: Array,
    moment_by: Array,
) -> None:
    """Displace the state by M^-1 moment, for the torque's variation about its mean in a substep."""
    extra = more.extra_of(n, tangent.machine)
    resting, way, inverse = extra + more.RESTING, extra + more.A_MIDDLE, at.inverse_of(n)
    for j in range(n):
        row[resting * n + j] = 1.0 if row[at.W * n + j] == 0.0 else 0.0
    evaluate_dynamics(tangent.machine, row, n, at.Q, at.W)
    inverse_of_free(row, n, at.M, resting, inverse)
    first = D - len(moment_by)
    for i in range(n):
        row[way * n + i] = 0.0
        for j in range(n):
            row[way * n + i] += row[(inverse + i) * n + j] * moment[j]
            for k in range(len(moment_by)):
                T[i * D + first + k] += row[(inverse + i) * n + j] * moment_by[k, j]
    if len(base):
        # M displacement = moment, and M is linear in the base parameters
        _base_moves(tangent, row, n, T, D, base, first - len(base), way, 1.0)
        _base_moves(tangent, row, n, T, D, base, first - len(base), -1, -1.0)
    for j in range(n):
        row[at.Q * n + j] += row[way * n + j]


@called
def _base_moves(
    tangent: TangentMachine,
    row: Numbers,
    n: int,
    T: Numbers,
    D: int,
    base: Array,
    first: int,
    a: int,
    sign: float,
) -> None:
    """Change of the angles' derivatives by base parameters, with accelerations in a line."""
    partials = more.extra_of(n, tangent.machine) + more.partials_of(tangent) + 2 * n
    inverse = at.inverse_of(n)
    _evaluate_partials(tangent, row, n, at.Q, -1, a)
    for k in range(len(base)):
        for i in range(n):
            for j in range(n):
                entry = j * tangent.machine.base + base[k]
                by = row[partials * n + entry]
                T[i * D + first + k] -= sign * row[(inverse + i) * n + j] * by
