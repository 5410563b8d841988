"""Friction: a law and its parameters, and its torque along recorded motion.

friction      Friction, and the Law protocol that its laws follow
laws          one friction law per file, and the check of laws of one's own
model_files   fitted models as files
"""

from frictionid.friction.friction import (
    Friction,
    Inputs,
    Law,
    Memory,
    Nodes,
    along,
    at_rest,
    is_network,
    memory_along,
    units_of,
)

__all__ = [
    "Friction",
    "Inputs",
    "Law",
    "Memory",
    "Nodes",
    "along",
    "at_rest",
    "is_network",
    "memory_along",
    "units_of",
]
