"""Friction with inertia and sensors free, from the balance of torques: inverse dynamics."""

from frictionid.fitting.torque_balance.fit import fit_torques
from frictionid.fitting.torque_balance.method import InverseDynamics
from frictionid.fitting.torque_balance.solve import TorqueSettings
from frictionid.fitting.torque_balance.torque_balance import TorqueBalance, torque_balance
