"""Equations of motion of mechanisms, derived from their bodies and compiled to scalar code."""

from .axes import linear_axis, two_mass_axis, unit_inertia
from .check_mechanism import check_mechanism
from .description import Base, Body, Description
from .from_bodies import Joint, from_bodies
from .mechanism import Mechanism, Parameter, Partials, configurations
from .mechanism_table import as_mechanism, mechanism_of
from .mjcf_text import mjcf_of
from .pendulum import pendulum
from .plant import Plant
from .rigid_body.described import mjcf, urdf
from .rigid_body.rigid_body_tree import RigidBodyTree
from .symbolic import SymbolicMechanism
from .two_links import acrobot, double_pendulum
