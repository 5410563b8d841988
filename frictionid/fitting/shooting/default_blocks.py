"""What shooting frees where nothing is said: friction, the delay of a sampled torque or target."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.data.recordings import Dataset
from frictionid.data.signals import holds
from frictionid.fitting.parameters.actuator import TargetDelayBlock
from frictionid.fitting.parameters.friction import FrictionBlock
from frictionid.fitting.parameters.parameter_block import ParameterBlock
from frictionid.fitting.parameters.sensors import DelayBlock

# A torque sampled by a drive acts later than it is logged, or is held from one sample to the next:
# both look like viscous friction where the delay is not free.
DEFAULT_BLOCKS: tuple[ParameterBlock, ...] = (FrictionBlock(), DelayBlock(where_sampled=True))


def torque_is_sampled(dataset: Dataset) -> bool:
    """Whether a recording has samples of a motor's torque, which do not follow from its servo."""
    return any(r.servo is None and np.any(r.torque.value) for r in dataset.recordings)


def applicable(blocks: Sequence[ParameterBlock], dataset: Dataset) -> tuple[ParameterBlock, ...]:
    """The blocks without a delay that is only meant for sampled torques, where there are none."""
    sampled = torque_is_sampled(dataset)
    return tuple(
        b for b in blocks if sampled or not (isinstance(b, DelayBlock) and b.where_sampled)
    )


def blocks_for(blocks: Sequence[ParameterBlock], dataset: Dataset) -> tuple[ParameterBlock, ...]:
    """The applicable blocks; where servos drive by held targets, the delay is that of the targets.

    A controller that gets its targets late looks like viscous friction, too.
    """
    servos = [r.servo for r in dataset.recordings if r.servo is not None]
    late = any(isinstance(b, DelayBlock) and b.where_sampled for b in blocks)
    here = applicable(blocks, dataset)
    if not (late and servos and all(holds(s.goal) for s in servos)) or torque_is_sampled(dataset):
        return here
    return (*here, TargetDelayBlock())
