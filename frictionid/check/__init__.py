"""Checks of recordings before any fit: what is wrong with them, and what they identify.

motion, balances, balance_windows
                          smoothed motion, and momentum balances over short windows
regression                least squares of base parameters and friction
partial_regression        one suspected error at a time, beside unknown friction
facts                     clock, joints and noise
fine_structure, torque_source, torque_place, gravity_model, unmeasured
                          noise and steps of a signal; where the torque comes from
sensors, log_faults       faults of the readings and of the log
hypothesis_tests          conventions, delay, model_errors: errors against the nominal mechanism
rivals                    which of them the data single out
passive                   energy without input, loads at rest
coverage, published       missing motion, advice; somebody's model
questions, identifiable   answers, also where nothing is wrong
verdict                   the sequence of all checks
"""

from frictionid.check.findings import LEVELS, Finding
from frictionid.check.torque_source import TorqueSource, torque_sources
from frictionid.check.verdict import Verdict, check, judge
