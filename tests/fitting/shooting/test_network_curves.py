"""Curves of networks in shooting: polynomials that are them, their changes, weights again."""

from dataclasses import replace

import numpy as np
import pytest
from fitting.shooting.test_networks import SHORT, swings
from fixtures.true_curves import curve_errors
from numpy.testing import assert_allclose

from frictionid.fitting.parameters import DelayBlock, FrictionBlock
from frictionid.fitting.shooting import refine
from frictionid.fitting.shooting.network_curves import curve_of, distance, network_of
from frictionid.fitting.shooting.networks import CurveCombinations
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.fitting.shooting.stages import prepare_fit
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import MLP, check_law

LAWS = [MLP(), MLP(odd=True), MLP(dissipative=False, monotone_tail=False)]


def drawn(law, n=1, seed=0):
    """A network that is drawn, of the size of the friction of the swings."""
    sizes = np.tile([0.06, 9.0], (n, 1))
    return Friction(law, law.initial_parameters(sizes, np.random.default_rng(seed)))


def nothing(friction):
    return np.zeros((*friction.theta.shape, 1))


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_curve_has_the_torque_and_the_break_away_level_of_its_network(law):
    network = drawn(law, 2)
    curve, _ = curve_of(network, nothing(network))
    w = np.concatenate([-np.geomspace(20.0, 1e-3, 300), np.geomspace(1e-3, 20.0, 300)])
    x = at_rest(np.stack([w, w], axis=-1))
    for function in ("torque", "limit"):
        a, b = (getattr(f.law, function)(f.theta, x, ()) for f in (curve, network))
        assert_allclose(a, b, atol=1e-5 * np.abs(b).max())
    check_law(curve.law, level=law.dissipative)


def test_changes_of_weights_are_those_of_the_coefficients():
    network = drawn(MLP())
    change = 1e-6 * np.random.default_rng(1).normal(size=(*network.theta.shape, 3))
    change[:, :2] = 0.0  # scales
    curve, coefficients = curve_of(network, change)
    for k in range(3):
        moved, _ = curve_of(replace(network, theta=network.theta + change[..., k]), change)
        off = moved.theta - curve.theta - coefficients[..., k]
        assert np.abs(off).max() < 1e-4 * np.abs(coefficients[..., k]).max()


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_weights_are_found_for_a_curve_of_other_weights(law):
    network = drawn(law, 2)
    rng = np.random.default_rng(2)
    theta = network.theta + 0.1 * rng.normal(size=network.theta.shape)
    theta[:, :2] = network.theta[:, :2]
    other = replace(network, theta=theta)
    curve, _ = curve_of(other, nothing(other))
    assert distance(curve, other) < 1e-9 < 0.01 < distance(curve, network)
    assert distance(curve, network_of(curve, network)) < 1e-3


def linearised(curves):
    """Derivatives of the ends of intervals, of a network that is a curve, or left as it is."""
    intervals, network = intervals_of(swings()), drawn(MLP(hidden=(5,)))
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
    found = refine(drawn(MLP(hidden=hidden)), swings(), settings=SHORT)
    curve = found.fitted
    assert found.friction.law == MLP(hidden=hidden)
    if len(hidden) > 1:
        assert distance(curve.law.curve(curve), found.friction) < 1e-3
    w = np.linspace(-8.0, 8.0, 50)
    size = np.abs(found.friction.curve(w)).max()
    assert_allclose(curve.curve(w), found.friction.curve(w), atol=1e-3 * size)
    assert curve_errors(found.friction, swings()).max() < 0.1
