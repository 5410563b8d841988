"""What work costs, in counts and memory: laws that hold on any machine, however busy it is."""

import tracemalloc
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
from frictionid.fitting.identifiers import LeastSquares, Linear
from frictionid.fitting.one_step.formulation import INTEGRAL, STUDY, training_problem
from frictionid.friction import Friction, along
from frictionid.friction.laws import CoulombViscous, Spline, Stribeck
from frictionid.mechanics.plant import Plant

THETA = np.array([[0.16, 0.004], [0.05, 0.001]])
LINEAR = 4.4  # times the memory, for four times the samples


@pytest.fixture(scope="module")
def acrobot():
    return load_dataset(ROOT / "data" / "acrobot_clean")


def peak(work):
    """Most memory [bytes] that a piece of work has at once; loops are compiled before."""
    work()
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def recordings(dataset, count):
    return replace(dataset, recordings=dataset.recordings[:count])


@pytest.mark.parametrize("recipe", [STUDY, INTEGRAL], ids=["study", "integral"])
def test_memory_of_one_step_problems_grows_with_the_samples_at_most(acrobot, recipe):
    def work(count):
        some = recordings(acrobot, count)
        states = recipe.states([r.angle for r in some.recordings])
        return lambda: training_problem(some, plant_of(some), recipe, states=states)

    assert peak(work(24)) < LINEAR * peak(work(6))


def test_memory_of_residuals_grows_with_the_samples_at_most(acrobot):
    friction = Friction(CoulombViscous(), THETA)

    def work(count):
        some = recordings(acrobot, count)
        problem = training_problem(some, plant_of(some), INTEGRAL)
        return lambda: problem.residual(along(friction, problem.nodes))

    assert peak(work(24)) < LINEAR * peak(work(6))


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


@pytest.mark.parametrize(
    "identifier", [Linear(Spline()), LeastSquares(Stribeck())], ids=["linear", "stribeck"]
)
def test_fits_of_ten_folds_never_evaluate_the_physics(acrobot, identifier, monkeypatch):
    some = recordings(acrobot, 10)
    problem = training_problem(some, plant_of(some), INTEGRAL)
    folds = make_folds(some.recordings, Split(count=10))
    weights = folds.training(problem.recording, problem.time)
    counted = Counted(monkeypatch)
    training_problem(some, plant_of(some), INTEGRAL)
    built, counted.calls = counted.calls, 0
    assert built == len(some.recordings)  # once each, for all samples
    identifier.fit(problem, weights, 0)
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


def test_ten_folds_evaluate_a_law_as_often_as_the_slowest_of_them(acrobot, monkeypatch):
    some = recordings(acrobot, 10)
    problem = training_problem(some, plant_of(some), INTEGRAL)
    folds = make_folds(some.recordings, Split(count=10))
    weights = folds.training(problem.recording, problem.time)
    counts, own = [], Stribeck.torque

    def counting(law, *arguments):
        counts[-1] += 1
        return own(law, *arguments)

    monkeypatch.setattr(Stribeck, "torque", counting)
    for rows in (weights, *weights[:, None]):
        counts.append(0)
        LeastSquares(Stribeck()).fit(problem, rows, 0)
    assert counts[0] <= 2 * max(counts[1:]) < sum(counts[1:])
