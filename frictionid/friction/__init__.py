"""Friction: a law and its parameters, and its torque along recorded motion.

law           what a friction law declares and computes
constraints   bounds and priors of parameters
friction      a law with its parameters, and its torque along recorded motion
laws          one friction law per file, and the check of laws of one's own
provenance    where numbers are from: data, fit, estimates with intervals, how the fit went
model_files   fitted models as files
bam_files     parameter files of BAM as frictions
"""

from .constraints import PEAK_SHOWN, Constraints, DataRange, Groups, constraints_of, present
from .friction import Friction, Nodes, along, along_own, memory_along, memory_at_nodes, units_of
from .law import Inputs, Law, LawParameter, Memory, at_rest, joined
