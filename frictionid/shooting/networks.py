"""Which combinations of a network's numbers a motion sees, so that shooting can find them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frictionid.arrays import namespace
from frictionid.friction import Friction
from frictionid.mechanics import Mechanism
from frictionid.mechanics.calibration import Calibration
from frictionid.shooting.combined import Combined
from frictionid.shooting.intervals import Track
from frictionid.shooting.parameters.friction import FrictionBlock
from frictionid.shooting.parameters.network_directions import Combinations
from frictionid.shooting.parameters.parameter_block import Block
from frictionid.shooting.tensors import OnTensors
from frictionid.shooting.torque_samples import points_of

_MOST = 20  # combinations of a joint
_REACH = 1.0  # of the size of a joint's numbers: standard deviation of how far they move


def on_arrays(friction: Friction) -> Friction:
    """The friction on NumPy arrays, with slopes by reverse mode where its law has none to give."""
    law, theta = friction.law, friction.theta
    if not hasattr(theta, "detach"):
        known = law.reads_window or not law.has_memory
        if not law.is_network or (law.has_gradient and known):
            return friction
        from torch import as_tensor  # late: who has no such law need not wait for torch

        theta = as_tensor(np.array(theta, dtype=float))
    like = theta.detach().double()
    law = OnTensors(law, law.width, law.shape, like)
    return replace(friction, law=law, theta=like.cpu().numpy().copy())


def as_given(friction: Friction, given: Friction) -> Friction:
    """The friction with the law and the kind of numbers that were given."""
    theta = friction.theta
    if isinstance(friction.law, Combined):
        theta = friction.law.numbers(theta)
    like = given.theta
    if hasattr(like, "detach"):
        theta = namespace(like).asarray(theta, dtype=like.dtype, device=like.device)
    return replace(friction, law=given.law, theta=theta)


def combined(
    friction: Friction,
    mechanism: Mechanism,
    calibration: Calibration,
    track: Track,
    blocks: Sequence[Block],
) -> tuple[Friction, tuple[Block, ...]]:
    """A network as a law of the combinations of its numbers that a track sees, and their block.

    Numbers with bounds, the scales of inputs and outputs, stay as they are.
    """
    law = friction.law
    given = next((b for b in blocks if isinstance(b, FrictionBlock)), None)
    fixed = law.names if given is None else given.fixed
    pairs = zip(law.names, law.bounds, strict=True)
    free = np.array([name not in fixed and not np.isfinite(ends).any() for name, ends in pairs])
    points = points_of(friction, mechanism, calibration, track)
    reach = _REACH if given is None or given.prior is None else given.prior
    own = Combinations(np.array(friction.theta), points, free, reach, min(_MOST, int(free.sum())))
    return own.of(friction), tuple(own if b is given else b for b in blocks)
