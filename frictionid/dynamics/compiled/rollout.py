"""Prediction over many samples by the compiled step: start after start."""

from __future__ import annotations

import math

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.compiled import layout as at
from frictionid.dynamics.compiled.step import adaptive_step
from frictionid.mechanics import Plant
from frictionid.programs.loops import compiled, pointer


def rolled_out(
    machine: at.Machine,
    plant: Plant,
    theta: Array,
    start: tuple[Array, Array],
    u: Array,
    dt: Array,
    sizes: Array,
    runaway: float,
) -> tuple[Array, Array]:
    """Motion q, w (T + 1, ..., n) from start states (..., n); NaN after a divergence.

    Parameters
    ----------
    plant, theta (..., n, P), u (T, ..., n), dt (T, ...)
        Their batch axes broadcast against those of the start, which has all of them.
    sizes : int array, shape (T, 2): pieces of each interval, and their substeps near rest
    runaway : times as fast as slow joints, rows have diverged
    """
    shape, n = start[0].shape, plant.n
    batch, T = shape[:-1], len(u)

    count = math.prod(batch)

    def rows(x: Array, *own: int) -> Array:
        wide = np.array(np.broadcast_to(x, (*batch, *own)), order="C")
        return wide.reshape(count, math.prod(own))

    q, w = (np.empty((T + 1, *shape)) for _ in start)
    q[0], w[0] = start
    flat = [x.reshape(T + 1, count, n) for x in (q, w)]
    driven = rows(np.moveaxis(u, 0, -2), T, n).reshape(count, T, n)
    each = rows(np.moveaxis(dt, 0, -1), T)
    shared = plant.mechanism.motors, plant.slow_like(np.zeros(n))
    p, own = rows(plant.p, plant.p.shape[-1]), rows(theta, *theta.shape[-2:])
    _rollout(machine, *shared, p, own, *flat, driven, each, sizes, runaway)
    return q, w


@compiled
def _rollout(
    machine: at.Machine,
    motors: Array,
    slow: Array,
    p: Array,
    theta: Array,
    q: Array,
    w: Array,
    u: Array,
    dt: Array,
    sizes: Array,
    runaway: float,
) -> None:
    B, T, n = u.shape
    numbers = at.new_row(machine, motors, slow, 0)
    row = pointer(numbers)
    for b in range(B):
        at.set_parameters(machine, row, n, p[b], theta[b])
        at.set_state(row, n, q[0, b], w[0, b], u[b, 0])
        alive = True
        for k in range(T):
            if alive:
                for j in range(n):
                    row[at.U * n + j] = u[b, k, j]
                adaptive_step(machine, row, n, dt[b, k], sizes[k, 0], sizes[k, 1])
                total = 0.0
                for j in range(n):
                    total += abs(row[at.W * n + j]) / slow[j]
                alive = total < runaway
            for j in range(n):
                q[k + 1, b, j] = row[at.Q * n + j] if alive else np.nan
                w[k + 1, b, j] = row[at.W * n + j] if alive else np.nan
    numbers[0] = 0.0  # they live until here
