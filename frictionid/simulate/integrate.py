"""Event-driven integration of all recordings at once: the motion under set-valued friction.

Between two events every joint keeps its mode and the right-hand side is smooth: it is integrated by
the classical Runge-Kutta method of order 4 with a fine fixed step. An event is a slipping velocity
that crosses zero, or a holding torque that leaves the break-away band. Its instant within a step is
found by a root search over the length of the step; the next mode follows from `next_modes`:

M dw/dt = h + B u - Tf,   Tf in the break-away band where w = 0

A mode has one entry per joint: +1 or -1 slips that way, 0 sticks. Arrays have a leading axis of
recordings, shape (R, n).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from frictionid.arrays import solve
from frictionid.data.signals import Array
from frictionid.mechanics import Mechanism

from .true_friction import LoadFriction, TrueFriction

# A joint that neither slips nor sticks, to within rounding, would change its mode endlessly: after
# this many events within one step (0.3 ms) the joints at rest stay at rest until its end.
_MAX_EVENTS = 12
_ITERATIONS = 80
_TOLERANCE = 1e-10


@dataclass(frozen=True)
class TrueSystem:
    """A mechanism with its true base parameters p, shape (nb,), and its true friction.

    parameters : the true physical ones, which bearing forces need
    """

    mechanism: Mechanism
    p: Array
    friction: TrueFriction
    parameters: Mapping[str, float] = field(default_factory=dict)

    def combinations(self, rests: NDArray[np.bool_]) -> Array:
        """All modes (C, n) of the joints that rest (n,), zero elsewhere.

        C = 3^k of k such joints, or 2^k without stick; sticking first: it wins ties.
        """
        each = (0.0, 1.0, -1.0) if self.friction.sticks else (1.0, -1.0)
        choices = [each if rest else (0.0,) for rest in rests]
        return np.array(list(product(*choices)))

    def torque(self, y: Array, u: Array, mode: Array, w: Array | None = None) -> Array:
        """Friction torque (..., n) [N m] in a mode at states y (3, R, n) under motor torques u.

        w : (..., n), velocities of the joints in place of those of y, under the same load
        """
        w = y[1] if w is None else w
        Tf = self.friction.torque(w, y[2], mode)
        if not isinstance(self.friction, LoadFriction):
            return Tf
        moment, total = -self.friction.moment * np.sin(y[0]), 0.0 * Tf
        for _ in range(_ITERATIONS):  # a gear's load is what friction leaves of the motor torque
            bearing = self.mechanism.load(self.parameters, y[0], y[1], u - total)
            before, level = total, self.friction.loaded_level(w, bearing, u, moment)
            total = Tf + mode * level
            if not self.mechanism.loads_of_gears or np.abs(total - before).max() < _TOLERANCE:
                break
        return total


def accelerations(M: Array, f: Array, Tf: Array, slips: NDArray[np.bool_]) -> Array:
    """dw/dt of slipping joints while the others stick, shape (..., n) [rad/s^2].

    Rows and columns of sticking joints are replaced by those of the identity, so that their
    acceleration is exactly zero; their holding torque is f - M dw/dt.

    Parameters
    ----------
    M : array, shape (..., n, n) [kg m^2]
    f, Tf : array, shape (..., n) [N m]
        All torques but friction, and friction of the slipping joints.
    slips : array of bool, shape (..., n)

    Examples
    --------
    >>> M, f = np.array([[2.0, 1.0], [1.0, 1.0]]), np.array([3.0, 0.5])
    >>> accelerations(M, f, 0.0 * f, np.array([True, False]))
    array([1.5, 0. ])
    """
    if slips.all():
        return solve(M, f - Tf)
    both = slips[..., :, None] & slips[..., None, :]
    return solve(np.where(both, M, np.eye(M.shape[-1])), np.where(slips, f - Tf, 0.0))


def margins(system: TrueSystem, y: Array, u: Array, mode: Array) -> Array:
    """Margin of each joint before its mode ends, negative where it has ended; shape (R, n).

    The velocity in the direction of slip [rad/s], or for a sticking joint the distance of its
    holding torque to the break-away level [N m].

    Parameters
    ----------
    y : array, shape (3, R, n)
        Angles, velocities and friction memory.
    u : array, shape (R, n) [N m]
    mode : array, shape (R, n)
    """
    margin: Array = mode * y[1]
    sticks = (mode == 0).any(axis=-1)
    if sticks.any():
        held = _held(system, y[:, sticks], u[sticks], mode[sticks])[2]
        margin[sticks] = np.where(mode[sticks] == 0, held, margin[sticks])
    return margin


def next_modes(system: TrueSystem, y: Array, u: Array) -> Array:
    """Consistent modes at a state, shape (R, n).

    A moving joint slips in its direction. For joints at rest all combinations of sticking and
    slipping are tried: a joint may stick if its holding torque lies within the break-away band, and
    slip only in the direction of its acceleration. Apart from ties exactly one combination is
    consistent, because M is positive definite and break-away equals the level at the onset of slip.
    With rounding, the combination with the smallest violation is taken.

    Parameters
    ----------
    y : array, shape (3, R, n)
    u : array, shape (R, n) [N m]
    """
    w = y[1]
    rests = w == 0
    mode = np.where(rests, system.combinations(rests.any(axis=0))[:, None, :], np.sign(w))
    M, a, held = _held(system, y, u, mode)
    sticking = -held
    # both violations as torques
    slipping = -mode * a * np.diagonal(M, axis1=-2, axis2=-1)
    wrong = np.where(rests, np.where(mode == 0, sticking, slipping), 0.0)
    best = np.maximum(wrong, 0.0).max(axis=-1).argmin(axis=0)
    return mode[best, np.arange(len(best))]


def _held(system: TrueSystem, y: Array, u: Array, mode: Array) -> tuple[Array, Array, Array]:
    """Inertia matrix, accelerations, and how far within its band a torque that holds lies."""
    M, h = system.mechanism.dynamics(system.p, y[0], y[1])
    f = h + u
    a = accelerations(M, f, system.torque(y, u, mode), mode != 0)
    return M, a, _within(system, y, u, f - (M * a[..., None, :]).sum(-1))


def _within(system: TrueSystem, y: Array, u: Array, hold: Array) -> Array:
    """Distance of a holding torque to the nearer end of the break-away band, negative outside."""
    rest, forward = np.zeros_like(y[1]), np.ones_like(y[1])
    upper = system.torque(y, u, forward, rest)
    lower = system.torque(y, u, -forward, rest)
    return np.minimum(upper - hold, hold - lower)


def integrate_motion(
    system: TrueSystem, q: Array, w: Array, u: Array, edges: Array, step: float
) -> Array:
    """States at the edges of intervals with constant torques, shape (K+1, 3, R, n).

    Parameters
    ----------
    system : TrueSystem
    q, w : array, shape (R, n) [rad], [rad/s]
        Initial states of R recordings; friction memory starts in its steady state.
    u : array, shape (K, R, n) [N m]
        Torque on each joint in each interval.
    edges : array, shape (K+1,) [s], increasing
    step : float [s]
        Longest step of the integration.

    Returns
    -------
    array, shape (K+1, 3, R, n)
        Angles, velocities and friction memory; a sticking joint has exactly w = 0.

    Examples
    --------
    >>> from frictionid.mechanics import pendulum
    >>> from frictionid.simulate.true_friction import Curve, Stribeck
    >>> m = pendulum()
    >>> system = TrueSystem(m, m.base({}), Stribeck(Curve((2.0,), (2.0,), (0.0,))))
    >>> start, edges = np.array([[0.1], [1.5]]), np.array([0.0, 0.1])  # held, and falling
    >>> end = integrate_motion(system, start, 0 * start, np.zeros((1, 2, 1)), edges, 1e-3)[-1]
    >>> end[0].round(3).ravel(), end[1].round(3).ravel()
    (array([0.1 , 1.461]), array([ 0.   , -0.777]))
    """
    y = np.stack([q, w, system.friction.start(w)]).astype(float)
    states, mode = [y], next_modes(system, y, u[0])
    for k, width in enumerate(np.diff(edges)):
        count = max(1, int(np.ceil(width / step - 1e-9)))
        mode = modes_after_jump(system, y, u[k], mode)
        for _ in range(count):
            y, mode = advance(system, y, u[k], mode, width / count)
        states.append(y)
    return np.stack(states)


def modes_after_jump(system: TrueSystem, y: Array, u: Array, mode: Array) -> Array:
    """Modes (R, n) after a jump of the torque, which may end some of them."""
    left = (margins(system, y, u, mode) < 0).any(axis=-1)
    if left.any():
        mode = mode.copy()
        mode[left] = next_modes(system, y[:, left], u[left])
    return mode


def advance(
    system: TrueSystem, y: Array, u: Array, mode: Array, step: float
) -> tuple[Array, Array]:
    """State (3, R, n) and mode (R, n) one step later, through all events within it."""
    end = runge_kutta(system, y, u, mode, np.full(y.shape[1], step))
    over = np.flatnonzero((margins(system, end, u, mode) < 0).any(axis=-1))
    if over.size:
        mode = mode.copy()
        end[:, over], mode[over] = _through_events(
            system, y[:, over], u[over], mode[over], np.full(over.size, step), end[:, over]
        )
    return end, mode


def runge_kutta(system: TrueSystem, y: Array, u: Array, mode: Array, step: Array) -> Array:
    """State (3, R, n) after steps (R,) [s] in unchanged modes."""
    h = step[:, None]
    k1 = derivative(system, y, u, mode)
    k2 = derivative(system, y + (0.5 * h) * k1, u, mode)
    k3 = derivative(system, y + (0.5 * h) * k2, u, mode)
    k4 = derivative(system, y + h * k3, u, mode)
    return y + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)


def derivative(system: TrueSystem, y: Array, u: Array, mode: Array) -> Array:
    """d/dt of angles, velocities and friction memory in a mode, shape (3, R, n)."""
    q, w, z = y
    M, h = system.mechanism.dynamics(system.p, q, w)
    Tf = system.torque(y, u, mode)
    a = accelerations(M, h + u, Tf, mode != 0)
    out = np.empty_like(y)
    out[0], out[1], out[2] = w, a, system.friction.rate(w, z, mode)
    return out


def _through_events(
    system: TrueSystem, y: Array, u: Array, mode: Array, left: Array, end: Array
) -> tuple[Array, Array]:
    """State and mode after a step with events, `left` (R,) [s] later; `end`, were there none."""
    y, mode, left = y.copy(), mode.copy(), left.copy()
    at = np.arange(len(left))
    for _ in range(_MAX_EVENTS):
        over = (margins(system, end, u[at], mode[at]) < 0).any(axis=-1)
        y[:, at[~over]] = end[:, ~over]
        at = at[over]
        if not at.size:
            return y, mode
        used, y[:, at] = _first_event(system, y[:, at], u[at], mode[at], left[at], end[:, over])
        mode[at] = next_modes(system, y[:, at], u[at])
        left[at] -= used
        end = runge_kutta(system, y[:, at], u[at], mode[at], left[at])
    y[:, at] = runge_kutta(system, y[:, at], u[at], np.sign(y[1, at]), left[at])
    mode[at] = next_modes(system, y[:, at], u[at])
    return y, mode


def _first_event(
    system: TrueSystem, y: Array, u: Array, mode: Array, left: Array, end: Array
) -> tuple[Array, Array]:
    """Time (R,) [s] at which the first mode has just ended, and the state there.

    Regula falsi (Illinois) on the margin between the start, where it is positive, and the end,
    where it is negative. The target is half the tolerance behind the root: the mode has ended.
    """
    last = margins(system, end, u, mode)
    near, far = np.zeros_like(left), np.ones_like(left)
    at_near, at_far = _relative(system, y, u, mode, last), -np.ones_like(left)
    state_there, rows, side = end.copy(), np.arange(len(left)), np.zeros_like(left)
    for _ in range(_ITERATIONS):
        a, b, fa, fb = near[rows], far[rows], at_near[rows], at_far[rows]
        # a joint that has just begun to slip starts at zero, which would hide the later root
        part = np.where(fa > 0, fa / np.where(fa > 0, fa - fb, 1.0), 0.5)
        guess = a + part * (b - a)
        state = runge_kutta(system, y[:, rows], u[rows], mode[rows], guess * left[rows])
        f = _relative(system, state, u[rows], mode[rows], last[rows]) + 0.5 * _TOLERANCE
        ended = f < 0
        state_there[:, rows[ended]] = state[:, ended]
        near[rows], far[rows] = np.where(ended, a, guess), np.where(ended, guess, b)
        twice = np.where(side[rows] == np.where(ended, 1.0, -1.0), 0.5, 1.0)
        at_near[rows], at_far[rows] = np.where(ended, twice * fa, f), np.where(ended, f, twice * fb)
        side[rows] = np.where(ended, 1.0, -1.0)
        close = np.abs(f) < 0.5 * _TOLERANCE
        state_there[:, rows[close]], far[rows[close]] = state[:, close], guess[close]
        rows = rows[~close & (far[rows] - near[rows] > _TOLERANCE)]
        if not rows.size:
            break
    w = state_there[1]
    state_there[1] = np.where((mode != 0) & (mode * w < 0), 0.0, w)
    return far * left, state_there


def _relative(system: TrueSystem, y: Array, u: Array, mode: Array, last: Array) -> Array:
    """Smallest of the margins that end negative (`last`), relative to their final size."""
    now = margins(system, y, u, mode)
    return np.where(last < 0, now / np.abs(last), np.inf).min(axis=-1)
