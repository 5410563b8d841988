"""Event-driven integration of all recordings at once: the motion under set-valued friction.

Between two events every joint keeps its mode and the right-hand side is smooth: it is integrated by
the classical Runge-Kutta method of order 4 with a fine fixed step. An event is a slipping velocity
that crosses zero, or a holding torque that leaves the break-away band. Its instant within a step is
found by a root search over the length of the step; the next mode follows from `next_modes`.
"""

from __future__ import annotations

import numpy as np

from frictionid.data.signals import Array
from frictionid.simulate.modes import TrueSystem, accelerations, margins, next_modes

# A joint that neither slips nor sticks, to within rounding, would change its mode endlessly: after
# this many events within one step (0.3 ms) the joints at rest stay at rest until its end.
_MAX_EVENTS = 12
_ITERATIONS = 80
_TOLERANCE = 1e-10


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
            system, y[:, over], u[over], mode[over], np.full(over.size, step)
        )
    return end, mode


def runge_kutta(system: TrueSystem, y: Array, u: Array, mode: Array, step: Array) -> Array:
    """State (3, R, n) after steps (R,) [s] in unchanged modes."""
    h = step[:, None]
    k1 = derivative(system, y, u, mode)
    k2 = derivative(system, y + (0.5 * h) * k1, u, mode)
    k3 = derivative(system, y + (0.5 * h) * k2, u, mode)
    k4 = derivative(system, y + h * k3, u, mode)
    end: Array = y + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
    return end


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
    system: TrueSystem, y: Array, u: Array, mode: Array, left: Array
) -> tuple[Array, Array]:
    """State and mode at the end of a step with events, `left` (R,) [s] later."""
    y, mode, left = y.copy(), mode.copy(), left.copy()
    at = np.arange(len(left))
    for _ in range(_MAX_EVENTS):
        end = runge_kutta(system, y[:, at], u[at], mode[at], left[at])
        over = (margins(system, end, u[at], mode[at]) < 0).any(axis=-1)
        y[:, at[~over]] = end[:, ~over]
        at = at[over]
        if not at.size:
            return y, mode
        used, y[:, at] = _first_event(system, y[:, at], u[at], mode[at], left[at], end[:, over])
        mode[at] = next_modes(system, y[:, at], u[at])
        left[at] -= used
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
    found, rows, side = end.copy(), np.arange(len(left)), np.zeros_like(left)
    for _ in range(_ITERATIONS):
        a, b, fa, fb = near[rows], far[rows], at_near[rows], at_far[rows]
        # a joint that has just begun to slip starts at zero, which would hide the later root
        part = np.where(fa > 0, fa / np.where(fa > 0, fa - fb, 1.0), 0.5)
        guess = a + part * (b - a)
        state = runge_kutta(system, y[:, rows], u[rows], mode[rows], guess * left[rows])
        f = _relative(system, state, u[rows], mode[rows], last[rows]) + 0.5 * _TOLERANCE
        ended = f < 0
        found[:, rows[ended]] = state[:, ended]
        near[rows], far[rows] = np.where(ended, a, guess), np.where(ended, guess, b)
        twice = np.where(side[rows] == np.where(ended, 1.0, -1.0), 0.5, 1.0)
        at_near[rows], at_far[rows] = np.where(ended, twice * fa, f), np.where(ended, f, twice * fb)
        side[rows] = np.where(ended, 1.0, -1.0)
        close = np.abs(f) < 0.5 * _TOLERANCE
        found[:, rows[close]], far[rows[close]] = state[:, close], guess[close]
        rows = rows[~close & (far[rows] - near[rows] > _TOLERANCE)]
        if not rows.size:
            break
    found[1] = np.where((mode != 0) & (mode * found[1] < 0), 0.0, found[1])
    return far * left, found


def _relative(system: TrueSystem, y: Array, u: Array, mode: Array, last: Array) -> Array:
    """Smallest of the margins that end negative (`last`), relative to their final size."""
    now = margins(system, y, u, mode)
    smallest: Array = np.where(last < 0, now / np.abs(last), np.inf).min(axis=-1)
    return smallest
