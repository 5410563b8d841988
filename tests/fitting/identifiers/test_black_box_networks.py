"""Networks without physics: a known acceleration found again, files, seeds, refusals."""

from functools import cache

import numpy as np
import pytest
from fixtures.black_box_pendulum import acceleration, pendulum
from fixtures.compared import compare
from fixtures.refusals import assert_refused

from frictionid.comparison.suite import identifier_named
from frictionid.data.plants import unit_inertia_plant
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.fitting.one_step.formulation import INTEGRAL, training_problem
from frictionid.fitting.one_step.residual import mask_stiction
from frictionid.friction import along

KINDS = ["blackbox_mlp", "blackbox_lstm"]
# Errors that each stays below: of acceleration, relative, and of the angle after 0.25 s [rad].
ERRORS = {"blackbox_mlp": (0.1, 0.1), "blackbox_lstm": (0.2, 0.2)}
pytestmark = pytest.mark.parametrize("kind", KINDS)


@cache
def box(kind):
    return identifier_named(kind, {"hidden": [16], "epochs": 30, "batch": 32})


@cache
def compared(kind):
    """What a comparison makes of it, with the friction of all data."""
    folds = make_folds(pendulum().recordings, Split(count=2))
    protocol = Protocol((0.25,), every=0.5, history=0.0)
    (result,) = compare(pendulum(), {"box": box(kind)}, folds, protocol=protocol).values()
    return result


def test_the_acceleration_of_a_pendulum_is_learned(kind):
    nodes = training_problem(pendulum(), unit_inertia_plant(pendulum()), INTEGRAL).nodes
    true = acceleration(*nodes.inputs[:3])
    error = -along(compared(kind).overall, nodes) - true
    assert np.sqrt(np.mean(error**2)) < ERRORS[kind][0] * np.sqrt(np.mean(true**2))


def test_it_predicts_what_was_held_out(kind):
    result = compared(kind)
    changes = training_problem(pendulum(), unit_inertia_plant(pendulum()), INTEGRAL).r
    assert result.value("one_step_integral", "rms") < 0.5 * np.sqrt(np.mean(changes**2))
    assert result.value("rollout_angle", "median", 0.25) < ERRORS[kind][1]
    assert np.isnan(result.curves).all()  # it is no friction curve


def test_problems_with_masked_rows_are_refused(kind):
    problem = mask_stiction(synthetic_problem(1), 1.0)
    with assert_refused("velocity_threshold = 0"):
        box(kind).fit(problem, np.ones((1, len(problem.r))), 0)
