"""Blocks of parameters that shooting can free: friction, inertia, sensors and clock, motor."""

from frictionid.shooting.parameters.actuator import ActuatorBlock
from frictionid.shooting.parameters.friction import FrictionBlock
from frictionid.shooting.parameters.inertia import InertiaBlock
from frictionid.shooting.parameters.parameter_block import Estimate, Parameter, ParameterBlock
from frictionid.shooting.parameters.sensors import BiasBlock, DelayBlock, GainBlock, OffsetBlock

__all__ = [
    "ActuatorBlock",
    "BiasBlock",
    "DelayBlock",
    "Estimate",
    "FrictionBlock",
    "GainBlock",
    "InertiaBlock",
    "OffsetBlock",
    "Parameter",
    "ParameterBlock",
]
