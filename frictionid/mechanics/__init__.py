"""Equations of motion of mechanisms, derived from their bodies and compiled to scalar code."""

from frictionid.mechanics.acrobot import acrobot
from frictionid.mechanics.check_mechanism import check_mechanism
from frictionid.mechanics.description import Base, Body, Description
from frictionid.mechanics.double_pendulum import double_pendulum
from frictionid.mechanics.linear_axis import linear_axis
from frictionid.mechanics.mechanism import Mechanism, Parameter, Partials, Terms
from frictionid.mechanics.mechanism_table import mechanism_of, parameters_of, with_defaults
from frictionid.mechanics.pendulum import pendulum
from frictionid.mechanics.plant import (
    NO_MOTOR_REMEDY,
    Plant,
    plant_of,
    refuse_torque_without_motor,
    torque_without_motor,
    unit_inertia_plant,
)
from frictionid.mechanics.rigid_body.described import mjcf, urdf
from frictionid.mechanics.rigid_body.rigid_body_tree import RigidBodyTree
from frictionid.mechanics.symbolic import SymbolicMechanism
from frictionid.mechanics.unit_inertia import unit_inertia

__all__ = [
    "NO_MOTOR_REMEDY",
    "Base",
    "Body",
    "Description",
    "Mechanism",
    "Parameter",
    "Partials",
    "Plant",
    "RigidBodyTree",
    "SymbolicMechanism",
    "Terms",
    "acrobot",
    "check_mechanism",
    "double_pendulum",
    "linear_axis",
    "mechanism_of",
    "mjcf",
    "parameters_of",
    "pendulum",
    "plant_of",
    "refuse_torque_without_motor",
    "torque_without_motor",
    "unit_inertia",
    "unit_inertia_plant",
    "urdf",
    "with_defaults",
]
