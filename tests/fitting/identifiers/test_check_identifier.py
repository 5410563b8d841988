"""The contract of identifiers: ours keep it, and the check finds every violation."""

import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from fixtures.memory_laws import Sampled
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.neighbors import KNeighborsRegressor

from frictionid.comparison.registry import IDENTIFIERS
from frictionid.comparison.suite import identifier_named
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers import (
    LeastSquares,
    Published,
    Regressor,
    SINDy,
    check_identifier,
)
from frictionid.fitting.identifiers.check_identifier import (
    synthetic_problem,
    synthetic_weights,
    true_friction,
)
from frictionid.fitting.identifiers.compressed import CompressedNetwork
from frictionid.fitting.identifiers.network import Network
from frictionid.friction import along
from frictionid.friction.laws import LSTM, MLP, CoulombViscous, Library, NoFriction
from frictionid.friction.model_files import load_model, save_model

PEAKS = Library(velocities=(0.5, 1.5, 5.0))
FREE = LSTM(3, hidden=(4,), dissipative=False, monotone_tail=False, free=True)
OURS = [
    *(LeastSquares(law) for law in (NoFriction(), Sampled())),
    *(SINDy(PEAKS, search_sets=False), SINDy(PEAKS, optimizer="sr3"), SINDy(PEAKS, ensemble=3)),
    Regressor(KNeighborsRegressor(5), ("w", "q", "u")),
    CompressedNetwork(MLP((6,)), nodes=15, prior_deviations=(1.0,), iterations=10),
    Network(MLP((4,)), epochs=2, inputs="all", members=2),
    Network(FREE, epochs=2, batch=40, targets=20),
]


@pytest.mark.parametrize("identifier", OURS, ids=str)
def test_identifiers_keep_to_the_contract(identifier):
    check_identifier(identifier)


# What has no default, and less training: the contract holds however well a network fits.
QUICK = {"epochs": 2}
NETWORKS = ("mlp", "lstm", "window_mlp", "blackbox_mlp", "blackbox_lstm")
SETTINGS = {
    "gear_load": {"moment": 0.1, "iterations": 5},
    **dict.fromkeys(("dahl", "film_lag", "lugre", "play"), {"iterations": 5}),
    "mlp": {"hidden": [6], "iterations": 10},
    "sklearn": {"estimator": "kernel_ridge"},
    **dict.fromkeys(("lstm", "window_mlp", "blackbox_mlp", "blackbox_lstm"), QUICK),
}


@pytest.mark.parametrize("name", IDENTIFIERS)
def test_every_identifier_of_the_suites_keeps_to_it_and_its_friction_comes_back(name, tmp_path):
    joints = 2 if name == "published" else 1
    identifier = (
        Published(true_friction(2))
        if name == "published"
        else identifier_named(name, SETTINGS.get(name, {}))
    )
    check_identifier(identifier, joints=(joints,))
    problem = synthetic_problem(joints)
    friction = identifier.fit(problem, synthetic_weights(problem), 0)
    if name in NETWORKS:
        other = identifier.fit(problem, synthetic_weights(problem), 1)
        assert np.abs(friction.theta - other.theta).max() > 1e-3
    for fitted in (friction, friction[1]):
        save_model(fitted, tmp_path / "model.json")
        again = load_model(tmp_path / "model.json")
        assert again.law == fitted.law and again.mechanism == fitted.mechanism
        assert_array_equal(again.theta, fitted.theta)


def test_the_practice_problem_is_explained_by_its_friction_and_has_what_the_contract_needs():
    for n in (1, 2):
        problem = synthetic_problem(n, noise=0.0)
        weights = synthetic_weights(problem)
        residual = problem.residual(along(true_friction(n), problem.nodes))
        assert_allclose(residual, 0.0, atol=1e-15)
        assert problem.r.shape == (120, n)
        assert problem.history == 4
        assert (weights > 0).any(axis=1).all()
        assert (weights == 0).all(axis=0).any()
        speed = np.abs(problem.nodes.inputs.w)
        assert ((1.0 < speed.max(0)) & (speed.max(0) < 10.0)).all()
        assert (np.diff(np.sign(problem.nodes.inputs.w), axis=0) != 0).any(axis=0).all()
        same = pickle.dumps(synthetic_problem(n)) == pickle.dumps(synthetic_problem(n))
        assert same


# What the check finds: one identifier for each rule, which breaks it.

INNER = LeastSquares(CoulombViscous())


@dataclass(frozen=True)
class Ill(Identifier):
    """An identifier to break: what spoils its friction, or what was given, is all that is wrong."""

    spoil: Callable

    def fit(self, problem, weights, seed):
        return self.spoil(INNER.fit(problem, weights, seed), problem, weights, seed)


def bare(friction, *_):
    return friction.theta


def single(friction, *_):
    return friction[0]


def undefined(friction, *_):
    return replace(friction, theta=friction.theta * np.nan)


def leaking(friction, *_):
    return replace(friction, theta=0.0 * friction.theta + friction.theta.mean(0))


def random(friction, *_):
    off = 1.0 + 1e-9 * np.random.default_rng().standard_normal()
    return replace(friction, theta=friction.theta * off)


def local(friction, *_):
    return replace(friction, provenance={"by": lambda: None})


def forgotten(friction, *_):
    return replace(friction, law=Forgetful(width=1.0))


def of_law(friction, *_, law):
    return replace(friction, law=law)


def with_law(law):
    """An identifier whose friction is of another law than the one that was fitted."""
    return Ill(partial(of_law, law=law))


def absolute(friction, problem, weights, seed):  # noqa: ARG001
    size = weights.sum(1)[:, None, None]
    return replace(friction, theta=friction.theta * size / (10.0 + size))


def unweighted(friction, problem, weights, seed):  # noqa: ARG001
    return INNER.fit(problem, np.ones_like(weights), seed)


def spoiling(friction, problem, *_):
    problem.r[...] *= 2.0
    return friction


def wasting(friction, problem, weights, seed):  # noqa: ARG001
    weights[...] = 1.0
    return friction


class Drawing(Ill):
    """Says that no seed changes what it finds, and draws."""

    seeded = False


def drawing(friction, problem, weights, seed):  # noqa: ARG001
    return replace(friction, theta=friction.theta * (1.0 + 1e-3 * seed))


@dataclass
class Learning(Identifier):
    calls: int = 0

    def fit(self, problem, weights, seed):
        self.calls += 1
        return INNER.fit(problem, weights, seed)


class Nameless(Identifier):
    fit = INNER.fit


class Foreign:
    fit = INNER.fit


class Shapeless(CoulombViscous):
    def torque(self, theta, x, memory):
        return super().torque(theta, x, memory)[..., :1, :]


class Pulling(CoulombViscous):
    def limit(self, theta, x, memory):
        return -super().limit(theta, x, memory)


class Jointless(CoulombViscous):
    def torque(self, theta, x, memory):
        return CoulombViscous().torque(theta, x, memory)

    def limit(self, theta, x, memory):
        return theta[..., 0, 0]


class Wild(CoulombViscous):
    def torque(self, theta, x, memory):
        return super().torque(theta, x, memory) * np.where(x.w > 1.0, np.inf, 1.0)


class Forgetful(CoulombViscous):
    def __reduce__(self):
        return Forgetful, ()


class Mixing(CoulombViscous):
    def torque(self, theta, x, memory):
        return super().torque(theta + theta.mean(0), x, memory)


VIOLATIONS = [
    (Foreign(), "it must derive from Identifier"),
    (Ill(bare), "fit must give a Friction"),
    (Ill(single), r"theta must have shape \(3, 1, 2\), not \(1, 2\)"),
    (Ill(undefined), "theta must be finite; a failed fit raises"),
    (Ill(leaking), "fold 0 must be the same alone"),
    (Ill(absolute), "doubling all weights must change nothing"),
    (Ill(unweighted), "must have no influence"),
    (Ill(random), "the same seed must give the same numbers"),
    (Drawing(drawing), "another seed must give the same numbers"),
    (Ill(spoiling), "fit must not change the problem"),
    (Ill(wasting), "fit must not change the weights"),
    (Learning(), "fit must not change the settings"),
    (Nameless(), "repr must say its settings"),
    (with_law(Shapeless()), "torque must be .* along the nodes"),
    (with_law(Pulling()), "limit must not be negative"),
    (with_law(Jointless()), "limit must be .* at the nodes"),
    (with_law(Wild()), "torque must be finite along the nodes"),
    (with_law(Mixing()), "fold 0 must be the same alone"),
    (Ill(forgotten), "pickled friction must give the same torque"),
    (Ill(local), "its friction must pickle"),
]


@pytest.mark.parametrize(("identifier", "rule"), VIOLATIONS, ids=[rule for _, rule in VIOLATIONS])
def test_the_check_names_the_broken_rule(identifier, rule):
    with pytest.raises(AssertionError, match=rule) as raised:
        check_identifier(identifier, joints=(1,))
    assert "\n" not in str(raised.value)
    assert type(identifier).__name__ in str(raised.value)


def test_an_identifier_that_cannot_go_to_another_process_is_told_so():
    class Inner(Ill):
        pass

    with pytest.raises(AssertionError, match="it must pickle .*: define its class in a module"):
        check_identifier(Inner(bare), joints=(1,))


def test_the_tolerance_is_of_the_torques_size():
    with pytest.raises(AssertionError, match="differ by .* of their size"):
        check_identifier(Ill(leaking), joints=(2,), tolerance=1e-3)
    with pytest.raises(AssertionError, match="doubling"):
        check_identifier(Ill(absolute), joints=(1,), tolerance=0.03)
