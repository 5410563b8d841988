"""Blocks of parameters that shooting can free: friction, inertia, sensors and clock, servo."""

from frictionid.fitting.parameters.actuator import ActuatorBlock, BacklashBlock, TargetDelayBlock
from frictionid.fitting.parameters.blocks import (
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
)
from frictionid.fitting.parameters.parameter_block import Estimate, Parameter, ParameterBlock
