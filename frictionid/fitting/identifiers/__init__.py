"""Identifiers: fit the parameters of friction to one-step problems."""

from .check_identifier import check_identifier
from .least_squares import Flexible, LeastSquares
from .published import BlackBox, Frictionless, Published
from .regressor import Regressor
from .sindy import SINDy, SparseDynamics
