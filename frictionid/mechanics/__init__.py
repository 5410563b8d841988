"""Equations of motion of mechanisms, derived from their bodies and compiled to scalar code."""

from frictionid.mechanics.axes import linear_axis, two_mass_axis, unit_inertia
from frictionid.mechanics.check_mechanism import check_mechanism
from frictionid.mechanics.description import Base, Body, Description
from frictionid.mechanics.from_bodies import Joint, from_bodies
from frictionid.mechanics.mechanism import Mechanism, Parameter, Partials, Terms, configurations
from frictionid.mechanics.mechanism_table import as_mechanism, mechanism_of
from frictionid.mechanics.mjcf_text import mjcf_of
from frictionid.mechanics.pendulum import pendulum
from frictionid.mechanics.plant import Plant
from frictionid.mechanics.rigid_body.described import mjcf, urdf
from frictionid.mechanics.rigid_body.rigid_body_tree import RigidBodyTree
from frictionid.mechanics.symbolic import SymbolicMechanism
from frictionid.mechanics.two_links import acrobot, double_pendulum
