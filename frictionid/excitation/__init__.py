"""Design of experiments: torque signals that identify friction and inertia, within limits."""

from frictionid.excitation.design import (
    Design,
    Search,
    design_signals,
    monte_carlo,
)
from frictionid.excitation.experiment import (
    Experiment,
    limits_of,
    load_mechanism,
    prior_friction_of,
)
from frictionid.excitation.information import (
    Information,
    covariances,
    expected_information,
    standard_errors,
)
from frictionid.excitation.signals import Motions, SignalSpace, predict_motions
from frictionid.excitation.trajectory_design import (
    TrajectoryDesign,
    TrajectoryTask,
    design_trajectories,
)
