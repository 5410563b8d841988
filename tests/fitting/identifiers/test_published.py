"""The identifier `published`: other people's friction, as it stands in their file."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.paths import DATA
from fixtures.refusals import assert_refused
from numpy.testing import assert_array_equal

from frictionid.comparison.suite import identifier_named
from frictionid.fitting.identifiers import Published
from frictionid.fitting.identifiers.check_identifier import (
    synthetic_problem,
    synthetic_weights,
)
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous

DFKI = DATA / "dfki_c1"
NUMBERS = np.array([[0.3, 0.01], [0.1, 0.02]])
OTHERS = Friction(CoulombViscous(), NUMBERS, {"m1": 0.5}, {"source": "a paper"})


def test_it_is_the_same_in_every_fold_whatever_data_weights_and_seed():
    problem = synthetic_problem(2)
    other = replace(problem, r=problem.r + 1.0)
    found = Published(OTHERS).fit(problem, synthetic_weights(problem), 0)
    again = Published(OTHERS).fit(other, np.ones((3, len(problem.r))), 5)
    assert_array_equal(found.theta, np.broadcast_to(NUMBERS, (3, 2, 2)))
    assert_array_equal(again.theta, found.theta)
    assert (found.law, found.parameters) == (OTHERS.law, {"m1": 0.5})
    assert found.provenance.notes == {"source": "a paper"}
    found.theta[...] = 0.0  # nobody can change the published numbers through a fit
    assert OTHERS.theta.all()


@pytest.mark.parametrize(
    ("friction", "joints"),
    [(OTHERS, 1), (OTHERS[:1], 2), (replace(OTHERS, theta=NUMBERS[None]), 2)],
)
def test_friction_of_another_number_of_joints_or_of_many_folds_is_refused(friction, joints):
    problem = synthetic_problem(joints)
    with assert_refused(rf"theta of shape .*, the data {joints} joints"):
        Published(friction).fit(problem, synthetic_weights(problem), 0)


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_the_models_of_the_real_acrobot_hold_friction_and_their_own_inertias(version):
    made = identifier_named("published", {"file": str(DFKI / f"model_{version}.json")})
    problem = synthetic_problem(2)
    found = made.fit(problem, synthetic_weights(problem), 0)
    assert found.theta.shape == (3, 2, len(found.law.names))
    assert {"m1", "m2", "l1", "I1", "I2"} <= set(found.parameters)
    level = found.law.limit(found.theta[0], problem.nodes.inputs, ())
    assert ((level > 0.01) & (level < 1.0)).all()
