"""Shooting: friction, inertia and calibration from windows of the measured angles.

`refine` does all of it. Its steps, for problems of one's own:

    intervals = intervals_of(dataset)                                  the data
    problem = shooting_problem(intervals, estimate, blocks, settings)  what is free
    problem.linearise(estimate, nodes, rows)                           end states and derivatives
    solution = solve(problem, estimate, use)                           Gauss-Newton
    covariance_of(problem, solution)                                   intervals of the parameters

`solve_states` fits the motion alone, with all parameters fixed.
"""

from frictionid.fitting.shooting.calibrated_recipe import CalibratedRecipe
from frictionid.fitting.shooting.covariance import covariance_of
from frictionid.fitting.shooting.gauss_newton import Solution, solve
from frictionid.fitting.shooting.problem import Linearisation, ShootingProblem, shooting_problem
from frictionid.fitting.shooting.recipe import Shooting, refine_folds
from frictionid.fitting.shooting.refine import refine
from frictionid.fitting.shooting.sample_intervals import Intervals, intervals_of
from frictionid.fitting.shooting.servo import drive_of
from frictionid.fitting.shooting.settings import Settings
from frictionid.fitting.shooting.window_states import SampleWindows, solve_states
