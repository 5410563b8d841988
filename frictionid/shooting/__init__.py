"""Shooting: friction, inertia and rig from the measured angles themselves, windows at a time."""

from frictionid.shooting.calibrated_recipe import Corrected
from frictionid.shooting.covariance import Covariance
from frictionid.shooting.recipe import Shooting, refine_folds
from frictionid.shooting.refine import Diagnostics, Place, Refined, refine
from frictionid.shooting.result_document import document_of
from frictionid.shooting.settings import Settings

__all__ = [
    "Corrected",
    "Covariance",
    "Diagnostics",
    "Place",
    "Refined",
    "Settings",
    "Shooting",
    "document_of",
    "refine",
    "refine_folds",
]
