"""Blocks of parameters that shooting can free: friction, inertia, and what sensors do."""

from frictionid.shooting.parameters.actuator import ActuatorBlock
from frictionid.shooting.parameters.bias import BiasBlock
from frictionid.shooting.parameters.delay import DelayBlock
from frictionid.shooting.parameters.friction import FrictionBlock
from frictionid.shooting.parameters.gain import GainBlock
from frictionid.shooting.parameters.inertia import InertiaBlock
from frictionid.shooting.parameters.offset import OffsetBlock
from frictionid.shooting.parameters.parameter_block import Block, Entry, Guess

__all__ = [
    "ActuatorBlock",
    "BiasBlock",
    "Block",
    "DelayBlock",
    "Entry",
    "FrictionBlock",
    "GainBlock",
    "Guess",
    "InertiaBlock",
    "OffsetBlock",
]
