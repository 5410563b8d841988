"""Periodic trajectories for a position controller, from which friction of all joints is known well.

    q = offset + sum_k (sines[k] sin(k W t) - cosines[k] cos(k W t)) / (k W)     [Swevers1997]

Each begins and ends at rest. The torques of the motion are linear in friction, base parameters and
offsets; with the noise of the torques that gives their expected standard errors. The search wants
the worst known friction parameter to be known as well as possible, relative to its prior value.
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from frictionid.arrays import Array, times
from frictionid.config import Count, Positive, validated
from frictionid.errors import InputError
from frictionid.friction import Friction, at_rest
from frictionid.mechanics import Plant
from frictionid.progress import Done, say_nothing
from frictionid.simulate.torques import Fourier

from .experiment import Limits

WINDOW = 0.05  # [s], over which a torque is averaged: as long as a window of inverse dynamics
_RESTING = 0.01  # of the velocity limit
_MARGIN = 0.98  # of the limits
_TRIES = 12  # times that a motion is made smaller before it is given up
_BEST = 4  # candidates that are improved
_SPREAD = (0.5, 0.05)  # of what the improvements change, from first to last
_SURE = 0.05  # relative standard error of friction that is known


@validated
class TrajectoryTask:
    """What trajectories are designed for.

    Parameters
    ----------
    plant : Plant, its base parameters p of shape (nb,)
    friction : Friction, the prior, theta (n, 2): Coulomb and viscous
    limits : Limits; each joint needs a position limit
    length : float [s], one period
    recordings : int, how many different trajectories
    harmonics : int
    torque_noise : float, what stays unexplained of a torque's mean over 0.05 s, relative to its
        limit; a standard deviation
    """

    plant: Plant
    friction: Friction
    limits: Limits
    length: Annotated[float, Field(ge=20 * WINDOW)] = 10.0
    recordings: Count = 1
    harmonics: Annotated[int, Field(ge=2)] = 5
    torque_noise: Positive = 0.01

    def __post_init__(self) -> None:
        mechanism = self.plant.mechanism
        if not all(mechanism.driven):
            j = list(mechanism.driven).index(False)
            raise InputError(
                f"trajectories need a motor at every joint, and joint {j + 1} of {mechanism.kind} "
                "has none: design torque signals, without --trajectory"
            )
        if not np.isfinite(self.limits.angle).all():
            raise InputError(
                "trajectories need a limit of each joint's position: add angle to --limits, such "
                'as "torque=[90,60],velocity=2,angle=2.5"'
            )

    @property
    def time(self) -> Array:
        """Middles of the windows (T,) [s]."""
        return (np.arange(round(self.length / WINDOW)) + 0.5) * WINDOW


class Trajectory(NamedTuple):
    """A designed motion: references of the joints; position, velocity and torque (T, n)."""

    references: tuple[Fourier, ...]
    q: Array
    w: Array
    torque: Array


@dataclass(frozen=True, eq=False)
class TrajectoryDesign:
    """Trajectories, and what they are expected to show.

    error : (n, 2), standard errors of Coulomb and viscous friction, relative to the prior
    values : worst of them after each trajectory
    """

    task: TrajectoryTask
    trajectories: tuple[Trajectory, ...]
    error: Array
    values: tuple[float, ...]

    @property
    def unsure(self) -> tuple[int, ...]:
        """Joints (from 0) whose friction will not be known to 5 %."""
        return tuple(int(j) for j in np.flatnonzero((self.error > _SURE).any(axis=1)))


def design_trajectories(
    task: TrajectoryTask,
    effort: int = 600,
    seed: int = 0,
    done: Done = say_nothing,
) -> TrajectoryDesign:
    """Best trajectories of a random search, one after the other, each beside those before it.

    effort : number of motions that are tried for each; `done` is called after each trajectory

    Raises
    ------
    InputError
        Where no motion keeps the limits.

    >>> from frictionid.excitation import limits_of, prior_friction_of
    >>> from frictionid.mechanics import double_pendulum
    >>> arm = double_pendulum(m1=0.6, m2=0.5, l1=0.25, r1=0.12, r2=0.13, I1=0.013, I2=0.012)
    >>> limits = limits_of("torque=[4,2],velocity=[6,8],angle=[2.5,2.5]", arm)
    >>> task = TrajectoryTask(
    ...     Plant.from_parameters(arm, {}), prior_friction_of("", limits), limits, length=4.0
    ... )
    >>> design = design_trajectories(task, effort=60)
    >>> bool((np.abs(design.trajectories[0].w) <= limits.velocity).all())
    True
    """
    random = np.random.default_rng(seed)
    total, chosen, values = np.zeros((_size(task),) * 2), [], []
    for number in range(task.recordings):
        best = _search(task, total, effort, random)
        total = total + _information(task, best)
        chosen.append(best)
        values.append(float(_errors(task, total).max()))
        done(f"trajectory {number + 1}: friction known to {100 * values[-1]:.2g} % at worst")
    return TrajectoryDesign(task, tuple(chosen), _errors(task, total), tuple(values))


def _search(
    task: TrajectoryTask, before: Array, effort: int, random: np.random.Generator
) -> Trajectory:
    """The best motion of so many, beside the information of those before it."""
    n, width = task.plant.n, 2 * task.harmonics + 1
    candidates: list[tuple[float, Array, Trajectory]] = []
    pool = max(1, effort // 2)
    for step in range(-pool, effort - pool):
        x = random.normal(size=(n, width))
        if step >= 0:
            if not candidates:
                break
            candidates = sorted(candidates, key=lambda c: c[0])[:_BEST]
            share = step / max(effort - pool - 1, 1)
            spread = _SPREAD[0] * (_SPREAD[1] / _SPREAD[0]) ** share
            x = candidates[step % len(candidates)][1] + spread * x
        motion = _within_limits(task, x)
        if motion is not None:
            value = float(_errors(task, before + _information(task, motion)).max())
            candidates.append((value, x, motion))
    if not candidates:
        raise InputError(
            f"no motion of {task.length:g} s keeps the limits: the torques do not suffice for "
            "gravity and friction; raise torque, or take a longer one"
        )
    return min(candidates, key=lambda c: c[0])[2]


def _within_limits(task: TrajectoryTask, x: Array) -> Trajectory | None:
    """The motion of coefficients (n, 2 H + 1), made so small that it keeps all limits, or None."""
    limits, n = task.limits, task.plant.n
    sines, cosines = _at_rest(task, x[:, 1 : task.harmonics + 1], x[:, task.harmonics + 1 :])
    offset = 0.5 * limits.angle * np.tanh(x[:, 0])
    frequency = 1.0 / task.length
    shape = [Fourier(tuple(sines[j]), tuple(cosines[j]), frequency) for j in range(n)]
    q, w, a = (
        np.stack(part, axis=-1) for part in zip(*(f.motion(task.time) for f in shape), strict=True)
    )
    room = _MARGIN * limits.angle - np.abs(offset), _MARGIN * limits.velocity
    scale = np.minimum(*(r / np.abs(x).max(axis=0) for r, x in zip(room, (q, w), strict=True)))
    for _ in range(_TRIES):
        motion = offset + scale * q, scale * w
        M, h = task.plant.dynamics(*motion)
        torque = times(M, scale * a) - h + task.friction.torque(at_rest(motion[1]))
        over = float((np.abs(torque).max(axis=0) / (_MARGIN * limits.torque)).max())
        if over <= 1.0:
            rows = zip(scale[:, None] * sines, scale[:, None] * cosines, offset, strict=True)
            references = tuple(
                Fourier(tuple(a.tolist()), tuple(b.tolist()), frequency, float(c))
                for a, b, c in rows
            )
            return Trajectory(references, *motion, torque)
        scale, offset = scale * max(0.5, 0.95 / over), 0.9 * offset
    return None


def _at_rest(task: TrajectoryTask, sines: Array, cosines: Array) -> tuple[Array, Array]:
    """The nearest coefficients (n, H) of motions that begin without velocity and acceleration."""
    rate = np.arange(1.0, task.harmonics + 1)
    rest = cosines - np.outer(cosines @ rate, rate) / (rate @ rate)
    return sines - sines.mean(axis=1, keepdims=True), rest


def _size(task: TrajectoryTask) -> int:
    return 3 * task.plant.n + len(task.plant.mechanism.base_names)


def _information(task: TrajectoryTask, motion: Trajectory) -> Array:
    """Information on friction (n, 2) relative to the prior, base parameters and offsets (n)."""
    plant, n, T = task.plant, task.plant.n, len(motion.q)
    a = np.stack([f.motion(task.time)[2] for f in motion.references], axis=-1)
    regressor = plant.mechanism.partials(plant.p, motion.q, motion.w, a).by_p
    size = np.abs(plant.p) + 1e-3 * np.abs(plant.p).max()
    J, each = np.zeros((T, n, _size(task))), np.arange(n)
    theta = np.asarray(task.friction.theta)
    J[:, each, 2 * each] = theta[:, 0] * np.sign(motion.w)
    J[:, each, 2 * each + 1] = theta[:, 1] * motion.w
    J[:, :, 2 * n : -n] = regressor * size
    J[:, each, each - n] = task.limits.torque
    slides = np.abs(motion.w) > _RESTING * task.limits.velocity
    J *= (slides / (task.torque_noise * task.limits.torque))[..., None]
    flat = J.reshape(-1, J.shape[-1])
    return flat.T @ flat


def _errors(task: TrajectoryTask, information: Array) -> Array:
    """Relative standard errors (n, 2) of friction; all else is free, and barely known before."""
    n = task.plant.n
    # base parameters are known to their own size: some combinations no motion within limits shows
    prior = np.concatenate([np.full(2 * n, 1e-6), np.ones(len(information) - 2 * n)])
    covariance = np.linalg.inv(information + np.diag(prior))
    return np.sqrt(np.diag(covariance)[: 2 * n]).reshape(n, 2)
