"""Memories that advance with the samples: what they take in at an interval's end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.stiction import State, inputs
from frictionid.friction import Inputs, Memory
from frictionid.shooting.law_derivatives import SPEED
from frictionid.shooting.variational import Ends, Forces, Scene

_SMALL, _LEAST = 1e-6, 1e-3  # difference of a value, and the least that a value counts as


def remembered(scene: Scene, end: Ends, forces: Forces, dt: Array) -> Ends:
    """Ends behind their sample, which the memory takes in with the torque of what follows.

    dt : (K,) [s] since the sample before
    """
    K, n = end.q.shape
    size, count = end.by_start.shape[1], len(end.memory)
    old = np.concatenate([end.by_start, end.by_parameters], axis=-1)
    x = inputs(scene.plant, scene.friction, State(end.q, end.w, end.memory), forces.u[0])
    theta = scene.friction.theta

    def advanced(theta: Array, x: Inputs, memory: Memory) -> Array:
        later = scene.friction.law.advance(theta, x, memory, dt[:, None])
        return np.stack([np.broadcast_to(entry, (K, n)) for entry in later], axis=1)

    rows = np.zeros((K, count, n, old.shape[-1]))
    for name, move in _moves(scene, old, forces):
        value = getattr(x, name)
        for step in np.eye(n) if scene.seen.others else np.ones((1, n)):
            up, down = (x._replace(**{name: value + s * SPEED * step}) for s in (1, -1))
            slope = _slope(lambda y: advanced(theta, y, end.memory), up, down, SPEED)
            rows += slope[..., None] * (move[:, None, step > 0])
    for e, entry in enumerate(end.memory):
        step = _SMALL * (_LEAST + np.abs(entry))
        more, less = ((*end.memory[:e], entry + s * step, *end.memory[e + 1 :]) for s in (1, -1))
        slope = _slope(lambda z: advanced(theta, x, z), more, less, step[:, None])
        rows += slope[..., None] * old[:, None, (2 + e) * n : (3 + e) * n]
    depends = not scene.friction.law.reads_window
    for place in np.unique(scene.free.place) if depends else ():
        step = np.zeros_like(theta)
        step[..., place] = _SMALL * np.maximum(_LEAST, np.abs(theta[..., place]))
        up, down = theta + step, theta - step
        slope = _slope(lambda t: advanced(t, x, end.memory), up, down, step[..., place])
        for k in np.flatnonzero(scene.free.place == place):
            joint = scene.free.joint[k]
            rows[:, :, joint, size + k] += slope[..., joint]
    new = np.concatenate([old[:, : 2 * n], rows.reshape(K, count * n, -1)], axis=1)
    memory = tuple(np.moveaxis(advanced(theta, x, end.memory), 1, 0))
    return Ends(end.q, end.w, memory, new[..., :size], new[..., size:])


def _moves(scene: Scene, old: Array, forces: Forces) -> Iterator[tuple[str, Array]]:
    """What a law may read besides its memory, and its derivatives (K, n, D) in all directions."""
    n = scene.plant.n
    yield "w", old[:, n : 2 * n]
    if scene.seen.q:
        yield "q", old[:, :n]
    if scene.seen.u:
        by = np.zeros((len(old), n, old.shape[-1]))
        by[..., old.shape[-1] - forces.by.shape[1] :] = np.moveaxis(forces.by[0], 0, -1)
        yield "u", by


def _slope(function: Callable[[Any], Array], up: Any, down: Any, step: Array | float) -> Array:
    return (function(up) - function(down)) / (2 * step)
