"""Friction laws, one per file."""

from frictionid.friction.laws.check_law import check_law
from frictionid.friction.laws.coulomb_viscous import (
    CoulombViscous,
    NoFriction,
    Quadratic,
)
from frictionid.friction.laws.dahl import Dahl
from frictionid.friction.laws.ensemble import Ensemble, members_of
from frictionid.friction.laws.film_lag import FilmLag
from frictionid.friction.laws.gear_load import GearLoad
from frictionid.friction.laws.library import Library
from frictionid.friction.laws.linear_outside import LinearOutside
from frictionid.friction.laws.load_dependent import LoadDependent
from frictionid.friction.laws.lstm import LSTM
from frictionid.friction.laws.lugre import LuGre
from frictionid.friction.laws.mlp import MLP
from frictionid.friction.laws.motor_load import MotorLoad
from frictionid.friction.laws.per_joint import PerJoint
from frictionid.friction.laws.play import Play
from frictionid.friction.laws.ripple import Ripple
from frictionid.friction.laws.spline import Spline
from frictionid.friction.laws.state_library import StateLibrary
from frictionid.friction.laws.state_networks import StateLSTM, StateMLP
from frictionid.friction.laws.stribeck import Stribeck
from frictionid.friction.laws.sum import Sum
from frictionid.friction.laws.table import Table
from frictionid.friction.laws.thermal import Thermal
from frictionid.friction.laws.torch_module import TorchModule
from frictionid.friction.laws.window_mlp import WindowMLP
