"""Synchronise the clocks of angles and torque, by the motion itself or by a sync LED."""

from frictionid.rig.align.clock import Alignment, Clock, align
from frictionid.rig.align.cross_correlation import CoarseOffset
