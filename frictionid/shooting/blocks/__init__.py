"""Blocks of parameters that shooting can free: friction, inertia, and what sensors do."""

from frictionid.shooting.blocks.actuator import ActuatorBlock
from frictionid.shooting.blocks.bias import BiasBlock
from frictionid.shooting.blocks.block import Block, Entry, Guess
from frictionid.shooting.blocks.delay import DelayBlock
from frictionid.shooting.blocks.friction import FrictionBlock
from frictionid.shooting.blocks.gain import GainBlock
from frictionid.shooting.blocks.inertia import InertiaBlock
from frictionid.shooting.blocks.offset import OffsetBlock

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
