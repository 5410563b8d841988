"""Checks of recordings before any fit: what is wrong with them, and what they identify.

findings, findings.toml   what a check can say
motion                    smoothed motion, and momentum balances over short windows
regression                least squares of base parameters and friction; somebody's model
partial_regression        one suspected error at a time, beside unknown friction
facts                     clock, joints, noise and steps of signals
sensors, log_faults       faults of the readings and of the log
conventions, time_unit    signs, joints, zeros, frames and units, each a map of the data
hypothesis_tests          conventions, delay, model_errors: errors against the nominal mechanism
machine_faults            end stops; friction that grows or falls in the course of the recordings
passive                   energy without input, loads at rest, torques that equal gravity
torque_source, servos     where the torque comes from
questions                 answers, also where nothing is wrong; what to record next
verdict                   the sequence of all checks; recordings with a fault of their own
"""

from .findings import LEVELS, Finding
from .torque_source import source_sentences, torque_sources
from .verdict import Verdict, check, judge
