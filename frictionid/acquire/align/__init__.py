"""Synchronise the clocks of angles and torque, by the motion itself or by a sync LED."""

from frictionid.acquire.align.clock import Alignment, Clock, align
from frictionid.acquire.align.cross_correlation import CoarseOffset

__all__ = ["Alignment", "Clock", "CoarseOffset", "align"]
