"""Shooting for laws with many numbers: slopes in reverse mode, networks, memories, curves."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from fixtures.changed_data import changed
from fixtures.learned_laws import Recurrent, Static
from fixtures.memory_laws import Sampled
from fixtures.true_curves import curve_errors
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.dynamics.law_derivatives import TensorLaw
from frictionid.evaluation import Protocol, prepare, score_model, score_value
from frictionid.evaluation.curves import steady_state
from frictionid.fitting.parameters import DelayBlock, FrictionBlock
from frictionid.fitting.shooting import Settings, Shooting, refine, refine_folds
from frictionid.fitting.shooting.network_curves import curve_of, distance, network_of
from frictionid.fitting.shooting.networks import CombinationLaw, CurveCombinations
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.fitting.shooting.stages import prepare_fit
from frictionid.friction import Friction, Inputs, at_rest
from frictionid.friction.laws import MLP, WindowMLP, check_law
from frictionid.friction.laws import Stribeck as StribeckLaw
from frictionid.simulate import Camera, Chirp, Curve, Rig, Run, Stribeck, simulate
from frictionid.simulate.true_friction import FilmLag

CURVE = Curve((0.08,), (0.07,), (0.01,), (0.05,), (0.04,), (1.5,))
PENDULUM = {"kind": "pendulum", "parameters": {"mass": 0.5, "length": 0.3}}
RUNS = (
    (2.5, 0.0, 0.0, 0, 0),
    (-2.0, 6.0, 0.0, 0, 0),
    (0.3, 0.0, 0.8, 0.3, 2.0),
    (0, 0, 0.5, 2, 0.5),
)
WAY = WindowMLP(3, hidden=(4,), presliding=0.3)
SHORT = Settings(windows=(0.33,), iterations=6)


@cache
def swings(friction=None, runs=RUNS, seed=1):
    """A pendulum with known friction, seen by a camera."""
    motions = tuple(
        Run(f"{i}", (angle,), (speed,), torques=(Chirp(size, f0, f1),) if size else ())
        for i, (angle, speed, size, f0, f1) in enumerate(runs)
    )
    camera = Camera(150, angle_noise=0.001)
    friction = friction or Stribeck(CURVE)
    return simulate(Rig("p", PENDULUM, friction, camera, motions, seed=seed, substeps=4))


def inputs_of(rng, count=5, n=2):
    return Inputs(*(3.0 * rng.normal(size=(count, n)) for _ in range(4)))


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("law", [Static(), Recurrent()], ids=str)
def test_slopes_in_reverse_mode_are_those_of_differences(law, samples):
    rng = default_rng(0)
    theta = rng.normal(size=(2, len(law.names)))
    own = TensorLaw(law, law.width, law.shape, torch.zeros(1, dtype=torch.float64))
    path, dt = [inputs_of(rng) for _ in range(samples)], np.full((5, 1), 1 / 60)

    def torque(theta):
        z = own.start(theta, path[0])
        for x in path[1:]:
            z = own.advance(theta, x, z, dt)
        return own.torque(theta, path[-1], z)

    slopes = own.gradient_along(theta, path, own.start(theta, path[0]), dt)
    for i in range(theta.shape[1]):
        step = 1e-6 * np.eye(theta.shape[1])[i]
        rise = (torque(theta + step) - torque(theta - step)) / 2e-6
        assert_allclose(slopes[..., i], rise, atol=1e-7)


@pytest.mark.parametrize("law", [Static(), Recurrent(), WAY], ids=str)
def test_predictions_change_with_combinations_start_and_memory_as_their_slopes_say(law):
    intervals = intervals_of(swings())
    # slopes are those in the middle of a substep, in which bristles bend by much of their way
    close = 2e-2 if law == WAY else 1e-2
    theta = default_rng(1).normal(size=(1, len(law.names)))
    theta[:, :2] = np.where(
        np.isfinite(law.bounds[:2]).any(axis=1), law.initial[0][:2], theta[:, :2]
    )
    problem, estimate = prepare_fit(
        Friction(law, theta), intervals, (FrictionBlock(), DelayBlock()), SHORT
    )
    assert isinstance(estimate.friction.law, CombinationLaw)
    nodes = problem.initial_nodes(estimate)
    fast = np.abs(intervals.w[:, 0]) > 2.0
    rows = np.flatnonzero(fast & np.append(fast[1:], False))[:40]
    lines = problem.linearise(estimate, nodes, rows)
    unit = np.abs(lines.by[rows]).max(axis=(0, 1))
    for k in range(0, len(unit) - 1, 3):
        step = np.zeros_like(estimate.friction.theta)
        step[0, k] = 1e-5
        up, down = (
            estimate._replace(friction=replace(estimate.friction, theta=s * step)) for s in (1, -1)
        )
        rise = problem.linearise(up, nodes, rows).end - problem.linearise(down, nodes, rows).end
        assert_allclose(
            rise[rows] / 2e-5, lines.by[rows, :, k], atol=close * unit[k] + 1e-4 * unit[:-1].max()
        )
    for i in range(nodes.shape[1]):
        step = 1e-5 * np.eye(nodes.shape[1])[i]
        up, down = (problem.linearise(estimate, nodes + s * step, rows).end for s in (1, -1))
        by = lines.by_start[rows, :, i]
        assert_allclose((up - down)[rows] / 2e-5, by, atol=close * np.abs(by).max())


@cache
def refined(kind, settings=SHORT):
    law = Static()
    theta = law.drawn(1)
    begin = Friction(law, torch.tensor(theta) if kind == "tensor" else theta)
    return begin, refine(begin, swings(), settings=settings)


def test_a_network_finds_the_curve_from_a_rough_start():
    first, found = refined("numpy")
    before, after = (curve_errors(f, swings()).max() for f in (first, found.friction))
    assert before > 0.3 and after < 0.2 * before
    assert found.friction.law == first.law


def test_numbers_of_numpy_and_of_torch_give_the_same():
    few = Settings(windows=(0.1,), iterations=1)
    (_, a), (_, b) = (refined(kind, few) for kind in ("tensor", "numpy"))
    assert isinstance(b.friction.theta, np.ndarray)
    assert a.friction.theta.dtype == torch.float64
    assert_allclose(a.friction.theta.numpy(), b.friction.theta)


def test_bands_tell_how_sure_the_curve_is_and_no_weight_is_reported():
    dataset, (_, found) = swings(), refined("numpy")
    w = np.linspace(1.0, 6.0, 11)[:, None]
    point, whole = found.bands(w)
    assert (point > 0).all() and (whole >= point).all()
    true = steady_state(dataset.truth).curve(w)
    assert (np.abs(found.friction.curve(w) - true) < 3 * whole).all()
    assert found.bands(np.array([[30.0]]))[0] > point.max()
    blocks = {e.block for e in found.estimates(dataset, w).parameters}
    assert "delay" in blocks and "friction" not in blocks


def test_a_delay_beside_a_network_is_found_and_reported():
    first = Friction(Static(), Static().drawn(1))
    late = changed(swings(), "torque", np.array, -0.01)
    found = refine(first, late, (FrictionBlock(), DelayBlock()), SHORT)
    assert abs(float(found.calibration.delay) - 0.01) < min(4 * found.covariance.error[-1], 3e-3)
    (e,) = found.estimates(late, np.ones((3, 1))).parameters
    assert e.name == "torque delay"


def forecast(friction, dataset):
    """Median error [rad] of the motion half a second ahead."""
    scores, *_ = score_model(friction, prepare(dataset, Protocol(horizons=(0.5,), every=0.25)))
    return score_value(scores, "rollout_angle_truth", "median", 0.5)


def test_a_recurrent_law_predicts_better_motions_that_it_never_saw():
    lag = FilmLag(CURVE, (0.1,))
    others = ((1.8, 0.0, 0.0, 0, 0), (0.5, 0.0, 0.7, 0.5, 1.5))
    reads, unseen = swings(lag), swings(lag, others, 2)
    law = Recurrent()
    first = Friction(law, default_rng(0).normal(size=(1, 25)))
    found = refine(first, reads, (FrictionBlock(),), SHORT).friction
    assert forecast(found, unseen) < 0.3 * forecast(first, unseen)


def test_a_memory_of_samples_with_few_numbers_keeps_their_names():
    dataset, first = swings(FilmLag(CURVE, (0.1,))), Friction(Sampled(), torch.tensor([[0.3]]))
    found = refine(first, dataset, settings=SHORT)
    assert [e.name for e in found.covariance.parameters][0] == "gain of joint 1"
    assert found.friction.theta.dtype == torch.float32
    before, after = (
        forecast(Friction(Sampled(), f.theta.numpy()), dataset) for f in (first, found.friction)
    )
    assert after < 0.2 * before


def test_tensors_of_a_law_with_names_give_what_numpy_gives():
    theta = np.array([[0.05, 0.05, 0.005, 0.005, 2.0, 0.005]])
    law = StribeckLaw(symmetric=False)
    ours, theirs = (
        refine(Friction(law, start), swings(), settings=SHORT)
        for start in (theta, torch.tensor(theta))
    )
    assert_allclose(ours.friction.theta, theirs.friction.theta.numpy(), rtol=1e-5)
    assert_allclose(ours.covariance.matrix, theirs.covariance.matrix, rtol=1e-3)


def test_each_fold_of_a_network_is_that_of_its_own_recordings():
    dataset, law = swings(), Static()
    intervals = intervals_of(dataset)
    training = np.stack([intervals.recording != 1, intervals.recording >= 0]) * 1.0
    theta = np.stack([law.drawn(1, 3), law.drawn(1, 4)])
    few = Settings(windows=(0.33,), iterations=3)
    alone = Shooting(blocks=(FrictionBlock(),), settings=few)
    whole = refine_folds(Friction(law, theta), intervals, alone, training)
    together = whole.folds
    assert together.theta.shape == theta.shape
    assert_array_equal(together.theta[-1], whole.friction.theta)
    assert curve_errors(together[0], dataset).max() < 0.1


# --- Curves ---------------------------------------------------------------------------------------

LAWS = [MLP(), MLP(odd=True), MLP(dissipative=False, monotone_tail=False)]


def mlp_drawn(law, n=1, seed=0):
    """A network that is mlp_drawn, of the size of the friction of the swings."""
    sizes = np.tile([0.06, 9.0], (n, 1))
    return Friction(law, law.initial_parameters(sizes, default_rng(seed)))


def nothing(friction):
    return np.zeros((*friction.theta.shape, 1))


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_curve_has_the_torque_and_the_break_away_level_of_its_network(law):
    network = mlp_drawn(law, 2)
    curve, _ = curve_of(network, nothing(network))
    w = np.concatenate([-np.geomspace(20.0, 1e-3, 300), np.geomspace(1e-3, 20.0, 300)])
    x = at_rest(np.stack([w, w], axis=-1))
    for function in ("torque", "limit"):
        a, b = (getattr(f.law, function)(f.theta, x, ()) for f in (curve, network))
        assert_allclose(a, b, atol=1e-5 * np.abs(b).max())
    check_law(curve.law, level=law.dissipative)


def test_changes_of_weights_are_those_of_the_coefficients():
    network = mlp_drawn(MLP())
    change = 1e-6 * default_rng(1).normal(size=(*network.theta.shape, 3))
    change[:, :2] = 0.0  # scales
    curve, coefficients = curve_of(network, change)
    for k in range(3):
        moved, _ = curve_of(replace(network, theta=network.theta + change[..., k]), change)
        off = moved.theta - curve.theta - coefficients[..., k]
        assert np.abs(off).max() < 1e-4 * np.abs(coefficients[..., k]).max()


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_weights_are_found_for_a_curve_of_other_weights(law):
    network = mlp_drawn(law, 2)
    rng = default_rng(2)
    theta = network.theta + 0.1 * rng.normal(size=network.theta.shape)
    theta[:, :2] = network.theta[:, :2]
    other = replace(network, theta=theta)
    curve, _ = curve_of(other, nothing(other))
    assert distance(curve, other) < 1e-9 < 0.01 < distance(curve, network)
    assert distance(curve, network_of(curve, network)) < 1e-3


def linearised(curves):
    """Derivatives of the ends of intervals, of a network that is a curve, or left as it is."""
    intervals, network = intervals_of(swings()), mlp_drawn(MLP(hidden=(5,)))
    blocks = (FrictionBlock(), DelayBlock())
    problem, estimate = prepare_fit(network, intervals, blocks, SHORT, curves=curves)
    assert isinstance(estimate.friction.law, CurveCombinations) == curves
    rows = np.arange(len(intervals.dt))
    return problem.linearise(estimate, problem.initial_nodes(estimate), rows)


def test_curves_and_layers_of_a_network_are_linearised_alike():
    a, b = (linearised(curves) for curves in (True, False))
    for name in ("end", "by_start", "by"):
        new, old = getattr(a, name), getattr(b, name)
        scale = np.abs(old).max(axis=0) + 1e-12
        assert (np.abs(new - old) / scale).max() < 1e-5, name


@pytest.mark.parametrize("hidden", [(3,), (16, 16)], ids=str)
def test_a_network_has_the_curve_that_was_fitted(hidden):
    found = refine(mlp_drawn(MLP(hidden=hidden)), swings(), settings=SHORT)
    curve = found.fitted
    assert found.friction.law == MLP(hidden=hidden)
    if len(hidden) > 1:
        assert distance(curve.law.curve(curve), found.friction) < 1e-3
    w = np.linspace(-8.0, 8.0, 50)
    size = np.abs(found.friction.curve(w)).max()
    assert_allclose(curve.curve(w), found.friction.curve(w), atol=1e-3 * size)
    assert curve_errors(found.friction, swings()).max() < 0.1
