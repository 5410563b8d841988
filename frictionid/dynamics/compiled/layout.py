"""Where the numbers of one row stand: a table (R, n), a line for each quantity of the joints.

One table costs nothing to hand on; many arrays would cost more than the arithmetic. Truths are
ones and zeros. Functions of a machine read and write parts of the table as it lies in memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.loops import Numbers, called, inlined


class Machine(NamedTuple):
    """A mechanism and its friction for the compiled step.

    dynamics : of q, w, p; M (n, n) and h (n)
    torque : of w, q, u, theta (n, P); Tf (n) of joints that slide
    limit : of the same; break-away levels (n) in the direction of w
    breaks : whether the law has a break-away level
    sharp : whether its smoothing only stands for a step at w = 0
    beyond : [rad/s], the speed beyond which a smoothed law is evaluated; 0: as it is
    base, theta : numbers of base parameters and of friction parameters nP
    base_lines, theta_lines : numbers of lines that hold them
    """

    dynamics: int
    torque: int
    limit: int
    breaks: bool
    sharp: bool
    beyond: float
    base: int
    theta: int
    base_lines: int
    theta_lines: int


Q, W, U, MOTORS, SLOW = range(5)  # state, motor torque; which joints have a motor; slow speeds
F, TF, LOW, HIGH = range(5, 9)  # see `torque_balance.Balance`
DIRECTION, BRAKING, MARGIN, STICKING, FIRM = range(9, 14)  # see `sliding_friction.Stiction`
ACCELERATION, Q_BEFORE, W_BEFORE, W_END = range(14, 18)  # where a substep begins, and RK4's end
STOPS, PASSES, HELD, SHARE, JUMP = range(18, 23)  # see `zero_crossing.Crossing`
SINCE = 23  # friction since a crossing
SPARE = 24  # and 10 more, for a while
NONE = -1  # no line
M = 35  # n lines, h in the line behind them; then come all that have several lines


@inlined
def inverse_of(n: int) -> int:
    """First line of the inverse of what is free of M, (n, n)."""
    return M + n + 1


@inlined
def mobility_of(n: int) -> int:
    """First line of the inverse of M, (n, n)."""
    return M + 2 * n + 1


@inlined
def left_of(n: int) -> int:
    """First line of a matrix (n, n), for a while."""
    return M + 3 * n + 1


@inlined
def motion_of(n: int) -> int:
    """First line of what the mechanism's functions read: q, w, p."""
    return M + 4 * n + 1


@inlined
def law_of(n: int, machine: Machine) -> int:
    """First line of what the law's functions read: w, q, u, theta."""
    return motion_of(n) + 2 + machine.base_lines


@inlined
def end_of(n: int, machine: Machine) -> int:
    """First line behind all these."""
    return law_of(n, machine) + 3 + machine.theta_lines


@called
def new_row(machine: Machine, motors: Array, slow: Array, more: int) -> Array:
    """Numbers of a row, with so many more lines, and nothing but what all rows share."""
    n = len(motors)
    row = np.zeros((end_of(n, machine) + more) * n)
    for j in range(n):
        row[MOTORS * n + j] = motors[j]
        row[SLOW * n + j] = slow[j]
    return row


@called
def set_parameters(machine: Machine, row: Numbers, n: int, p: Array, theta: Array) -> None:
    """Set the parameters of a row: p (nb), theta (nP)."""
    first = (motion_of(n) + 2) * n
    for k in range(len(p)):
        row[first + k] = p[k]
    first = (law_of(n, machine) + 3) * n
    for k in range(len(theta)):
        row[first + k] = theta[k]


@called
def set_state(row: Numbers, n: int, q: Array, w: Array, u: Array) -> None:
    """Set state and motor torque of a row."""
    for j in range(n):
        row[Q * n + j] = q[j]
        row[W * n + j] = w[j]
        row[U * n + j] = u[j]
