"""How derivatives of a memory advance with those of the motion."""

from __future__ import annotations

from typing import NamedTuple

from frictionid.arrays import Array
from frictionid.dynamics.state import State, inputs
from frictionid.dynamics.tangent.law_derivatives import SPEED, by_memory, by_theta
from frictionid.dynamics.tangent.tangent import MotionModel, Tangent, rows_of_parts
from frictionid.friction import Memory


class MemoryRates(NamedTuple):
    """Derivatives of the memory after some time, by the memory, velocity and theta before it.

    by_memory : of each entry (K, n) by each entry; by_w : (K, n); by_theta : (m, K), of each entry
    """

    by_memory: tuple[Memory, ...]
    by_w: Memory
    by_theta: tuple[Array, ...]


def memory_rates(model: MotionModel, state: State, u: Array, dt: Array) -> MemoryRates:
    """Those over dt at a state; none for laws that advance with the samples."""
    law, theta = model.friction.law, model.friction.theta
    if not state.memory or law.sample_time is not None:
        return MemoryRates((), (), ())
    x = inputs(model.plant, model.friction, state, u)
    up, down = (
        law.advance(theta, x._replace(w=x.w + s * SPEED), state.memory, dt) for s in (1.0, -1.0)
    )
    by_w = tuple((a - b) / (2 * SPEED) for a, b in zip(up, down, strict=True))

    def one(i: int) -> tuple[Memory, Array]:
        def of_memory(memory: Memory) -> Array:
            return law.advance(theta, x, memory, dt)[i]

        def of_theta(theta: Array) -> Array:
            return law.advance(theta, x, state.memory, dt)[i]

        own = by_theta(theta, model.free, of_theta, None, 0.0 * x.w)
        return by_memory(of_memory, state.memory), own

    inner, own = zip(*(one(i) for i in range(len(state.memory))), strict=True)
    return MemoryRates(inner, by_w, own)


def advance_memory(model: MotionModel, tangent: Tangent, rates: MemoryRates) -> None:
    """Advance the derivatives of the memory, in place, over the time of the rates."""
    new, moves = [], rows_of_parts(tangent.w, model.turns)
    for inner, by_w, own in zip(rates.by_memory, rates.by_w, rates.by_theta, strict=True):
        rows = []
        for j, dw in enumerate(moves):
            change = by_w[:, j] * dw
            for slope, entry in zip(inner, tangent.memory, strict=True):
                change += slope[:, j] * entry[j]
            for k in model.free.of(j):
                change[tangent.theta + k] += own[k]
            rows.append(change)
        new.append(rows)
    tangent.memory[:] = new or tangent.memory
