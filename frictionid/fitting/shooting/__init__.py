"""Shooting: friction, inertia and calibration from windows of the measured angles.

`refine` does all of it. Its steps, for problems of one's own:

    intervals = intervals_of(dataset)                                  the data
    problem = shooting_problem(intervals, estimate, blocks, settings)  what is free
    problem.linearise(estimate, nodes, rows)                           end states and derivatives
    solution = solve(problem, estimate, use)                           Gauss-Newton
    solution.covariance()                                              intervals of the parameters

`solve_states` fits the motion alone, with all parameters fixed.
"""

from .gauss_newton import solve
from .problem import Linearisation, ShootingProblem, shooting_problem
from .recipe import CalibratedRecipe, Shooting, refine_folds
from .refine import refine
from .sample_intervals import Intervals, intervals_of
from .servo import drive_of
from .settings import Settings
from .window_states import SampleWindows, solve_states
from .windows import Solution
