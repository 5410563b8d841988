"""One clock for angles and torque: offset and drift from the motion itself, or from a marker."""

from frictionid.acquire.align.clock import Alignment, Clock, align
from frictionid.acquire.align.cross_correlation import Match

__all__ = ["Alignment", "Clock", "Match", "align"]
