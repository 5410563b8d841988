"""Friction with inertia and sensors free, from the balance of torques: inverse dynamics."""

from .fit import fit_torques
from .method import InverseDynamics
from .solve import TorqueSettings
from .torque_balance import TorqueBalance, torque_balance
