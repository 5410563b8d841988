"""Parameters that fits can free: friction, inertia, sensors and clocks, servos."""

from .blocks import (
    ActuatorBlock,
    BacklashBlock,
    BiasBlock,
    DelayBlock,
    EnvelopeBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
    TargetDelayBlock,
)
from .parameter_block import Estimate, Parameter, ParameterBlock
