"""Blocks of parameters that shooting can free: friction, inertia, sensors and clock, servo."""

from frictionid.fitting.parameters.actuator import ActuatorBlock, BacklashBlock, TargetDelayBlock
from frictionid.fitting.parameters.friction import FrictionBlock
from frictionid.fitting.parameters.inertia import InertiaBlock
from frictionid.fitting.parameters.parameter_block import Estimate, Parameter, ParameterBlock
from frictionid.fitting.parameters.sensors import BiasBlock, DelayBlock, GainBlock, OffsetBlock

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
