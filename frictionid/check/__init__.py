"""The verdict before fitting: what is wrong with the data, and what they can tell.

motion, rows, torque   smoothed states, momentum balances over windows, torques of the windows
regression             least squares of base parameters and friction; alone: one suspect at a time
facts                  plain facts of clock, joints and noise
sensors, stuck, commanded, conventions, delay, told, passive, excitation, published: one kind of
                       fault each
trial, identifiable, verdict  the order in which they are asked, and the answer
"""

from frictionid.check.findings import LEVELS, Finding
from frictionid.check.verdict import Verdict, check, judge

__all__ = ["LEVELS", "Finding", "Verdict", "check", "judge"]
