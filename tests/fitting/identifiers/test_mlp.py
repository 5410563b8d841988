"""The identifier `mlp`: a static network, by Levenberg-Marquardt on compressed squares."""

import json
from functools import partial
from itertools import product

import numpy as np
import pytest
from fixtures import learned_laws
from fixtures.exact_problems import cost, everything, explained_by
from fixtures.refusals import assert_refused
from numpy.testing import assert_array_equal

from frictionid.evaluation import curve_error
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import (
    synthetic_problem,
    synthetic_weights,
    true_friction,
)
from frictionid.fitting.networks.compressed import (
    CompressedNetwork,
    _torque,
    compressed,
    node_speeds,
)
from frictionid.fitting.networks.training import held_out
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import MLP, Stribeck, check_law
from frictionid.friction.model_files import load_model, save_model

OPTIONS = list(product([False, True], repeat=3))
TRUTH = np.array([[0.10, 0.12, 0.04, 0.05, 1.5, 0.02], [0.05, 0.04, 0.03, 0.02, 2.5, 0.01]])
drawn = partial(learned_laws.drawn, spread=0.7)


def curve(law, theta, w):
    return Friction(law, theta).curve(w)


@pytest.mark.parametrize(("options", "others"), [*zip(OPTIONS, [0, 1] * 4, strict=True)])
def test_it_keeps_to_the_contract_of_laws(options, others):
    law = MLP((2, 2), *options, others=others)
    check_law(law, level=law.dissipative)


@pytest.mark.parametrize("options", OPTIONS)
def test_options_keep_their_promise_at_all_weights(options):
    law = MLP((6, 5), *options)
    w = np.linspace(0.2, 40.0, 300)
    promised = {"odd": False, "dissipative": False, "monotone_tail": False}
    for seed in range(5):
        theta = drawn(law, seed=seed)
        up, down = curve(law, theta, w), -curve(law, theta, -w)
        fast = np.diff(up[:, w > 5.0], axis=1), np.diff(down[:, w > 5.0], axis=1)
        promised["odd"] |= not np.allclose(up, down, rtol=1e-9)
        promised["dissipative"] |= min(up.min(), down.min()) < 0
        promised["monotone_tail"] |= min(fast[0].min(), fast[1].min()) < -1e-12
    assert promised == dict(zip(promised, (not option for option in options), strict=True))


def test_beyond_its_reach_the_level_goes_on_nearly_straight():
    law = MLP((6, 5))
    theta, w = drawn(law), np.linspace(5.0, 200.0, 60)
    torque = curve(law, theta, w)
    slope = np.diff(torque, axis=1) / (w[1] - w[0])
    steepest = theta[..., 0] / theta[..., 1] * np.log1p(np.exp(theta[..., 2]))
    assert (slope <= steepest[:, None] * (1 + 1e-9)).all()
    assert (np.abs(np.diff(slope, n=1, axis=1)) <= 0.2 * steepest[:, None]).all()


def test_other_joints_count_when_they_are_asked_for():
    theta = drawn(MLP((4,), others=1))
    here, there = (
        MLP((4,), others=1).torque(theta, at_rest(np.array(w)), ())
        for w in ([1.0, 2.0], [1.0, -2.0])
    )
    assert (np.abs(here - there)[:, 0] > 1e-6).all()
    alone = MLP((4,))
    theta = drawn(alone)
    here, there = (alone.torque(theta, at_rest(np.array(w)), ()) for w in ([1.0, 2.0], [1.0, -2.0]))
    assert_array_equal(here[:, 0], there[:, 0])


def test_it_finds_a_curve_that_is_none_of_its_own():
    problem = explained_by(Stribeck(symmetric=False), TRUTH, 5e-4, 1)
    found = CompressedNetwork(MLP()).fit(problem, everything(problem), 0)
    fast = np.quantile(np.abs(problem.nodes.inputs.w), 0.95)
    w = np.linspace(-fast, fast, 401)
    grid = np.repeat(w[:, None], 2, axis=1)
    error = curve_error(
        found.curve(w)[0], Friction(Stribeck(symmetric=False), TRUTH).curve(w), grid
    )
    assert (error < 0.05).all()
    line = LeastSquares(Stribeck()).fit(problem, everything(problem), 0)
    weights = everything(problem)
    assert cost(problem, weights, found) < cost(problem, weights, line)


def test_a_wider_prior_costs_less_in_training():
    problem = synthetic_problem(2)
    weights = synthetic_weights(problem)
    strict, free = (
        CompressedNetwork(MLP((8,)), prior_deviations=(deviation,)).fit(problem, weights, 0)
        for deviation in (0.03, 1.0)
    )
    assert (cost(problem, weights, free) < cost(problem, weights, strict)).all()


def test_freedom_that_tells_nothing_is_rarely_taken():
    rng = np.random.default_rng(0)
    problem = explained_by(Stribeck(symmetric=False), TRUTH[:1], 0.1, rng)

    def fitted(deviations, seed):
        identifier = CompressedNetwork(MLP((8,)), prior_deviations=deviations)
        return identifier.fit(problem, everything(problem), seed).theta

    seeds = range(12)
    strict = [np.array_equal(fitted((0.3, 1.0), seed), fitted((0.3,), seed)) for seed in seeds]
    assert np.mean(strict) > 0.75  # by one standard error 0.84


def test_compressed_squares_are_those_of_the_rows():
    problem, law = synthetic_problem(2), MLP((6, 6))
    weights, theta = synthetic_weights(problem), drawn(law)[:, :2]
    speeds = node_speeds(problem, weights.max(axis=0), 200)
    true = true_friction(2)
    for weight, numbers in zip(weights, theta, strict=True):
        squares = compressed(problem, weight, speeds, law.width, law.shape)
        exact, of_truth = (
            cost(problem, weight[None], friction[None])[0]
            for friction in (Friction(law, numbers), true)
        )
        assert squares.cost(_torque(law, numbers, speeds)) == pytest.approx(exact, rel=1e-3)
        assert squares.c > 100 * of_truth


def test_rows_held_out_inside_a_fold_are_whole_recordings_or_pieces_of_it():
    problem = synthetic_problem(1)
    weights = synthetic_weights(problem)
    rows = held_out(problem, weights, 0.2, 0)
    assert (rows <= (weights > 0)).all()
    share = (rows * weights).sum(1) / weights.sum(1)
    assert ((share >= 0.2) & (share < 0.4)).all()


def test_weights_that_are_lost_or_of_another_fit_are_refused(tmp_path):
    law = MLP((3,))
    for name, seed in (("a", 0), ("b", 1)):
        save_model(Friction(law, drawn(law, seed=seed)[0]), tmp_path / f"{name}.json")
    (tmp_path / "a.safetensors").write_bytes((tmp_path / "b.safetensors").read_bytes())
    with assert_refused("other weights than were saved"):
        load_model(tmp_path / "a.json")
    (tmp_path / "a.safetensors").write_bytes(b"no weights")
    with assert_refused("holds no tensor"):
        load_model(tmp_path / "a.json")
    (tmp_path / "a.safetensors").unlink()
    with assert_refused("cannot be read"):
        load_model(tmp_path / "a.json")
    document = json.loads((tmp_path / "b.json").read_text())
    document["theta"]["file"] = "../b.safetensors"
    (tmp_path / "b.json").write_text(json.dumps(document))
    with assert_refused("beside it"):
        load_model(tmp_path / "b.json")
