"""What may have changed: friction, a payload, the sensors, each with its prior; and the motion."""

from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, rms
from frictionid.mechanics import Mechanism
from frictionid.mechanics.rigid_body.rigid_body_tree import (
    RigidBodyTree,
    moments_of,
    pseudo_inertia,
)

PARTS = ("coulomb", "viscous", "stribeck", "asymmetry")
# Standard deviations of priors, wide beside what a recording tells, so that they hardly shrink it:
# delay [s], gain [1], offset [rad], mass [1], and friction in usual levels.
DELAY, GAIN, OFFSET, MASS, LEVELS = 0.1, 0.5, 0.25, 1.5, 3.0
MOMENTS = ("mx", "my", "mz")
PAYLOAD, FRICTION = "the payload's inertia", "friction of "
_NEW = 0.1  # of what the last other direction leaves: a mass that acts like others has no direction


class Effect(NamedTuple):
    """One number that may have changed.

    cause : what it belongs to, such as "friction of joint 1"
    name : of the number in it; unit : its unit; size : standard deviation of its prior
    """

    cause: str
    name: str
    unit: str
    size: float


def effects_of(mechanism: Mechanism, level: Array) -> tuple[Effect, ...]:
    """All effects on a machine whose friction is `level` (m,) at its usual speeds.

    >>> from frictionid.mechanics import pendulum
    >>> [e.cause for e in effects_of(pendulum(mass=0.5, length=0.3), np.ones(1))][3:6]
    ['friction of joint 1', "the payload's inertia", "the torque's delay"]
    """
    effects = []
    pairs = zip(mechanism.friction_names, mechanism.friction_torque_units, level, strict=True)
    for name, unit, size in pairs:
        for part in PARTS:
            effects.append(Effect(f"{FRICTION}{name}", part, unit, LEVELS * float(size)))
    for name in payloads(mechanism)[0]:
        effects.append(Effect(PAYLOAD, name, "1", MASS))
    effects.append(Effect("the torque's delay", "delay", "s", DELAY))
    for name, driven in zip(mechanism.joints, mechanism.driven, strict=True):
        if driven:
            effects.append(Effect(f"the torque's gain of {name}", "gain", "1", GAIN))
    for name, unit in zip(mechanism.joints, mechanism.position_units, strict=True):
        effects.append(Effect(f"the angle's offset of {name}", "offset", unit, OFFSET))
    return tuple(effects)


def causes_of(effects: Sequence[Effect]) -> dict[str, Array]:
    """Columns of each cause."""
    places = enumerate(effects)
    return {
        cause: np.array([i for i, _ in group])
        for cause, group in groupby(places, lambda place: place[1].cause)
    }


def shares(effects: Sequence[Effect], payload: Array) -> Array:
    """Masses with a payload (D,), over those without; one of all else.

    Changes beside a payload are per share: where mass, gain and friction grow alike, so do these.
    """
    masses = [e.cause == PAYLOAD and e.name not in MOMENTS for e in effects]
    return np.where(masses, 1.0 + payload, 1.0)


def parts_at(w: Array, speeds: Array) -> Array:
    """Torques (4 n, S, n) of the four parts of each joint at velocities w (S, n), 1 N m each."""
    slow, usual = speeds[:, 0], speeds[:, 1]
    side = np.sign(w)
    shapes = (side, w / usual, np.exp(-((w / slow) ** 2)) * side, np.ones_like(w))
    out = np.zeros((w.shape[1], len(PARTS), *w.shape))
    for j in range(w.shape[1]):
        for k, shape in enumerate(shapes):
            out[j, k, :, j] = shape[:, j]
    return out.reshape(-1, *w.shape)


def total_weights(speeds: Array) -> Array:
    """Weights (n, 4) of the parts of each joint's friction at its usual speed: all but asymmetry.

    >>> total_weights(np.array([[0.1, 1.0, 2.0]])).round(3)
    array([[1., 1., 0., 0.]])
    """
    slow, usual, _ = speeds.T
    ones = np.ones_like(usual)
    return np.stack([ones, ones, np.exp(-((usual / slow) ** 2)), 0.0 * ones], axis=-1)


def payloads(mechanism: Mechanism) -> tuple[tuple[str, ...], Array]:
    """Names (I,) of masses, and changes (I, nb) of the base parameters when each one doubles.

    Of a tree of bodies a mass at the end of the last one, where a tool is carried, and its first
    moments. Those that act as others do are left out.
    """
    size = np.abs(mechanism.nominal_base) + 1e-12
    names, rows, basis = [], np.zeros((0, len(size))), np.zeros((0, len(size)))
    for name, row in _masses(mechanism):
        scaled = row / size
        left = scaled - basis.T @ (basis @ scaled)
        length = float(np.linalg.norm(left))
        if length > _NEW * float(np.linalg.norm(scaled)):
            basis, rows = np.vstack([basis, left / length]), np.vstack([rows, row])
            names.append(name)
    return tuple(names), rows


def _masses(mechanism: Mechanism) -> list[tuple[str, Array]]:
    """Names and changes of base parameters of all masses, the last ones first."""
    values = mechanism.nominal()
    out = []
    for p in reversed(mechanism.parameters):
        if p.unit == "kg" and values[p.name] > 0:
            heavier = mechanism.base({**values, p.name: 2.0 * values[p.name]})
            out.append((p.name, np.asarray(heavier - mechanism.base(values), dtype=float)))
    if isinstance(mechanism, RigidBodyTree) and not out:
        moments = _point_masses(mechanism.tree.inertia[-1])
        acts = mechanism.reduction.regrouping[:, 10 * (mechanism.n - 1) :][:, :10]
        out += [(name, acts @ row) for name, row in zip(("mass", *MOMENTS), moments, strict=True)]
    return out


def _point_masses(body: Array) -> Array:
    """Moments (4, 10) that a mass like a body's adds at its far end, and where it sits farther out.

    The far end is the centre of mass, and a radius of gyration beyond. A mass of 1 at r has the
    pseudo-inertia (r, 1) (r, 1)'; the last three rows change it as r grows along x, y and z.
    """
    J = pseudo_inertia(body) / body[0]
    length = float(np.linalg.norm(J[3, :3]))
    gyration = np.sqrt(max(float(np.trace(J[:3, :3])) - length**2, 0.0))
    r = J[3, :3] * (1.0 + gyration / max(length, 1e-9))
    place, size = np.append(r, 1.0), max(float(np.linalg.norm(r)), 0.1)
    farther = [np.outer(e, place) + np.outer(place, e) for e in size * np.eye(3, 4)]
    return body[0] * moments_of(np.stack([np.outer(place, place), *farther]))


# --- How recordings move, and whether new ones move as healthy ones did ---------------------------

MEASURES = "faster", "more abrupt"
MARGIN = np.log(1.25)  # beyond the healthy recordings, or half of their range if that is more


def motion_of(time: Array, w: Array, floor: Array) -> Array:
    """Logarithms (n, 2) of the speed that 5 % of the time exceeds, and of the RMS acceleration.

    Parameters
    ----------
    time, w : arrays, shapes (K,), (K, n)
    floor : array, shape (n,)
        Speed below which a joint counts as still.
    """
    both = np.stack([floor, floor])
    if len(time) >= 3:
        steps = np.diff(time)
        usual = steps <= 3.0 * np.median(steps)
        a = np.diff(w, axis=0)[usual] / steps[usual, None]
        speed, abruptness = np.quantile(np.abs(w), 0.95, axis=0), rms(a, 0)
        both = np.maximum([speed, abruptness], both)
    return np.log(both.T)


def beyond(healthy: Array, new: Array) -> Array:
    """Whether (k, n, 2) new motion is faster or more abrupt than healthy motion (N, n, 2) ever was.

    >>> beyond(np.zeros((3, 1, 2)), np.array([[[0.1, 1.0]], [[-1.0, 0.0]]])).tolist()
    [[[False, True]], [[False, False]]]
    """
    low, high = healthy.min(axis=0), healthy.max(axis=0)
    return new > high + np.maximum(MARGIN, 0.5 * (high - low))


def apart(healthy: Array, new: Array) -> Array:
    """Whether (k,) new motion (k, n, 2) leaves the range of healthy motion (N, n, 2), from 0 to 1.

    One where a measure lies a range of the healthy recordings outside, or a quarter of the speed
    where they are alike. Slower motion asks for no friction that they did not show: one is enough.

    >>> apart(np.zeros((3, 1, 2)), np.array([[[-0.11157, 0.0]], [[-9.0, 0.0]]])).round(2)
    array([0.5, 1. ])
    """
    low, high = healthy.min(axis=0), healthy.max(axis=0)
    off = np.maximum(new - high, 0.0) + np.maximum(low - new, 0.0)
    return np.minimum(off / np.maximum(MARGIN, high - low), 1.0).max(axis=(1, 2))


def sentence(side: Array, joints: Sequence[str]) -> str:
    """What exceeds, of an array (n, 2) like a row of `beyond`.

    >>> sentence(np.array([[True, True], [False, True]]), ("joint 1", "joint 2"))
    'faster (joint 1), more abrupt (joint 2)'
    """
    rows = zip(side, joints, strict=True)
    return ", ".join(
        f"{MEASURES[int(np.argmax(row))]} ({joint})" for row, joint in rows if row.any()
    )
