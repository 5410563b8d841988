"""Which torque to apply next: signals that tell friction and inertia apart, within limits."""

from frictionid.excitation.advice import Advice, advise
from frictionid.excitation.experiment import Experiment, mechanism_in
from frictionid.excitation.information import Expected, covariances, expected, standard_errors
from frictionid.excitation.limits import Limits, limits_of
from frictionid.excitation.monte_carlo import Repeated, repeated
from frictionid.excitation.motion import Motions, moved
from frictionid.excitation.prior_friction import guessed
from frictionid.excitation.search import Search, best
from frictionid.excitation.signals import Waves

__all__ = [
    "Advice",
    "Expected",
    "Experiment",
    "Limits",
    "Motions",
    "Repeated",
    "Search",
    "Waves",
    "advise",
    "best",
    "covariances",
    "expected",
    "guessed",
    "limits_of",
    "mechanism_in",
    "moved",
    "repeated",
    "standard_errors",
]
