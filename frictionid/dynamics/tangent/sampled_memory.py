"""Memories that advance with the samples: their values and derivatives after an interval's end."""

from collections.abc import Callable, Iterator

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Inputs, Memory
from frictionid.friction.coordinates import torque_map

from ..state import State, inputs
from .end_states import EndStates, MotorTorque
from .law_derivatives import SPEED, by_memory, by_theta
from .tangent import MotionModel


def memory_after_sample(
    model: MotionModel, end: EndStates, motor: MotorTorque, dt: Array
) -> EndStates:
    """End states after the sample, which the memory z takes in with the torque that follows.

    z' = advance(theta, x, z),    dz' = dz'/dx dx + dz'/dz dz + dz'/dtheta dtheta

    dt : (K,) [s] since the sample before
    """
    (K, n), count = end.q.shape, len(end.memory)
    size = end.by_start.shape[1]
    x = inputs(model.plant, model.friction, State(end.q, end.w, end.memory), motor.u[0])
    m = x.w.shape[-1]
    law, theta = model.friction.law, model.friction.theta

    def advanced(theta: Array, x: Inputs, memory: Memory) -> Array:
        """All entries of the memory, (entries, K, m)."""
        later = law.advance(theta, x, memory, dt[:, None])
        return np.stack([np.broadcast_to(entry, (K, m)) for entry in later])

    before = np.concatenate([end.by_start, end.by_parameters], axis=-1)
    after = np.zeros((count, K, m, before.shape[-1]))
    for slope, change in _by_inputs(
        model, lambda x: advanced(theta, x, end.memory), x, before, motor
    ):
        after += slope[..., None] * change
    for e, slope in enumerate(by_memory(lambda z: advanced(theta, x, z), end.memory)):
        after += slope[..., None] * before[:, 2 * n + e * m : 2 * n + (e + 1) * m]
    if not law.reads_window:
        slopes = by_theta(theta, model.free, lambda t: advanced(t, x, end.memory), None, 0.0 * x.w)
        free = model.free.of_parts(slopes, m)
        after[..., size : size + free.shape[-1]] += free
    rows = np.moveaxis(after, 0, 1).reshape(K, count * m, -1)
    both = np.concatenate([before[:, : 2 * n], rows], axis=1)
    memory = tuple(advanced(theta, x, end.memory))
    return EndStates(end.q, end.w, memory, both[..., :size], both[..., size:])


def _by_inputs(
    model: MotionModel,
    advanced: Callable[[Inputs], Array],
    x: Inputs,
    before: Array,
    motor: MotorTorque,
) -> Iterator[tuple[Array, Array]]:
    """Slopes (entries, K, m) in each input that the law reads, and its derivatives (K, m, D)."""
    mechanism, m = model.plant.mechanism, x.w.shape[-1]
    n, A = mechanism.n, mechanism.friction_map
    changes = {"w": A @ before[:, n : 2 * n]}
    if model.reads.q:
        changes["q"] = A @ before[:, :n]
    if model.reads.u:
        by = np.zeros((len(before), n, before.shape[-1]))
        by[..., before.shape[-1] - motor.by.shape[1] :] = np.moveaxis(motor.by[0], 0, -1)
        if model.plant.feedback is not None:
            K, B = np.moveaxis(model.plant.feedback, -2, 0)[..., None]
            by = by - K * before[:, :n] - B * before[:, n : 2 * n]
        changes["u"] = torque_map(mechanism) @ by
    for name, change in changes.items():
        value = getattr(x, name)
        for joints in np.eye(m) if model.reads.others else np.ones((1, m)):
            up, down = (x._replace(**{name: value + s * SPEED * joints}) for s in (1, -1))
            yield (advanced(up) - advanced(down)) / (2 * SPEED), change[:, joints > 0]
