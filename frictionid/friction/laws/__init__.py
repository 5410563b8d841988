"""Friction laws; those that share their terms stand in one file."""

from frictionid.friction.laws.check_law import check_law
from frictionid.friction.laws.cogging import Cogging
from frictionid.friction.laws.combined import PerJoint, Sum
from frictionid.friction.laws.curves import Spline, Table
from frictionid.friction.laws.ensemble import Ensemble, members_of
from frictionid.friction.laws.external import TorchModule
from frictionid.friction.laws.levels import NoFriction
from frictionid.friction.laws.library import Library
from frictionid.friction.laws.load import GearLoad, LoadDependent, MotorLoad
from frictionid.friction.laws.lstm import LSTM
from frictionid.friction.laws.mlp import MLP, WindowMLP
from frictionid.friction.laws.play import Play
from frictionid.friction.laws.relaxing import Dahl, FilmLag, LuGre
from frictionid.friction.laws.ripple import Ripple
from frictionid.friction.laws.state_laws import StateLibrary, StateLSTM, StateMLP
from frictionid.friction.laws.stribeck import CoulombViscous, Quadratic, Stribeck
from frictionid.friction.laws.thermal import Thermal
