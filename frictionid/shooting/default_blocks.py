"""What shooting frees where nothing is said: friction, and the delay of a sampled torque."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.data.recordings import Dataset
from frictionid.shooting.parameters.friction import FrictionBlock
from frictionid.shooting.parameters.parameter_block import ParameterBlock
from frictionid.shooting.parameters.sensors import DelayBlock

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
