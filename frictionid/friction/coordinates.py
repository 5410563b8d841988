"""Friction where parts slide, of mechanisms in which a motor turns with several joints.

At m places parts slide with velocities A w, A = `Mechanism.friction_map` (m, n), and friction acts
on the joints with Tf = A' f(A w). Of other mechanisms the places are the joints.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array, inverse, like, namespace, times
from frictionid.mechanics import Mechanism, Plant

from .friction import Friction
from .law import Inputs, Law

_RESTING = 1e-9  # of |A| (|w| + 1 rad/s): a part that is slower rests, but for rounding


def at_places(mechanism: Mechanism, x: Inputs) -> Inputs:
    """Inputs (..., m) where parts slide, from those of the joints (..., n).

    A motor that turns with several joints carries the torque and the load of the last of them.
    """
    turns = turns_of(mechanism, x.w)
    if turns is None:
        return x
    last, (q, w) = _last(mechanism), (of_parts(position, turns) for position in (x.q, x.w))
    return x.each(lambda values: values[..., last])._replace(q=q, w=w)


def of_last_joints(mechanism: Mechanism, values: Array) -> Array:
    """Values (..., m) of all parts from those of joints (..., n): those of the last that turns."""
    return values[..., _last(mechanism)]


def torque_map(mechanism: Mechanism) -> Array:
    """One (m, n) where a part carries the torque of a joint, see `at_places`."""
    return np.eye(mechanism.n)[_last(mechanism)]


def _last(mechanism: Mechanism) -> list[int]:
    """Last of the joints that turn a part, for each of the m parts."""
    return [int(np.flatnonzero(row)[-1]) for row in mechanism.friction_map]


def turns_of(mechanism: Mechanism, w: Array) -> Array | None:
    """Turns (c, n) of the coupled parts for one of each joint; None where all parts are joints."""
    if not mechanism.coupled:
        return None
    return like(mechanism.friction_map[mechanism.n :], w)


def of_parts(w: Array, turns: Array | None) -> Array:
    """A w (..., m): velocities of all parts, from those of the joints (..., n).

    >>> of_parts(np.array([0.3, 0.2]), np.array([[1.0, -1.0]])).round(3)
    array([0.3, 0.2, 0.1])
    """
    if turns is None:
        return w
    return namespace(w).concat([w, w @ turns.T], axis=-1)


def resting_parts(w: Array, turns: Array | None) -> Array:
    """A w (..., m), exactly zero where a part rests while the joints that turn it move.

    >>> resting_parts(np.array([0.3, -0.1]), np.array([[1.0, 3.0]]))[-1]
    np.float64(0.0)
    """
    if turns is None:
        return w
    xp, each = namespace(w), of_parts(w, turns)
    return xp.where(xp.abs(each) <= _RESTING * of_parts(xp.abs(w) + 1.0, xp.abs(turns)), 0.0, each)


def onto_joints(Tf: Array, turns: Array | None) -> Array:
    """A' Tf (..., n): torques on the joints by the friction (..., m) of all parts.

    >>> onto_joints(np.array([1.0, 2.0, 0.5]), np.array([[1.0, -1.0]]))
    array([1.5, 1.5])
    """
    if turns is None:
        return Tf
    n = turns.shape[-1]
    return Tf[..., :n] + Tf[..., n:] @ turns


def mobility(M: Array, turns: Array | None) -> Array:
    """A M^-1 A' (..., m, m): accelerations of the parts by torques on the parts."""
    if turns is None:
        return inverse(M)
    xp = namespace(M)
    A = xp.concat([like(np.eye(M.shape[-1]), M), turns], axis=0)
    return A @ inverse(M) @ A.T


def recorded_inputs(
    plant: Plant, time: Array, q: Array, w: Array, u: Array, temperature: Array | None = None
) -> Inputs:
    """Inputs (S, m) where parts slide along a recorded motion (S, n); samples are every other row.

    The load is that of `recorded_load`.
    """
    load = recorded_load(plant, time, q, w, u, every=2)
    return at_places(plant.mechanism, Inputs(q, w, u, load, temperature))


def recorded_load(plant: Plant, time: Array, q: Array, w: Array, u: Array, every: int = 1) -> Array:
    """Load (S, n) along a recorded motion, of which every so many-th row is a sample.

    It is that of friction-free motion under u or, where it is the torque of gears, of the recorded
    motion itself: a load from u would explain friction by itself.
    """
    torque = u
    if plant.mechanism.loads_of_gears and len(time) > 3:
        samples = time[::every]
        rate = np.gradient(w[::every], samples, axis=0)
        a = np.stack([np.interp(time, samples, column) for column in rate.T], axis=-1)
        M, h = plant.dynamics(q, w)
        torque = times(M, a) - h
    return plant.load(q, w, torque)


def is_coupled_by_load(mechanism: Mechanism, law: Law) -> bool:
    """Whether friction of a joint depends on that of others, by the load of gears."""
    return bool(law.uses_load and mechanism.loads_of_gears)


_PASSES = 2  # a share k of the load that friction takes leaves an error of k^3 of friction


def predicted_load(
    mechanism: Mechanism, law: Law, theta: Array, x: Inputs, load: Callable[[Array], Array]
) -> Array:
    """Load (..., n) at inputs (..., n) of the joints, of which it is the one that is not known.

    Friction takes what it takes off the torque of a gear, on which it depends itself: the fixed
    point of both is approached from the load without friction, with that of steady motion.

    load : of friction-free motion, by the motor torques (..., n)
    """
    out, turns = load(x.u), turns_of(mechanism, x.w)
    for _ in range(_PASSES if mechanism.loads_of_gears else 0):
        at = at_places(mechanism, x._replace(load=out))
        Tf = law.torque(theta, at, law.start(theta, at))
        out = load(x.u - onto_joints(Tf, turns))
    return out


def with_places(mechanism: Mechanism, r: Array, G: Array) -> tuple[Array, Array]:
    """One-step rows r (K, n), G (K, n, n) for friction at m places: (K, m) and (K, m, m).

    Rows that are added are zero and tell nothing.
    """
    if not mechanism.coupled:
        return r, G
    A = mechanism.friction_map
    added = len(A) - A.shape[1]
    return np.pad(r, ((0, 0), (0, added))), np.pad(G @ A.T, ((0, 0), (0, added), (0, 0)))


def with_units_of(mechanism: Mechanism, friction: Friction) -> Friction:
    """Friction with the units of the places where it acts, and of the load there."""
    load = "N m" if mechanism.loads_of_gears else "N"
    return replace(friction, position_units=mechanism.friction_units, load_unit=load)
