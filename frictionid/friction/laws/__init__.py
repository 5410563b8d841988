"""Friction laws; those that share their terms stand in one file."""

from .check_law import check_law
from .combined import PerJoint, Sum
from .curves import Spline, Table
from .external import TorchModule
from .levels import NoFriction
from .library import Library
from .load import GearLoad, LoadDependent, MotorLoad
from .mlp import LSTM, MLP, Ensemble, WindowMLP
from .modulated import Play, Ripple, Thermal
from .position_torques import Cogging, Spring
from .relaxing import Dahl, FilmLag, LuGre
from .state_laws import StateLibrary, StateLSTM, StateMLP
from .stribeck import CoulombViscous, Quadratic, Stribeck
