"""Friction with inertia and sensors free, from the balance of torques: inverse dynamics."""

from frictionid.inverse_dynamics.fit import fit_torques
from frictionid.inverse_dynamics.method import InverseDynamics
from frictionid.inverse_dynamics.settings import TorqueSettings
from frictionid.inverse_dynamics.torque_balance import TorqueBalance, torque_balance

__all__ = [
    "InverseDynamics",
    "TorqueBalance",
    "TorqueSettings",
    "fit_torques",
    "torque_balance",
]
