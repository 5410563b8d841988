"""Identifiers: fit the parameters of friction to one-step problems, one per file."""

from frictionid.identifiers.black_box import BlackBox
from frictionid.identifiers.check_identifier import check_identifier
from frictionid.identifiers.frictionless import Frictionless
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.least_squares import LeastSquares
from frictionid.identifiers.linear import Linear
from frictionid.identifiers.networks.compressed import CompressedNetwork
from frictionid.identifiers.networks.network import Network
from frictionid.identifiers.networks.state_network import StateNetwork
from frictionid.identifiers.published import Published
from frictionid.identifiers.regressor import Regressor
from frictionid.identifiers.sindy import SINDy
from frictionid.identifiers.sparse_dynamics import SparseDynamics

__all__ = [
    "BlackBox",
    "CompressedNetwork",
    "Frictionless",
    "Identifier",
    "LeastSquares",
    "Linear",
    "Network",
    "Published",
    "Regressor",
    "SINDy",
    "SparseDynamics",
    "StateNetwork",
    "check_identifier",
]
