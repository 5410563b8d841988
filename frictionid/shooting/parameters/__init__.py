"""Blocks of parameters that shooting can free: friction, inertia, sensors and clock, servo."""

from frictionid.shooting.parameters.actuator import ActuatorBlock, BacklashBlock, TargetDelayBlock
from frictionid.shooting.parameters.friction import FrictionBlock
from frictionid.shooting.parameters.inertia import InertiaBlock
from frictionid.shooting.parameters.parameter_block import Estimate, Parameter, ParameterBlock
from frictionid.shooting.parameters.sensors import BiasBlock, DelayBlock, GainBlock, OffsetBlock

__all__ = [
    "ActuatorBlock",
    "BacklashBlock",
    "BiasBlock",
    "DelayBlock",
    "Estimate",
    "FrictionBlock",
    "GainBlock",
    "InertiaBlock",
    "OffsetBlock",
    "Parameter",
    "ParameterBlock",
    "TargetDelayBlock",
]
