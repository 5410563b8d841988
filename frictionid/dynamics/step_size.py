"""How a step is divided: by friction and feedback, and further where a joint comes near rest."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, like, plain
from frictionid.errors import NoFitError
from frictionid.friction import Friction, Inputs, at_rest
from frictionid.friction.coordinates import at_places, mobility, turns_of
from frictionid.mechanics import Plant, configurations
from frictionid.mechanics.plant import SLOW

from .torque_balance import has_break_away, is_sharp

_STABLE = 2.0  # RK4 is stable up to 2.78 / rate
_RESOLVED = 0.25  # [rad] of a feedback's oscillation, to 1e-5 of its amplitude per substep
_LONGEST = 0.005  # [s], resolves 30 rad/s of motion to 1e-7 rad per substep
_FINE = 0.0007  # [s], near rest: joints lose some 0.05 rad/s in it
_FASTEST = 2e5  # [1/s], 1700 substeps in a sample of 1/60 s


class StepSize(NamedTuple):
    """How a step is divided: into pieces, and those near rest into at most some parts, 2^k."""

    pieces: int
    parts: int


def step_size_of(
    plant: Plant, friction: Friction, dt: float, *, longest: float = _LONGEST
) -> StepSize:
    """Pieces of a step of dt [s], and their substeps near rest.

    The slope of friction through w = 0 limits the substeps of laws with bristles, whose break-away
    level is zero. Other laws hold a joint there, or let it pass, whatever their slope.

    Raises
    ------
    NoFitError
        When the law is so steep that no reasonable number of substeps resolves it.
    """
    sliding = (
        replace(friction, law=friction.law.sharpened()) if is_sharp(friction.law) else friction
    )
    away = stiffness(plant, sliding, plant.slow_like(np.zeros(plant.parts)))
    near = away if has_break_away(friction) else stiffness(plant, friction)
    rate = max(away, near)
    if rate > _FASTEST:
        raise NoFitError(
            f"{friction.law}: a slope of {slopes(friction).max():.3g} N m s/rad slows a joint down "
            f"in {1 / rate:.1g} s and needs {np.ceil(dt * rate / _STABLE):.0f} substeps in "
            f"{dt:.3g} s: widen the law's smoothing, or check its parameters"
        )
    longest = min(longest, friction.law.longest_substep)
    loop = dt * feedback_rate(plant) / _RESOLVED
    pieces = int(np.ceil(max(dt / longest, dt * away / _STABLE, loop, 1.0)))
    part = dt / pieces
    return StepSize(pieces, halved(max(part / _FINE, part * near / _STABLE)))


def halved(count: float) -> int:
    """Number of equal parts, no less than a count, that halving gives.

    >>> halved(0.3), halved(5.0), halved(8.0)
    (1, 8, 8)
    """
    return 1 << max(0, int(np.ceil(np.log2(count))))


def stiffness(plant: Plant, friction: Friction, beyond: Array | float = 0.0) -> float:
    """Fastest rate [1/s] at which friction slows a joint: largest eigenvalue of W dTf/dw.

    W = A M^-1 A' is the mobility of the parts.

    The worst case over `configurations` and over the batches of plant and friction, at
    speeds `beyond` some, (n,) [rad/s]; where friction grows with the load or the motor torque,
    under those that hold the joints still.
    """
    q, p, W = _mobilities(plant)
    root = np.sqrt(slopes(friction, beyond, *_holding(plant, friction, p, q)))
    return float(np.linalg.eigvalsh(root[:, None] * W * root).max())


def feedback_rate(plant: Plant) -> float:
    """Fastest rate [rad/s] of a plant's feedback: (K/M)^.5 of stiffness, B/(4 M) of damping.

    Damping needs no finer steps: what it lets decay does not last.
    """
    if plant.feedback is None:
        return 0.0
    n = plant.n
    most = np.maximum(plain(plant.feedback).reshape(-1, 2, n).max(axis=0), 0.0)
    W = _mobilities(plant)[2][..., :n, :n]
    roots = np.sqrt(most * plant.mechanism.motors)
    K, B = (np.linalg.eigvalsh(root[:, None] * W * root).max() for root in roots)
    return float(max(np.sqrt(K), B / 4))


def _mobilities(plant: Plant) -> tuple[Array, Array, Array]:
    """Angles q (C, n), all different base parameters p (B, nb), and mobilities (B, C, m, m)."""
    q, mechanism = configurations(plant.n, 9), plant.mechanism
    p = np.unique(plain(plant.p).reshape(-1, plant.p.shape[-1]), axis=0)
    return q, p, mobility(mechanism.inertia(p[:, None], q), turns_of(mechanism, q))


def _holding(plant: Plant, friction: Friction, p: Array, q: Array) -> tuple[Array, Array]:
    """Largest motor torque (m,) that holds machines p (B, nb) at angles q (C, n), and its load."""
    u = np.abs(plant.mechanism.dynamics(p[:, None], q, 0.0 * q)[1]).max(axis=(0, 1))
    load = 0.0 * u
    if friction.law.uses_load:
        batch = plant.p.ndim - 1
        machine = plant[(0,) * batch] if batch else plant
        load = plain(machine.load(q, 0.0 * q, 0.0 * q)).max(axis=0)
    x = at_places(plant.mechanism, Inputs(load, load, u, load))
    return x.u, x.load


def slopes(
    friction: Friction,
    beyond: Array | float = 0.0,
    u: Array | float = 0.0,
    load: Array | float = 0.0,
) -> Array:
    """Largest slope dTf/dw of each joint over all batches, or zero, shape (n,) [N m s/rad].

    At speeds `beyond` some, (n,) [rad/s], with motor torques 0, u, -u, and a load, (n,) each.
    """
    low = np.broadcast_to(beyond, (friction.n,))
    w = np.concatenate([[0.0], np.logspace(-4, 1.5, 45)])[:, None]
    w = np.maximum(np.where(low > 0, w * low / SLOW, w), low)
    theta = _distinct(friction.theta)[..., None, :, :]
    width = np.where(low > 0, 1e-5 * low / SLOW, 1e-5)
    grid = np.concatenate([-w[::-1], w])

    def torque(w: Array, u: Array | float) -> Array:
        columns, pushed, loads = (like(v, theta) for v in (w, u + 0.0 * w, load + 0.0 * w))
        x = at_rest(columns)._replace(u=pushed, load=loads)
        return plain(friction.law.torque(theta, x, friction.law.start(theta, x)))

    most = np.zeros(friction.n)
    for push in (0.0, u, -u) if np.any(u) else (0.0,):
        rise = (torque(grid + width, push) - torque(grid - width, push)) / (2 * width)
        most = np.maximum(most, rise.reshape(-1, friction.n).max(axis=0))
    return most


def _distinct(theta: Array) -> Array:
    """Parameters (..., n, P) without repetitions: predictions from many states share a few."""
    if theta.ndim < 3 or not isinstance(theta, np.ndarray):
        return theta
    return np.unique(theta.reshape(math.prod(theta.shape[:-2]), *theta.shape[-2:]), axis=0)
