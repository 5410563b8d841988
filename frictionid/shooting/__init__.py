"""Shooting: friction, inertia and rig from the measured angles themselves, windows at a time."""

from frictionid.shooting.covariance import Covariance
from frictionid.shooting.refine import Diagnostics, Place, Refined, refine
from frictionid.shooting.settings import Settings

__all__ = ["Covariance", "Diagnostics", "Place", "Refined", "Settings", "refine"]
