"""Friction where parts slide, of mechanisms in which a motor turns with several joints.

At m places parts slide with velocities A w, A = `Mechanism.friction_map` (m, n), and friction acts
on the joints with Tf = A' f(A w). Of other mechanisms the places are the joints.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.arrays import Array, times
from frictionid.errors import InputError
from frictionid.friction.friction import Friction
from frictionid.friction.law import Inputs
from frictionid.mechanics import Mechanism, Plant


def at_places(mechanism: Mechanism, x: Inputs) -> Inputs:
    """Inputs (..., m) where parts slide, from those of the joints (..., n).

    A motor that turns with several joints carries the torque and the load of the last of them.
    """
    if not mechanism.coupled:
        return x
    A = mechanism.friction_map
    last = [int(np.flatnonzero(row)[-1]) for row in A]
    return Inputs(x.q @ A.T, x.w @ A.T, x.u[..., last], x.load[..., last])


def recorded_inputs(plant: Plant, time: Array, q: Array, w: Array, u: Array) -> Inputs:
    """Inputs (S, m) where parts slide along a recorded motion (S, n); samples are every other row.

    The load is that of friction-free motion under u or, where it is the torque of gears, of the
    recorded motion itself: a load from u would explain friction by itself.
    """
    load = u
    if plant.mechanism.loads_of_gears and len(time) > 3:
        rate = np.gradient(w[::2], time[::2], axis=0)
        a = np.stack([np.interp(time, time[::2], column) for column in rate.T], axis=-1)
        M, h = plant.dynamics(q, w)
        load = times(M, a) - h
    return at_places(plant.mechanism, Inputs(q, w, u, plant.load(q, w, load)))


def with_places(mechanism: Mechanism, r: Array, G: Array) -> tuple[Array, Array]:
    """One-step rows r (K, n), G (K, n, n) for friction at m places: (K, m) and (K, m, m).

    Rows that are added are zero and tell nothing.
    """
    if not mechanism.coupled:
        return r, G
    A = mechanism.friction_map
    more = len(A) - A.shape[1]
    return np.pad(r, ((0, 0), (0, more))), np.pad(G @ A.T, ((0, 0), (0, more), (0, 0)))


def with_units_of(mechanism: Mechanism, friction: Friction) -> Friction:
    """Friction with the units of the places where it acts, and of the load there."""
    load = "N m" if mechanism.loads_of_gears else "N"
    return replace(friction, position_units=mechanism.friction_units, load_unit=load)


def refuse_coupled(mechanism: Mechanism, what: str) -> None:
    """Raise InputError where motors turn with several joints, for what takes friction by joint."""
    if mechanism.coupled:
        name = mechanism.coupled[0][0]
        raise InputError(
            f"{what} takes friction joint by joint, but {name!r} turns with several: fit by "
            "inverse dynamics or one step, or leave coupled out of [mechanism]"
        )
