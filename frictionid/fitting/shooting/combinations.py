"""A law with many numbers as one with few combinations of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration, calibrated_plant
from frictionid.dynamics.state import State, inputs
from frictionid.dynamics.tangent.tensor_law import SmoothedLaw
from frictionid.fitting.shooting.sample_intervals import Intervals, logged_torque
from frictionid.friction import Friction, Inputs, LawParameter, Memory
from frictionid.mechanics import Mechanism


@dataclass(frozen=True, eq=False, repr=False)
class CombinationLaw(SmoothedLaw):
    """A law of the numbers origin + directions theta, theta (n, r).

    origin : (n, P); directions : (n, P, r)
    """

    origin: Array
    directions: Array

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        names = (f"combination {k + 1}" for k in range(self.directions.shape[-1]))
        return tuple(LawParameter(name, "1", -float("inf")) for name in names)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((0.0,) * self.directions.shape[-1],)

    def numbers(self, theta: Array) -> Array:
        """The law's own numbers (..., n, P)."""
        return self.origin + (self.directions @ np.asarray(theta)[..., None])[..., 0]

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self.inner.start(self.numbers(theta), x)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.torque(self.numbers(theta), x, memory)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return self._combined(self.inner.gradient(self.numbers(theta), x))

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory] | None:
        parts = self.inner.slopes(self.numbers(theta), x, memory)
        return None if parts is None else (self._combined(parts[0]), parts[1])

    def _combined(self, gradient: Array) -> Array:
        """Derivatives (K, n, r) in the combinations, of those (K, n, P) in the law's numbers."""
        return np.swapaxes(np.swapaxes(gradient, 0, 1) @ self.directions, 0, 1)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.inner.advance(self.numbers(theta), x, memory, dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.limit(self.numbers(theta), x, memory)


_COUNT = 500
_LINK = 9  # samples through which a memory is followed


@dataclass(frozen=True, eq=False)
class TorqueSamples:
    """N samples of a motion.

    path : inputs (N, n) at successive samples, the last of them those of the sample itself; the
        memory starts at the first
    dt : (N, 1) [s] between them
    """

    path: tuple[Inputs, ...]
    dt: Array

    def torque(self, friction: Friction) -> Array:
        """Torques (N, n) [N m]."""
        law, theta = friction.law, friction.theta
        z = law.start(theta, self.path[0])
        for x in self.path[1:]:
            z = law.advance(theta, x, z, self.dt)
        return np.asarray(law.torque(theta, self.path[-1], z))

    def slopes(self, friction: Friction) -> Array:
        """Their derivatives (N, n, P) in each joint's own numbers."""
        theta = friction.theta
        law: Any = friction.law  # of `on_arrays`, which gives it the derivatives asked for here
        if not law.has_memory:
            return np.asarray(law.gradient(theta, self.path[0]))
        z = law.start(theta, self.path[0])
        if law.reads_window:
            for x in self.path[1:]:
                z = law.advance(theta, x, z, self.dt)
            return np.asarray(law.slopes(theta, self.path[-1], z)[0])
        return np.asarray(law.gradient_along(theta, self.path, z, self.dt))


def torque_samples(
    friction: Friction,
    mechanism: Mechanism,
    calibration: Calibration,
    intervals: Intervals,
    use: Array,
) -> TorqueSamples:
    """Some samples of the intervals in use (K,), as inputs of the law."""
    K = len(intervals.dt)
    run = np.arange(K) - np.maximum.accumulate(np.where(intervals.joined, 0, np.arange(K)))
    link = min(_LINK, int(run.max())) if friction.law.has_memory else 0
    usable = np.flatnonzero((run >= link) & use)
    rows = usable[np.unique(np.linspace(0, len(usable) - 1, _COUNT).astype(int))]
    plant = calibrated_plant(intervals.dataset, calibration)
    driven = mechanism.motors
    path = []
    for at in (rows - back for back in range(link, -1, -1)):
        logged = logged_torque(intervals, calibration, at, np.array([0.0, 1.0])).mean[0]
        u = (calibration.gain * logged + calibration.bias) * driven
        state = State(intervals.q[at] - calibration.offset, intervals.w[at])
        path.append(inputs(plant[intervals.recording[at]], friction, state, u))
    return TorqueSamples(tuple(path), intervals.dt[rows][:, None])
