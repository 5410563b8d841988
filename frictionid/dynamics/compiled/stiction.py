"""Which joints of one row stick at w = 0, see `dynamics.stiction`."""

from __future__ import annotations

import numpy as np

from frictionid.dynamics.compiled import layout as at
from frictionid.dynamics.compiled.torque_balance import (
    below_break_away,
    braked,
    evaluate_dynamics,
    set_levels,
    sliding_torque,
    smooth_torque,
    sticking_torque,
)
from frictionid.programs.loops import Numbers, called

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
