"""Friction laws, one per file."""

from frictionid.laws.contract import check_law
from frictionid.laws.coulomb_viscous import AsymmetricCoulombViscous, CoulombViscous
from frictionid.laws.dahl import Dahl
from frictionid.laws.ensemble import Ensemble, members_of
from frictionid.laws.film_lag import AsymmetricFilmLag, FilmLag
from frictionid.laws.gear_load import GearLoad, MotorLoadQuadratic
from frictionid.laws.library import Library
from frictionid.laws.load_dependent import LoadDependent, LoadDependentStribeck
from frictionid.laws.lstm import LSTM
from frictionid.laws.lugre import AsymmetricLuGre, LuGre
from frictionid.laws.mlp import MLP
from frictionid.laws.motor_load import MotorLoad
from frictionid.laws.none import NoFriction
from frictionid.laws.quadratic import Quadratic
from frictionid.laws.ripple import Ripple
from frictionid.laws.spline import AsymmetricSpline, Spline
from frictionid.laws.state_library import StateLibrary
from frictionid.laws.state_lstm import StateLSTM
from frictionid.laws.state_mlp import StateMLP
from frictionid.laws.stribeck import AsymmetricStribeck, Stribeck
from frictionid.laws.table import Table
from frictionid.laws.torch_module import TorchModule
from frictionid.laws.window_mlp import WindowMLP

__all__ = [
    "LSTM",
    "MLP",
    "AsymmetricCoulombViscous",
    "AsymmetricFilmLag",
    "AsymmetricLuGre",
    "AsymmetricSpline",
    "AsymmetricStribeck",
    "CoulombViscous",
    "Dahl",
    "Ensemble",
    "FilmLag",
    "GearLoad",
    "Library",
    "LoadDependent",
    "LoadDependentStribeck",
    "LuGre",
    "MotorLoad",
    "MotorLoadQuadratic",
    "NoFriction",
    "Quadratic",
    "Ripple",
    "Spline",
    "StateLSTM",
    "StateLibrary",
    "StateMLP",
    "Stribeck",
    "Table",
    "TorchModule",
    "WindowMLP",
    "check_law",
    "members_of",
]
