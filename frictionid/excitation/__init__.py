"""Design of experiments: torque signals that identify friction and inertia, within limits."""

from frictionid.excitation.design import Design, MonteCarlo, design_signals, monte_carlo
from frictionid.excitation.experiment import Experiment, load_mechanism
from frictionid.excitation.information import (
    Information,
    covariances,
    expected_information,
    standard_errors,
)
from frictionid.excitation.limits import Limits, limits_of
from frictionid.excitation.motion import Motions, predict_motions
from frictionid.excitation.prior_friction import prior_friction_of
from frictionid.excitation.search import Search, search_signals
from frictionid.excitation.signals import SignalSpace
from frictionid.excitation.trajectory_design import (
    TrajectoryDesign,
    TrajectoryTask,
    design_trajectories,
)
