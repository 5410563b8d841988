"""Models without physics, sparse and networks: known accelerations are found again."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures.black_box_pendulum import LENGTH, MASS, VISCOUS, acceleration, pendulum
from fixtures.compared import compare
from fixtures.exact_problems import fit_to_all
from fixtures.refusals import assert_refused
from scipy.integrate import solve_ivp

from frictionid.comparison.fit_model import fit_model
from frictionid.comparison.suite import identifier_named
from frictionid.data.plants import unit_inertia_plant
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.evaluation import Protocol, Split, make_folds, prepare, prepared_for, score_model
from frictionid.fitting.identifiers import BlackBox, SparseDynamics
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.one_step.recipe import INTEGRAL, training_problem
from frictionid.fitting.one_step.residual import mask_stiction
from frictionid.friction import Inputs, along
from frictionid.friction.laws import StateLibrary
from frictionid.friction.model_files import load_model, save_model
from frictionid.mechanics import Plant, unit_inertia
from frictionid.simulate import Camera

BOX = BlackBox(SparseDynamics(degree=2, n_standard_errors=2.0))


DATA = pendulum(Camera(240, 120.0, 1e-4))


@cache
def found():
    return fit_model(DATA, BOX, protocol=Protocol(history=0.0))


def test_the_equation_of_a_pendulum_is_found_and_nothing_else():
    law, theta = found().law, found().theta
    J = MASS * LENGTH**2
    wanted = {"sin1": 9.81 / LENGTH, "w1": VISCOUS / J, "u1": -1 / J}
    got = {name: -value for name, value in zip(law.names, theta[0], strict=True) if value != 0}
    assert set(got) == set(wanted)
    # theta is a sum in the acceleration, Tf its negative
    for name, value in wanted.items():
        assert got[name] == pytest.approx(value, rel=0.05)


def test_what_it_finds_predicts_as_the_truth_does():
    box = found()
    start, u = State(np.array([0.8]), np.array([0.0])), np.full((120, 1), 0.3)
    dt = np.full(120, 1 / 120)
    q = rollout(Plant.from_parameters(unit_inertia(("rad",)), {}), box, start, u, dt).q[:, 0]
    true = solve_ivp(lambda _, x: [x[1], acceleration(*x, 0.3)], (0.0, 1.0), [0.8, 0.0], rtol=1e-8)
    assert q[-1] == pytest.approx(true.y[0, -1], abs=0.01)


def test_unit_mechanism_knows_nothing_of_the_machine():
    problem = synthetic_problem(2)
    friction = BOX.fit(problem, synthetic_weights(problem), 0)
    assert friction.mechanism == "unit" and not friction.parameters
    M, h = unit_inertia(("rad", "rad")).dynamics(np.ones(1), np.ones(2), np.ones(2))
    assert np.array_equal(M, np.eye(2)) and not h.any() and not unit_inertia(("rad", "rad")).B.any()


def test_scores_do_not_hang_on_what_is_told_of_the_machine():
    other = replace(
        DATA, mechanism={"kind": "pendulum", "parameters": {"mass": 9.0, "length": 0.7}}
    )
    protocol = Protocol(horizons=(0.25,), every=0.5)
    scores = [
        score_model(found(), prepared_for(prepare(d, protocol), found()))[0] for d in (DATA, other)
    ]
    assert scores[0].equals(scores[1])
    assert "curve_error" not in set(scores[0].score)


def test_a_file_of_an_unknown_mechanism_is_refused(tmp_path):
    save_model(found(), tmp_path / "box.json")
    text = (tmp_path / "box.json").read_text()
    (tmp_path / "box.json").write_text(text.replace('"mechanism": "unit"', '"mechanism": "moon"'))
    with assert_refused("mechanism = 'moon' must be"):
        load_model(tmp_path / "box.json")


def test_monomials_are_products_of_their_variables():
    law = StateLibrary(joints=2, degree=3)
    rng = np.random.default_rng(0)
    q, w, u = rng.normal(size=(3, 7, 2))
    f = dict(zip(law.names, law.features(Inputs(q, w, u, 0 * u)).T, strict=True))
    assert np.allclose(f["sin1*cos2*w2"], np.sin(q[:, 0]) * np.cos(q[:, 1]) * w[:, 1])
    assert np.allclose(f["w1^2*u2"], w[:, 0] ** 2 * u[:, 1])
    assert not {"cos1^2", "s1^2", "u1^2", "u1*u2"} & set(f)
    assert len(law.units) == len(f) == len(set(f))


def test_more_joints_than_it_knows_change_nothing():
    law, rng = StateLibrary(joints=1, degree=2), np.random.default_rng(1)
    theta = rng.normal(size=(2, len(law.names)))
    q, w, u = rng.normal(size=(3, 5, 2))
    one = law.features(Inputs(q[:, :1], w[:, :1], u[:, :1], u[:, :1]))
    two = law.torque(theta, Inputs(q, w, u, u), ())
    assert np.allclose(two, -one @ theta.T)


def test_the_equation_has_an_interval_behind_each_coefficient():
    law = StateLibrary(joints=1, degree=1)
    theta, half = np.array([[3.0, -20.0, 0.0, -0.5, 0.0, 8.0]]), np.full((1, 6), 0.25)
    half[0, 3] = np.inf
    (line,) = law.equation(theta, half)
    assert line == "dw1/dt = (3 +- 0.25) - (20 +- 0.25) sin1 - 0.5 w1 + (8 +- 0.25) u1"
    assert law.equation(-theta)[0] == "dw1/dt = -3 + 20 sin1 + 0.5 w1 - 8 u1"
    assert law.equation(0 * theta) == ["dw1/dt = 0"]


# --- Networks -------------------------------------------------------------------------------------

KINDS = ["blackbox_mlp", "blackbox_lstm"]
# Errors that each stays below: of acceleration, relative, and of the angle after 0.25 s [rad].
ERRORS = {"blackbox_mlp": (0.1, 0.1), "blackbox_lstm": (0.2, 0.2)}
EACH = pytest.mark.parametrize("kind", KINDS)


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


@EACH
def test_the_acceleration_of_a_pendulum_is_learned(kind):
    nodes = training_problem(pendulum(), unit_inertia_plant(pendulum()), INTEGRAL).nodes
    true = acceleration(*nodes.inputs[:3])
    error = -along(compared(kind).overall, nodes) - true
    assert np.sqrt(np.mean(error**2)) < ERRORS[kind][0] * np.sqrt(np.mean(true**2))


@EACH
def test_it_predicts_what_was_held_out(kind):
    result = compared(kind)
    changes = training_problem(pendulum(), unit_inertia_plant(pendulum()), INTEGRAL).r
    assert result.value("one_step_integral", "rms") < 0.5 * np.sqrt(np.mean(changes**2))
    assert result.value("rollout_angle", "median", 0.25) < ERRORS[kind][1]
    assert np.isnan(result.curves).all()  # it is no friction curve


@EACH
def test_problems_with_masked_rows_are_refused(kind):
    problem = mask_stiction(synthetic_problem(1), 1.0)
    with assert_refused("velocity_threshold = 0"):
        fit_to_all(box(kind), problem)
