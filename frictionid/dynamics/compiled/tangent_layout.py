"""What the compiled tangent works on beside the step: more functions, more lines of the table."""

from __future__ import annotations

from typing import NamedTuple

from frictionid.dynamics.compiled import layout as at
from frictionid.programs.loops import inlined


class TangentMachine(NamedTuple):
    """A machine, and what its torques change with.

    slopes : address of a function of w, q, u, theta; Tf and its slopes by w, q, u and each of F
        parameters, n each
    limits : of the same; break-away levels and their slopes by each parameter, n each
    partials : of q, w, a, p; see `Partials`
    free : number of free friction parameters of a joint, F
    """

    machine: at.Machine
    slopes: int
    limits: int
    partials: int
    free: int


Q_MIDDLE, W_MIDDLE, A_MIDDLE, RESTING = range(4)  # lines behind those of the step
SLOPES = 4  # Tf, by w, by q, by u, by theta


@inlined
def extra_of(n: int, machine: at.Machine) -> int:
    """First line behind those of the step."""
    return at.end_of(n, machine)


@inlined
def limits_of(tangent: TangentMachine) -> int:
    """First line, behind `extra_of`, of break-away levels and their slopes."""
    return SLOPES + 4 + tangent.free


@inlined
def motion_of(tangent: TangentMachine) -> int:
    """First line of what the partial derivatives are of: q, w, a, p."""
    return limits_of(tangent) + 1 + tangent.free


@inlined
def partials_of(tangent: TangentMachine) -> int:
    """First line of the partial derivatives by q (n), w (n) and base parameters (nb)."""
    return motion_of(tangent) + 3 + tangent.machine.base_lines


@inlined
def crossing_of(n: int, tangent: TangentMachine) -> int:
    """First line of M at a crossing, (n, n)."""
    return partials_of(tangent) + 2 * n + tangent.machine.base


@inlined
def inverse_of(n: int, tangent: TangentMachine) -> int:
    """First line of M + dt/2 dT/dw, (n, n), and behind it of the inverse of its free part."""
    return crossing_of(n, tangent) + n


@inlined
def lines_of(n: int, tangent: TangentMachine) -> int:
    """Number of lines behind those of the step."""
    return inverse_of(n, tangent) + 2 * n
