"""What work costs, in counts: laws that hold on any machine, however busy it is."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.paths import ROOT

from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.dynamics import rollout as prediction
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.evaluation import Split, make_folds
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, training_problem
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.mechanics.plant import Plant

THETA = np.array([[0.16, 0.004], [0.05, 0.001]])


@pytest.fixture(scope="module")
def acrobot():
    return load_dataset(ROOT / "data/acrobot_clean")


@pytest.fixture(scope="module")
def ten_folds(acrobot):
    """Ten recordings, their one-step problem, and the weights of its rows in ten folds."""
    some = replace(acrobot, recordings=acrobot.recordings[:10])
    problem = training_problem(some, plant_of(some), INTEGRAL)
    folds = make_folds(some.recordings, Split(count=10))
    return some, problem, folds.training(problem.recording, problem.time)


class Counted:
    """How often the physics is evaluated, and for how many rows."""

    def __init__(self, monkeypatch):
        self.calls = 0
        for name in ("terms", "dynamics"):
            monkeypatch.setattr(Plant, name, self._counting(getattr(Plant, name)))

    def _counting(self, own):
        def call(plant, q, w):
            self.calls += 1
            return own(plant, q, w)

        return call


def test_fits_of_ten_folds_never_evaluate_the_physics(ten_folds, monkeypatch):
    some, problem, weights = ten_folds
    counted = Counted(monkeypatch)
    training_problem(some, plant_of(some), INTEGRAL)
    built, counted.calls = counted.calls, 0
    assert built == len(some.recordings)  # once each, for all samples
    LeastSquares(Stribeck()).fit(problem, weights, 0)
    assert counted.calls == 0


def test_a_thousand_rollouts_call_the_physics_as_often_as_one(acrobot, monkeypatch):
    plant, friction = plant_of(acrobot)[0], Friction(CoulombViscous(), THETA)
    counted, calls = Counted(monkeypatch), []
    monkeypatch.setattr(prediction, "MANY", 10**9)  # as arrays, which compiled loops do not need
    for count in (1, 1000):
        start = State(np.tile([0.3, -0.2], (count, 1)), np.tile([1.0, 2.0], (count, 1)))
        u, dt = np.zeros((20, count, 2)), np.full((20, count), 1 / 60)
        counted.calls = 0
        rollout(plant, friction, start, u, dt)
        calls.append(counted.calls)
    assert calls[0] == calls[1] > 20


def test_ten_folds_evaluate_a_law_as_often_as_the_slowest_of_them(ten_folds, monkeypatch):
    _, problem, weights = ten_folds
    counts, own = [], Stribeck.torque

    def counting(law, *arguments):
        counts[-1] += 1
        return own(law, *arguments)

    monkeypatch.setattr(Stribeck, "torque", counting)
    for rows in (weights, *weights[:, None]):
        counts.append(0)
        LeastSquares(Stribeck()).fit(problem, rows, 0)
    assert counts[0] <= 2 * max(counts[1:]) < sum(counts[1:])
