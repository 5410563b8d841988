"""Networks in shooting: on NumPy arrays, and as laws of the combinations that change the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frictionid.arrays import namespace
from frictionid.dynamics.tangent.tensor_law import TensorLaw
from frictionid.errors import needs
from frictionid.fitting.parameters.blocks import FrictionBlock
from frictionid.fitting.parameters.combinations import CombinationBlock
from frictionid.fitting.parameters.parameter_block import ParameterBlock
from frictionid.fitting.shooting.combinations import CombinationLaw, TorqueSamples
from frictionid.friction import Friction

_MOST = 20  # combinations of a joint
_DEVIATION = 1.0  # standard deviation of the prior of a joint's weights, relative to their size


def on_arrays(friction: Friction) -> Friction:
    """The friction on NumPy arrays, with slopes by reverse mode where its law has none to give."""
    law, theta = friction.law, friction.theta
    if not hasattr(theta, "detach"):
        differentiable = law.reads_window or not law.has_memory
        if not law.is_network or (law.has_gradient and differentiable):
            return friction
        with needs("networks"):
            from torch import as_tensor  # late: who has no such law need not wait for torch

        theta = as_tensor(np.array(theta, dtype=float))
    like = theta.detach().double()
    law = TensorLaw(law, law.width, law.shape, like)
    return replace(friction, law=law, theta=like.cpu().numpy().copy())


def as_given(friction: Friction, start: Friction) -> Friction:
    """The friction with the law and the kind of numbers that were given."""
    theta = friction.theta
    if isinstance(friction.law, CombinationLaw):
        theta = friction.law.numbers(theta)
    like = start.theta
    if hasattr(like, "detach"):
        theta = namespace(like).asarray(theta, dtype=like.dtype, device=like.device)
    return replace(friction, law=start.law, theta=theta, constraints=None)


def with_combinations(
    friction: Friction, samples: TorqueSamples, blocks: Sequence[ParameterBlock]
) -> tuple[Friction, tuple[ParameterBlock, ...]]:
    """A network as a law of the combinations that change the motion, and the block of these.

    Weights with bounds, the scales of inputs and outputs, stay as they are.
    """
    law = friction.law
    block = next((b for b in blocks if isinstance(b, FrictionBlock)), None)
    fixed = law.names if block is None else block.fixed
    pairs = zip(law.names, law.bounds, strict=True)
    free = np.array([name not in fixed and not np.isfinite(ends).any() for name, ends in pairs])
    deviation = _DEVIATION if block is None or block.prior is None else block.prior
    few = CombinationBlock(
        np.array(friction.theta), samples, free, deviation, min(_MOST, int(free.sum()))
    )
    return few.of(friction), tuple(few if b is block else b for b in blocks)
