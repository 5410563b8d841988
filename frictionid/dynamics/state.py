"""The state of a machine, and what acts on it at one instant."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, like, namespace
from frictionid.friction import Friction, Inputs, Memory
from frictionid.friction.coordinates import at_places, predicted_load, resting_parts, turns_of
from frictionid.mechanics import Mechanism, Plant


class State(NamedTuple):
    """State of a machine: q (..., n) [rad], w (..., n) [rad/s] and the friction's memory.

    Friction acts at m parts, the joints and those that turn with several of them; entries of its
    memory have shape (..., m).
    """

    q: Array
    w: Array
    memory: Memory = ()


def state_of(nodes: Array, mechanism: Mechanism) -> State:
    """The states in nodes (K, s), with entries (K, m) of the memory; views."""
    n, m = mechanism.n, len(mechanism.friction_names)
    memory = tuple(nodes[:, i : i + m] for i in range(2 * n, nodes.shape[1], m))
    return State(nodes[:, :n], nodes[:, n : 2 * n], memory)


class Instant(NamedTuple):
    """What determines accelerations: plant, friction, state, and motor torques u (..., n) [N m].

    Of a plant with feedback, u is what a controller commands beside it.

    All batch axes broadcast against each other.
    """

    plant: Plant
    friction: Friction
    state: State
    u: Array

    @property
    def torque(self) -> Array:
        """Motor torques u - K q - B w (..., n) [N m], or u where the plant has no feedback."""
        loop, state = self.plant.feedback, self.state
        return (
            self.u
            if loop is None
            else self.u - loop[..., 0, :] * state.q - loop[..., 1, :] * state.w
        )

    @property
    def driven(self) -> Array:
        """Torques B u (..., n) [N m] of joints that have a motor, in closed loop."""
        return self.torque * like(self.plant.mechanism.motors, self.u)

    @property
    def inputs(self) -> Inputs:
        """What friction may depend on (..., m); the load only for laws that use it."""
        plant, (q, w, _) = self.plant, self.state
        law, theta, mechanism = self.friction.law, self.friction.theta, plant.mechanism
        x = Inputs(q, w, self.torque, 0.0 * w, plant.temperature)
        if law.uses_load:
            load = predicted_load(mechanism, law, theta, x, lambda u: plant.load(q, w, u))
            x = x._replace(load=load)
        return at_places(mechanism, x)

    @property
    def turns(self) -> Array | None:
        """Turns (c, n) of coupled parts for one of each joint; None where there are none."""
        return turns_of(self.plant.mechanism, self.state.w)

    @property
    def velocities(self) -> Array:
        """Velocities (..., m) [rad/s] of all parts, exactly zero at rest."""
        return resting_parts(self.state.w, self.turns)

    @property
    def remembers(self) -> bool:
        """Whether friction has memory that advances with each substep."""
        return bool(self.state.memory) and self.friction.law.sample_time is None

    def memory_after(self, dt: Array) -> Memory:
        """Memory of friction after dt (..., 1) [s] at this instant."""
        return self.friction.law.advance(self.friction.theta, self.inputs, self.state.memory, dt)

    @property
    def has_rows(self) -> bool:
        """Whether there are rows to choose from: the state has all batch axes."""
        batch = tuple(self.state.q.shape[:-1])
        axes = (self.plant.p.shape[:-1], self.friction.theta.shape[:-2], self.u.shape[:-1])
        return bool(batch) and np.broadcast_shapes(batch, *axes) == batch

    def rows(self, which: Array) -> "Instant":
        """The instant of some rows, which (...) true or false."""
        physical = self.plant.parameters
        if self.friction.law.uses_load:  # only bearing loads need them
            q = self.state.q
            physical = {k: rows_of(like(v, q), which, 0) for k, v in physical.items()}
        q, w, memory = self.state
        warm = self.plant.temperature
        warm = None if warm is None else rows_of(warm, which, 1)
        loop = self.plant.feedback
        loop = None if loop is None else rows_of(loop, which, 2)
        p = rows_of(self.plant.p, which, 1)
        return Instant(
            replace(self.plant, parameters=physical, p=p, temperature=warm, feedback=loop),
            replace(self.friction, theta=rows_of(self.friction.theta, which, 2)),
            State(q[which], w[which], tuple(rows_of(z, which, 1) for z in memory)),
            rows_of(self.u, which, 1),
        )


def rows_of(x: Array, which: Array, axes: int) -> Array:
    """Some rows of an array whose last axes are no batch; the array itself where it has one row."""
    xp, batch = namespace(which), tuple(x.shape[: x.ndim - axes])
    shape = tuple(x.shape[x.ndim - axes :])
    if not batch or set(batch) == {1}:
        return xp.reshape(x, shape)
    return xp.broadcast_to(x, (*which.shape, *shape))[which]
