"""Identifiers: fit the parameters of friction to one-step problems."""

from frictionid.fitting.identifiers.check_identifier import check_identifier
from frictionid.fitting.identifiers.least_squares import LeastSquares
from frictionid.fitting.identifiers.linear import Flexible, Linear
from frictionid.fitting.identifiers.published import BlackBox, Frictionless, Published
from frictionid.fitting.identifiers.regressor import Regressor
from frictionid.fitting.identifiers.sindy import SINDy, SparseDynamics
