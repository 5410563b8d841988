"""Friction laws, one per file."""

from frictionid.laws.contract import check_law
from frictionid.laws.coulomb_viscous import CoulombViscous
from frictionid.laws.motor_load import MotorLoad
from frictionid.laws.none import NoFriction
from frictionid.laws.stribeck import AsymmetricStribeck, Stribeck

__all__ = [
    "AsymmetricStribeck",
    "CoulombViscous",
    "MotorLoad",
    "NoFriction",
    "Stribeck",
    "check_law",
]
