"""Friction: a law and its parameters, and its torque along recorded motion.

law           what a friction law declares and computes
friction      a law with its parameters, and its torque along recorded motion
laws          one friction law per file, and the check of laws of one's own
model_files   fitted models as files
"""

from frictionid.friction.friction import Friction, Nodes, along, memory_along, units_of
from frictionid.friction.law import Inputs, Law, Memory, at_rest

__all__ = [
    "Friction",
    "Inputs",
    "Law",
    "Memory",
    "Nodes",
    "along",
    "at_rest",
    "memory_along",
    "units_of",
]
