"""The identifier `sklearn`, taught the torque that rows leave to friction; harmonics."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from drive_logs import ServoPendulum
from fixtures.changed_data import changed
from fixtures.exact_problems import STRIBECK as TRUTH
from fixtures.exact_problems import everything, explained_by
from fixtures.refusals import assert_refused
from fixtures.servo_logs import by_torque
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.dummy import DummyRegressor
from sklearn.kernel_ridge import KernelRidge
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import KNeighborsRegressor

import frictionid as fid
from frictionid.data.plants import plant_of
from frictionid.fitting.identifiers import LeastSquares, Regressor
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.identifiers.regressor import NAMED, estimator_named, torques
from frictionid.fitting.identifiers.start_of_fit import harmonics, with_harmonics
from frictionid.fitting.one_step.recipe import INTEGRAL, training_problem
from frictionid.fitting.one_step.residual import mask_stiction
from frictionid.friction import Friction, along, present
from frictionid.friction.laws import Cogging, CoulombViscous, Ripple, Stribeck, Sum
from frictionid.friction.model_files import save_model

SPEEDS = np.array([0.6, 1.0, 2.0, 3.5])
RIDGE = KernelRidge(alpha=0.01, kernel="rbf", gamma=1.0)


def fit(problem, estimator=RIDGE, weights=None, seed=0, **settings):
    weights = everything(problem) if weights is None else weights
    return Regressor(estimator, **settings).fit(problem, weights, seed)


@pytest.mark.parametrize("n", [1, 2])
def test_torques_of_rows_are_the_mean_true_torques(n):
    problem = explained_by(Stribeck(), TRUTH[:n])
    x, torque, share = torques(problem)
    true = along(Friction(Stribeck(), TRUTH[:n]), problem.nodes)
    assert_allclose(torque, problem.mean(true), atol=1e-10)
    assert_allclose(x.w, problem.mean(problem.nodes.inputs.w))
    assert (share > 0).all()


def test_shares_are_inverse_variances_and_joints_at_rest_have_none():
    problem = mask_stiction(synthetic_problem(2), 0.5)
    still = ~problem.G.any(axis=1)
    assert still.any() and not still.all()
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((4000, *problem.r.shape))
    _, _, share = torques(problem)
    assert (share[still] == 0).all() and (share[~still] > 0).all()
    some = np.flatnonzero(~still.any(axis=1))[:5]
    for k in some:
        drawn = noise[:, k] @ np.linalg.pinv(problem.G[k]).T
        assert_allclose(drawn.var(axis=0), 1.0 / share[k], rtol=0.15)


@pytest.mark.parametrize("name", NAMED)
def test_each_named_estimator_finds_the_curve(name):
    problem = explained_by(Stribeck(), TRUTH)
    found = fit(problem, estimator_named(name, {}))[0]
    for side in (1.0, -1.0):
        true = Friction(Stribeck(), TRUTH).curve(side * SPEEDS)
        assert_allclose(found.curve(side * SPEEDS), true, rtol=0.2)
    assert found.law.names[0].startswith("up_")


def test_a_linear_regression_in_sign_and_speed_finds_coulomb_friction():
    problem = explained_by(CoulombViscous(), [[0.1, 0.0], [0.05, 0.0]])
    found = fit(problem, LinearRegression())[0]
    curve = found.curve(np.array([-3.0, -1.0, 1.0, 3.0]))
    assert_allclose(curve, np.outer([-1, -1, 1, 1], [0.1, 0.05]), rtol=0.05)


def test_the_curve_holds_beyond_the_data_and_friction_does_not_drive():
    problem = explained_by(Stribeck(), TRUTH)
    found = fit(problem)[0]
    fastest = np.abs(problem.nodes.inputs.w).max()
    far = found.curve(np.array([fastest, 2 * fastest, 50.0]))
    assert_allclose(far[1:], far[:1].repeat(2, axis=0))
    driving = replace(problem, r=-problem.r)
    w = np.linspace(-9, 9, 80)
    assert (fit(driving)[0].curve(w) * w[:, None] >= 0).all()


def test_the_seed_goes_to_the_estimator():
    problem = explained_by(Stribeck(), TRUTH, 1e-3)
    forest = estimator_named("random_forest", {"n_estimators": 5})
    one, same, other = (fit(problem, forest, seed=seed).theta for seed in (1, 1, 2))
    assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    assert forest.random_state is None


def test_fewer_bins_are_means_of_more_rows():
    problem = explained_by(Stribeck(), TRUTH, 2e-3)
    flat = fit(problem, DummyRegressor(), bins=3).theta
    assert_allclose(flat, fit(problem, DummyRegressor(), bins=80).theta, atol=1e-9)
    assert not np.array_equal(fit(problem, bins=10).theta, fit(problem, bins=80).theta)


def test_with_angle_and_torque_it_sees_what_a_curve_cannot():
    law = Ripple()
    truth = np.array([[0.1, 0.01, 0.0, 0.6]])
    problem = explained_by(law, truth)
    true = problem.mean(along(Friction(law, truth), problem.nodes))
    errors = []
    for inputs in (("w",), ("w", "q")):
        found = fit(problem, KNeighborsRegressor(3), inputs=inputs)
        errors.append(np.abs(problem.mean(along(found, problem.nodes))[0] - true).mean())
    assert errors[1] < 0.6 * errors[0]


def test_with_other_inputs_it_is_not_saved(tmp_path):
    problem = synthetic_problem(2)
    found = fit(problem, KNeighborsRegressor(5), synthetic_weights(problem), inputs=("w", "q", "u"))
    torque = along(found, problem.nodes)
    for f in range(len(torque)):
        assert_array_equal(along(found[f], problem.nodes), torque[f])
    with assert_refused("cannot be saved: regressors of more than the velocity"):
        save_model(found, tmp_path / "model.json")
    assert not list(tmp_path.iterdir())


def test_a_joint_that_never_slides_is_refused():
    problem = synthetic_problem(2)
    G = problem.G.copy()
    G[:, :, 1] = 0.0
    with assert_refused("joint 2 slides in no row"):
        fit(replace(problem, G=G))


def test_in_a_fold_in_which_it_rests_a_joint_has_no_friction():
    problem = synthetic_problem(2)
    G = problem.G * np.where(problem.recording == 1, [[1.0], [0.0]], 1.0).T[:, None]
    only = (problem.recording == np.arange(3)[:, None]).astype(float)
    theta = fit(replace(problem, G=G), weights=only).theta
    assert (theta[1, 1] == 0.0).all() and theta[[0, 1, 2], [1, 0, 1]].any(axis=-1).all()


@pytest.mark.parametrize(("neighbours", "bins"), [(1000, 200), (9, 2)])
def test_what_an_estimator_says_only_when_it_learns_is_one_line_too(neighbours, bins):
    with assert_refused(r"cannot learn from \d+ samples: .*n_neighbors"):
        fit(synthetic_problem(1), KNeighborsRegressor(neighbours), bins=bins)


def test_estimators_inside_others_and_of_ones_own_are_regressors():
    from sklearn.pipeline import make_pipeline

    class Own:
        def fit(self, x, y):
            return self

        def predict(self, x):
            return x[:, 0]

    for estimator in (make_pipeline(LinearRegression()), Own()):
        assert Regressor(estimator).estimator is estimator


# --- Harmonics ------------------------------------------------------------------------------------

WAVES = ((6, 0.02, 0.6), (12, 0.01, -1.2))
LAW = Sum(("coulomb_viscous", Cogging("auto")))


@cache
def dataset(waves=(), seed=0, gear=1, **rig):
    own = ServoPendulum(waves=tuple((gear * k, size, phase) for k, size, phase in waves), **rig)
    logs = {f"{k}": own.log(20.0, 0.2, seed=100 * seed + k, seconds=6.0) for k in range(4)}
    return by_torque(own, logs)


def chosen(data, law):
    problem = training_problem(data, plant_of(data), INTEGRAL)
    has = harmonics(law, problem, everything(problem))[0, 0]
    return tuple(np.array(law.orders)[has].tolist())


def wave(friction, k):
    """Amplitude and phase of a harmonic."""
    values = dict(zip(friction.law.names, friction.theta[0], strict=True))
    cos, sin = values[f"cos_{k}"], values[f"sin_{k}"]
    return np.hypot(cos, sin), np.arctan2(-sin, cos)


@pytest.mark.parametrize("seed", range(4))
def test_those_of_the_truth_are_chosen(seed):
    assert chosen(dataset(WAVES, seed), Cogging("auto")) == (6, 12)


@pytest.mark.parametrize("order", [25, 84])
def test_orders_of_brushless_motors_are_found(order):
    assert chosen(dataset(((order, 0.02, 0.6),)), Cogging("auto")) == (order,)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "law", [Cogging("auto"), Ripple(harmonics="auto")], ids=["cogging", "ripple"]
)
def test_none_is_chosen_where_there_is_none(law, seed):
    assert chosen(dataset((), seed), law) == ()


@pytest.mark.parametrize("law", [Cogging("auto"), Ripple(harmonics="auto")])
def test_without_torque_gravity_and_inertia_leave_nothing_to_a_wave(law):
    """The search ends, too, where what is left is rounding."""
    assert chosen(changed(dataset(WAVES), "torque", np.zeros_like), law) == ()


def test_a_joint_that_does_not_go_through_a_wave_shows_none():
    data = dataset(((1, 0.02, 0.6),))
    assert max(np.ptp(r.angle.value) for r in data.recordings) < 2 * np.pi
    assert 1 not in chosen(data, Cogging("auto"))


def test_behind_a_gear_they_are_those_of_the_motor():
    data = dataset(((7, 0.01, 0.3),), gear=9)
    assert chosen(data, Cogging("auto", gear=9.0)) == (7,)


@pytest.mark.parametrize("method", ["one_step", "shooting"])
def test_amplitude_and_phase_are_within_5_percent(method):
    friction = fid.fit(dataset(WAVES), LAW, method=method).friction
    assert friction.law == with_harmonics(LAW, (6, 12))
    for k, size, phase in WAVES:
        assert wave(friction, k) == pytest.approx((size, phase), rel=0.05)


def test_a_law_without_any_is_the_law_below():
    friction = fid.fit(dataset(), LAW, method="one_step").friction
    assert friction.law == CoulombViscous()
    friction = fid.fit(
        dataset(), "ripple", settings={"harmonics": "auto"}, method="one_step"
    ).friction
    assert friction.law == CoulombViscous()


def test_each_fold_chooses_by_its_own_rows():
    waved, plain = dataset(WAVES), dataset()
    others = (replace(r, name=f"plain {r.name}") for r in plain.recordings)
    both = replace(waved, recordings=(*waved.recordings, *others))
    problem = training_problem(both, plant_of(both), INTEGRAL)
    first = problem.recording < len(waved.recordings)
    fit = LeastSquares(LAW).fit(problem, np.stack([first, ~first]) + 0.0, 0)
    assert fit.law == with_harmonics(LAW, (6, 12))
    assert fit.theta[0].all() and not fit.theta[1, 0, 2:].any()
    alone = LeastSquares(CoulombViscous()).fit(problem, (~first)[None] + 0.0, 0)
    assert_allclose(fit.theta[1, 0, :2], alone.theta[0, 0], rtol=1e-6)


def test_other_joints_keep_to_what_they_show():
    """Terms that friction does not have are neither printed nor freed nor counted."""
    law = with_harmonics(LAW, (6, 12))
    theta = np.array([[0.1, 0.02, 0.03, 0.01, 0.0, 0.0], [0.1, 0.02, 0.0, 0.0, 0.0, 0.0]])
    assert present(law, theta).sum(axis=1).tolist() == [4, 2]
    lines = str(fid.Friction(law, theta)).splitlines()
    assert "cos_6" in lines[1] and "cos_12" not in lines[1] and "cos" not in lines[2]


@pytest.mark.parametrize("harmonics", ["all", "AUTO"])
def test_other_words_are_one_clear_line(harmonics):
    with pytest.raises(fid.InputError, match="harmonics"):
        Ripple(harmonics=harmonics)
