"""Shooting: friction, inertia and calibration from windows of the measured angles."""

from frictionid.shooting.calibrated_recipe import CalibratedRecipe
from frictionid.shooting.covariance import Covariance
from frictionid.shooting.recipe import Shooting, refine_folds
from frictionid.shooting.refine import Diagnostics, Place, Refined, refine
from frictionid.shooting.result_document import document_of
from frictionid.shooting.settings import Settings

__all__ = [
    "CalibratedRecipe",
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
