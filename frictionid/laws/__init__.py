"""Friction laws, one per file."""

from frictionid.laws.contract import check_law
from frictionid.laws.coulomb_viscous import CoulombViscous
from frictionid.laws.none import NoFriction
from frictionid.laws.stribeck import AsymmetricStribeck, Stribeck

__all__ = ["AsymmetricStribeck", "CoulombViscous", "NoFriction", "Stribeck", "check_law"]
