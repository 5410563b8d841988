"""Parameters of friction that mean nothing where another one is zero: a width without a peak."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.parameters.parameter_block import Parameter
from frictionid.friction import Friction, Inputs

_TEMPERATURES = (0.0, 80.0)  # [degC]
_POINTS, _SPEED, _DECADES = 200, 10.0, 4  # [rad/s], and how much slower the slowest is
_CHANGE = 0.3  # of a parameter's value
_NOTHING = 1e-9  # of the largest torque


def meaningless(
    friction: Friction, parameters: Sequence[Parameter], weak: Array, doubtful: Array | None = None
) -> dict[int, tuple[int, ...]]:
    """Entries that do nothing where weak ones (D,), known no better than to be zero, are zero.

    Each with the weak ones that it hangs on. The doubtful ones (D,), all weak ones and maybe more,
    count as weak where others hang on them.
    """
    doubtful = weak if doubtful is None else doubtful
    own = [k for k, e in enumerate(parameters) if e.block == "friction"]

    def _is_velocity(i: int) -> bool:  # of which zero is no absence
        return parameters[i].unit in ("rad/s", "m/s")

    out = {}
    for k in own:
        joint = parameters[k].place[0]
        others = [
            i
            for i in own
            if doubtful[i] and parameters[i].place[0] == joint and i != k and not _is_velocity(i)
        ]
        if (
            weak[k]
            or _shows(friction, parameters, k, others)
            or not _shows(friction, parameters, k, [])
        ):
            continue
        single = [i for i in others if not _shows(friction, parameters, k, [i])]
        out[k] = tuple(single or others)
    return out


def _shows(
    friction: Friction, parameters: Sequence[Parameter], k: int, zero: Sequence[int]
) -> bool:
    """Whether the torque answers to an entry while others are zero."""
    theta = np.array(friction.theta, dtype=float)
    for i in zero:
        theta[parameters[i].place] = np.clip(0.0, parameters[i].low, parameters[i].high)
    up, down = theta.copy(), theta.copy()
    up[parameters[k].place] *= 1.0 + _CHANGE
    down[parameters[k].place] *= 1.0 - _CHANGE
    here, there = (_torque(friction, t)[:, parameters[k].place[0]] for t in (up, down))
    return bool(np.abs(here - there).max() > _NOTHING * np.abs(here).max())


def _torque(friction: Friction, theta: Array) -> Array:
    """Torque (K, n) at inputs of all kinds, of a memory that has just met them."""
    law = friction.law
    rng = np.random.default_rng(0)
    shape = (4, _POINTS, friction.n)
    x = Inputs(*(_SPEED * 10.0 ** rng.uniform(-_DECADES, 0.0, shape) * rng.choice([-1, 1], shape)))
    x = x._replace(load=np.abs(x.load), temperature=rng.uniform(*_TEMPERATURES, shape[1:]))
    dt = np.full((_POINTS, 1), law.sample_time or 0.005)
    before = x.each(lambda value: value[::-1])
    memory = law.advance(theta, x, law.start(theta, before), dt)
    return np.asarray(law.torque(theta, x, memory) + 0.0 * x.w)
