"""The identifier `coulomb_viscous`: least squares in its plainest form, which is linear."""

import numpy as np
import pytest
from fixtures.exact_problems import (
    by_scipy,
    cost,
    everything,
    explained_by,
    standard_errors,
    stationarity,
)

from frictionid.arrays import times
from frictionid.comparison.registry import LAWS
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.synthetic_problem import synthetic_problem, synthetic_weights
from frictionid.friction import Friction
from frictionid.friction.law import smooth_sign
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import load_model, save_model

LAW = CoulombViscous()
TRUTH = np.array([[0.10, 0.02], [0.05, 0.01]])


def fit(problem, weights, law=LAW):
    return LeastSquares(law).fit(problem, weights, 0)


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("shape", ["tanh", "arctan"])
@pytest.mark.parametrize("theta", [TRUTH, 10 * TRUTH, TRUTH * [1.0, 0.0], TRUTH * [0.0, 1.0]])
def test_truth_in_truth_out(n, shape, theta):
    law = CoulombViscous(width=0.05, shape=shape)
    problem = explained_by(law, theta[:n])
    found = fit(problem, everything(problem), law)
    np.testing.assert_allclose(found.theta[0], theta[:n], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_with_noise_the_truth_is_within_four_standard_errors(seed):
    problem = explained_by(LAW, TRUTH, 0.01, np.random.default_rng(seed))
    found = fit(problem, everything(problem)).theta[0]
    error = standard_errors(LAW, TRUTH, problem, 0.01)
    assert (np.abs(found - TRUTH) < 4 * error).all()
    assert (np.abs(found - TRUTH) > 1e-3 * error).any()


def test_where_no_bound_holds_it_is_the_weighted_normal_equations():
    problem = synthetic_problem(2)
    weights = synthetic_weights(problem)
    w = problem.nodes.inputs.w
    columns = []
    for feature in (smooth_sign(w, LAW.width), w):
        for j in range(2):
            columns.append(times(problem.G, problem.mean(feature * (np.arange(2) == j))))
    J = np.stack(columns, axis=-1)
    for f, theta in enumerate(fit(problem, weights).theta):
        root = np.sqrt(weights[f])[:, None]
        A, b = (J * root[..., None]).reshape(-1, 4), (problem.r * root).ravel()
        exact = np.linalg.lstsq(A, b)[0].reshape(2, 2).T
        np.testing.assert_allclose(theta, exact, rtol=1e-10)


def test_each_fold_is_scipys_least_squares():
    problem = synthetic_problem(2)
    weights = synthetic_weights(problem)
    for f, theta in enumerate(fit(problem, weights).theta):
        same = by_scipy(LAW, problem, weights[f], TRUTH)
        np.testing.assert_allclose(theta, same, rtol=1e-6)


@pytest.mark.parametrize("theta", [[[0.1, -0.01]], [[-0.05, 0.02]], [[-0.1, -0.1]]])
def test_coefficients_stay_positive_where_the_data_want_them_negative(theta):
    problem = explained_by(LAW, theta, 1e-3, np.random.default_rng(0))
    weights = everything(problem)
    found = fit(problem, weights)
    assert (found.theta >= 0).all()
    assert (found.theta == 0).any()
    assert np.abs(stationarity(LAW, problem, weights[0], found.theta[0])).max() < 1e-10
    for change in np.eye(2)[:, None] * 1e-4:  # the best within the bounds
        assert cost(problem, weights, Friction(LAW, found.theta + change)) > cost(
            problem, weights, found
        )


def test_a_level_of_an_arctangent_is_its_level_at_high_speed():
    theta = np.array([[0.1, 0.0]])
    law = CoulombViscous(width=0.01, shape="arctan")
    w = synthetic_problem(1).nodes.inputs.w
    published = 0.1 / (np.pi / 2) * np.arctan(100 * w)  # as others write it: cf = level/(pi/2)
    problem = explained_by(law, theta)
    mean = times(problem.G, problem.mean(published))
    np.testing.assert_allclose(problem.r, mean, rtol=1e-12)
    np.testing.assert_allclose(fit(problem, everything(problem), law).theta[0], theta, atol=1e-12)


def test_it_prints_itself_with_units_and_comes_back_from_its_file(tmp_path):
    problem = explained_by(LAW, TRUTH)
    found = fit(problem, np.repeat(everything(problem), 3, axis=0))
    assert str(found[0]).splitlines()[1] == "  joint 1  coulomb 0.1 N m, viscous 0.02 N m s/rad"
    assert "coulomb 0.05 +- " in str(found)
    for friction in (found, found[1]):
        save_model(friction, tmp_path / "model.json", LAWS)
        again = load_model(tmp_path / "model.json", LAWS)
        assert again.law == LAW
        np.testing.assert_array_equal(again.theta, friction.theta)
