"""Equations of motion of mechanisms, derived from their bodies and compiled to scalar code."""

from .built_in import acrobot, double_pendulum, linear_axis, two_mass_axis, unit_inertia
from .check_mechanism import check_mechanism
from .description import Base, Body, Description
from .from_bodies import Joint, from_bodies
from .mechanism import Mechanism, Parameter, Partials, configurations
from .mechanism_table import as_mechanism, mechanism_of, mjcf, urdf
from .mjcf_text import mjcf_of
from .pendulum import pendulum
from .plant import Plant
from .rigid_body.rigid_body_tree import RigidBodyTree
from .symbolic import SymbolicMechanism
