"""Parameters that fits can free: friction, inertia, sensors and clocks, servos."""

from frictionid.fitting.parameters.blocks import (
    ActuatorBlock,
    BacklashBlock,
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
    TargetDelayBlock,
)
from frictionid.fitting.parameters.parameter_block import Estimate, Parameter, ParameterBlock
