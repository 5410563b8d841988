"""Design of experiments: torque signals that identify friction and inertia, within limits."""

from .design import Design, Search, design_signals, monte_carlo
from .experiment import Experiment, limits_of, load_mechanism, prior_friction_of
from .information import Information, Motions, covariances, expected_information, predict_motions
from .trajectory_design import TrajectoryDesign, TrajectoryTask, design_trajectories
