"""The identifiers `mlp`, by compressed squares, and `window_mlp`; ensembles, own networks."""

import json
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest
import torch
from fixtures.exact_problems import BY_DIRECTION as TRUTH
from fixtures.exact_problems import cost, everything, explained_by, fit_to_all
from fixtures.learned_laws import assert_slopes_in_memory, costs_of_rows, drawn
from fixtures.paths import ROOT
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from own_network import OwnLaw, own_network

from frictionid.evaluation import curve_error
from frictionid.fitting.identifiers import LeastSquares, check_identifier
from frictionid.fitting.identifiers.check_identifier import (
    synthetic_problem,
    synthetic_weights,
    true_friction,
)
from frictionid.fitting.identifiers.compressed import (
    CompressedNetwork,
    _torque,
    compressed,
    node_speeds,
)
from frictionid.fitting.identifiers.network import Network
from frictionid.fitting.identifiers.network_data import FoldStack, RowTrainingSet, window
from frictionid.fitting.identifiers.network_training import Adam, batches, held_out
from frictionid.friction import Friction, Inputs, along, at_rest, memory_along
from frictionid.friction.laws import (
    LSTM,
    MLP,
    Ensemble,
    Stribeck,
    TorchModule,
    WindowMLP,
    check_law,
)
from frictionid.friction.model_files import load_model, save_model

OPTIONS = list(product([False, True], repeat=3))
wide = partial(drawn, spread=0.7)


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
        theta = wide(law, seed=seed)
        up, down = curve(law, theta, w), -curve(law, theta, -w)
        fast = np.diff(up[:, w > 5.0], axis=1), np.diff(down[:, w > 5.0], axis=1)
        promised["odd"] |= not np.allclose(up, down, rtol=1e-9)
        promised["dissipative"] |= min(up.min(), down.min()) < 0
        promised["monotone_tail"] |= min(fast[0].min(), fast[1].min()) < -1e-12
    assert promised == dict(zip(promised, (not option for option in options), strict=True))


def test_beyond_its_reach_the_level_goes_on_nearly_straight():
    law = MLP((6, 5))
    theta, w = wide(law), np.linspace(5.0, 200.0, 60)
    torque = curve(law, theta, w)
    slope = np.diff(torque, axis=1) / (w[1] - w[0])
    steepest = theta[..., 0] / theta[..., 1] * np.log1p(np.exp(theta[..., 2]))
    assert (slope <= steepest[:, None] * (1 + 1e-9)).all()
    assert (np.abs(np.diff(slope, n=1, axis=1)) <= 0.2 * steepest[:, None]).all()


def test_other_joints_count_when_they_are_asked_for():
    for law in (MLP((4,), others=1), MLP((4,))):
        w = np.array([[[1.0, 2.0]], [[1.0, -2.0]]])
        here, there = law.torque(wide(law), at_rest(w), ())[..., 0]
        assert (np.abs(here - there) > 1e-6).all() if law.others else (here == there).all()


def test_it_finds_a_curve_that_is_none_of_its_own():
    problem = explained_by(Stribeck(symmetric=False), TRUTH, 5e-4, 1)
    found = fit_to_all(CompressedNetwork(MLP()), problem)
    fast = np.quantile(np.abs(problem.nodes.inputs.w), 0.95)
    w = np.linspace(-fast, fast, 401)
    grid = np.repeat(w[:, None], 2, axis=1)
    error = curve_error(
        found.curve(w)[0], Friction(Stribeck(symmetric=False), TRUTH).curve(w), grid
    )
    assert (error < 0.05).all()
    line = fit_to_all(LeastSquares(Stribeck()), problem)
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
    rng = default_rng(0)
    problem = explained_by(Stribeck(symmetric=False), TRUTH[:1], 0.1, rng)

    def fitted(deviations, seed):
        identifier = CompressedNetwork(MLP((8,)), prior_deviations=deviations)
        return identifier.fit(problem, everything(problem), seed).theta

    seeds = range(12)
    strict = [np.array_equal(fitted((0.3, 1.0), seed), fitted((0.3,), seed)) for seed in seeds]
    assert np.mean(strict) > 0.75  # by one standard error 0.84


def test_compressed_squares_are_those_of_the_rows():
    problem, law = synthetic_problem(2), MLP((6, 6))
    weights, theta = synthetic_weights(problem), wide(law)[:, :2]
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
        save_model(Friction(law, wide(law, seed=seed)[0]), tmp_path / f"{name}.json")
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


# --- Windows --------------------------------------------------------------------------------------


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("presliding", [0.0, 0.01])
def test_windows_keep_to_the_contract_of_laws(odd, presliding):
    check_law(WindowMLP(2, hidden=(3,), odd=odd, presliding=presliding))
    free = WindowMLP(2, hidden=(3,), odd=odd, dissipative=False, monotone_tail=False)
    check_law(replace(free, presliding=presliding))


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("presliding", [0.0, 0.01])
def test_its_slopes_are_those_of_differences(odd, presliding):
    rng = default_rng(1)
    law = WindowMLP(3, hidden=(4, 3), odd=odd, dissipative=odd, presliding=presliding)
    theta = drawn(law)[0]
    x = Inputs(*(3.0 * rng.normal(size=(6, 2)) for _ in range(4)))
    memory = tuple(z + 0.1 * rng.normal(size=z.shape) for z in law.start(theta, x))
    by_theta, by_memory = law.slopes(theta, x, memory)
    for k, step in enumerate(1e-6 * np.eye(theta.shape[1])):
        rise = law.torque(theta + step, x, memory) - law.torque(theta - step, x, memory)
        assert_allclose(by_theta[..., k], rise / 2e-6, atol=1e-8)
    assert_slopes_in_memory(law, theta, x, memory, by_memory, 1e-7, atol=1e-6, rtol=1e-4)


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize(
    "law", [WindowMLP(4, hidden=(5,)), WindowMLP(4, presliding=0.01), LSTM(3, hidden=(4,))], ids=str
)
def test_options_of_laws_with_memory_hold_along_a_motion(law, odd):
    law, nodes = replace(law, odd=odd), synthetic_problem(2).nodes
    friction = Friction(law, drawn(law))
    torque = along(friction, nodes)
    assert (torque * nodes.inputs.w >= 0).all()
    turned = nodes.inputs._replace(q=-nodes.inputs.q, w=-nodes.inputs.w)
    mirrored = nodes._replace(inputs=turned)
    assert (np.abs(torque + along(friction, mirrored)).max() < 1e-12) == odd
    assert (np.diff(friction.curve(np.linspace(5.0, 60.0, 30)), axis=1) >= -1e-12).all()


def test_its_memory_is_the_newest_samples():
    law, nodes = WindowMLP(3, hidden=(2,)), synthetic_problem(1).nodes
    theta = drawn(law, n=1)[0]
    steps = memory_along(Friction(law, theta), nodes)
    assert_array_equal(steps[0], 3 * [nodes.inputs.w[nodes.first[:-1]]])
    w = nodes.inputs.w[: nodes.first[1]]
    for age in range(3):
        assert_array_equal(steps[21][age][0], w[20 - 2 * age])
    seen = window(law, theta, nodes)
    for age in range(3):
        assert_array_equal(seen[age][21], w[20 - 2 * age])
        assert_array_equal(seen[age][0], w[0])


def test_its_memory_of_the_way_is_the_newest_angles():
    law, nodes = WindowMLP(3, hidden=(2,), presliding=0.01), synthetic_problem(1).nodes
    law = replace(law, sample_time=float(nodes.time[2] - nodes.time[0]))
    seen, (q, w) = window(law, drawn(law, n=1)[0], nodes), nodes.inputs[:2]
    for t in (0, 1, 2, 3, 8, 21):
        assert_array_equal(seen[0][t], w[t // 2 * 2])
        for age in range(3):
            before = law.sample_time * max(age - t // 2, 0) * w[0]
            assert_allclose(seen[1 + age][t], q[max(t // 2 - age, 0) * 2] - before, atol=1e-12)


def test_the_place_of_a_joint_does_not_matter_but_its_way_does():
    law, w = WindowMLP(3, hidden=(4,), presliding=0.01), np.full((1, 2), 0.4)
    theta = drawn(law)[0]
    here = Inputs(0.0 * w, w, 0.0 * w, 0.0 * w)
    there, memory = here._replace(q=here.q + 1.0), law.start(theta, here)
    torque = law.torque(theta, here, memory)
    assert_allclose(law.torque(theta, there, law.start(theta, there)), torque)
    assert (np.abs(law.torque(theta, there, memory) - torque) > 1e-4).all()


@pytest.mark.parametrize(
    "law",
    [
        WindowMLP(3, hidden=(4,)),
        WindowMLP(3, hidden=(4,), presliding=0.01),
        MLP((4,), others=1),
        OwnLaw(),
    ],
)
def test_cost_in_training_is_that_of_the_rows(law):
    problem = synthetic_problem(2)
    weights, theta = synthetic_weights(problem), drawn(law)
    stack = FoldStack(law, [problem] * len(theta), theta, "cpu")
    rows = RowTrainingSet(stack, weights)
    items = stack.tensor(np.tile(np.arange(rows.items), (3, 1)))
    found = rows.cost(stack.tensor(theta), items) * rows.items
    exact = costs_of_rows(problem, weights, law, theta)
    assert_allclose(found, exact, rtol=1e-9)


def test_batches_of_a_fold_go_through_all_its_rows_and_do_not_depend_on_the_others():
    counted = np.array([[True] * 7 + [False] * 3, [True] * 10])
    draws = batches(counted, 4, [[0], [0]])
    both = [next(draws) for _ in range(5)]
    first = np.concatenate([b[0] for b in both])
    assert sorted(first[:7]) == sorted(first[7:14]) == list(range(7))
    alone = batches(counted[1:], 4, [[0]])
    assert_array_equal([b[1] for b in both], [next(alone)[0] for _ in range(5)])


def test_its_steps_are_those_of_pytorchs_own():
    theta = torch.tensor(default_rng(0).normal(size=(2, 1, 3)), requires_grad=True)
    theirs = theta.detach().clone().requires_grad_()
    learned = torch.ones(3, dtype=torch.bool)
    ours, other = Adam(theta, learned), torch.optim.Adam([theirs], 0.05, betas=(0.9, 0.99))
    for _ in range(20):
        ours.step(1e-2 * ((theta - 1.0) ** 4).sum((1, 2)), 0.05)  # small: nothing is clipped
        other.zero_grad()
        (1e-2 * ((theirs - 1.0) ** 4)).sum().backward()
        other.step()
    assert_allclose(theta.detach(), theirs.detach(), rtol=1e-9)


def test_gradients_and_least_squares_find_one_curve_least_squares_more_closely():
    problem = synthetic_problem(1)
    weights = synthetic_weights(problem)
    by_squares = CompressedNetwork(MLP((8,))).fit(problem, weights, 0)
    by_steps = Network(MLP((8,)), epochs=300, batch=60, patience=300).fit(problem, weights, 0)
    assert (cost(problem, weights, by_squares) < cost(problem, weights, by_steps)).all()
    torques = [along(friction, problem.nodes) for friction in (by_steps, by_squares)]
    assert np.abs(torques[0] - torques[1]).mean() < 0.05 * np.abs(torques[1]).mean()


def test_a_network_of_ones_own_keeps_to_the_contract_of_identifiers():
    check_identifier(own_network(2), joints=(1,))


def test_a_network_of_ones_own_learns_and_comes_back_from_its_file(tmp_path):
    problem = synthetic_problem(1)
    weights = synthetic_weights(problem)
    found = own_network(100).fit(problem, weights, 0)
    assert (cost(problem, weights, found) < 0.1 * (weights @ (problem.r**2).sum(1))).all()
    save_model(found, tmp_path / "model.json")
    again = load_model(tmp_path / "model.json", [OwnLaw])
    assert_array_equal(along(again, problem.nodes), along(found, problem.nodes))
    with assert_refused("law 'OwnLaw' is unknown"):
        load_model(tmp_path / "model.json")
    check_law(TorchModule(torch.nn.Linear(2, 1)))


def test_it_takes_less_than_forty_lines():
    text = (ROOT / "comparisons/own_network.py").read_text()
    assert len(text.splitlines()) < 40


def test_an_ensemble_is_the_mean_of_its_members_which_spread(tmp_path):
    problem = synthetic_problem(1)
    weights = synthetic_weights(problem)
    mean = CompressedNetwork(MLP((6,)), prior_deviations=(1.0,), members=3).fit(problem, weights, 0)
    one = CompressedNetwork(MLP((6,)), prior_deviations=(1.0,)).fit(problem, weights, 0)
    check_law(Ensemble(WindowMLP(2, hidden=(2,)), 2))
    thetas = np.split(mean.theta, 3, axis=-1)
    members = Friction(mean.law.member, np.stack(thetas))
    assert_array_equal(thetas[0], one.theta)
    w = np.linspace(-6.0, 6.0, 50)
    assert_allclose(members.curve(w).mean(axis=0), mean.curve(w), rtol=1e-12)
    seen, far = (members.curve(np.array([v])).std(axis=0).max() for v in (2.0, 30.0))
    assert 0 < seen < far
    save_model(mean, tmp_path / "model.json")
    back = load_model(tmp_path / "model.json")
    assert back.law == mean.law and np.array_equal(back.theta, mean.theta)
