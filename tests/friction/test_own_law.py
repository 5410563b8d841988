"""A law of one's own takes the path of a built-in law of the same equations, to the last bit."""

import sys
from dataclasses import dataclass

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.exact_problems import everything
from fixtures.paths import ROOT
from numpy.testing import assert_array_equal

from frictionid.data.plants import plant_of
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, problem_of
from frictionid.fitting.parameters import FrictionBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.friction import Friction, Law
from frictionid.friction.laws import Quadratic as BuiltIn
from frictionid.mechanics import Plant, double_pendulum

sys.path.append(str(ROOT / "comparisons"))
from own_friction import Quadratic as Own


@dataclass(frozen=True)
class OwnWithGradient(Own):
    level, terms, gradient = BuiltIn.level, BuiltIn.terms, BuiltIn.gradient


@dataclass(frozen=True)
class BuiltInWithoutGradient(BuiltIn):
    gradient = Law.gradient


PAIRS = pytest.mark.parametrize(
    ("own", "built_in"), [(Own, BuiltInWithoutGradient), (OwnWithGradient, BuiltIn)]
)
THETA = np.array([[0.3, 0.02, 0.003], [0.1, 0.01, 0.001]])


@PAIRS
def test_rollouts_through_stops_and_break_away_are_the_same(own, built_in):
    rng = np.random.default_rng(0)
    start = State(rng.uniform(-2.0, 2.0, (6, 2)), rng.uniform(-3.0, 3.0, (6, 2)))
    u, dt = rng.uniform(-0.4, 0.4, (60, 6, 2)), np.full(60, 1 / 60)
    plant = Plant.from_parameters(double_pendulum(), {})
    ours, theirs = (rollout(plant, Friction(law(), THETA), start, u, dt) for law in (own, built_in))
    assert (ours.w == 0.0).any()  # joints came to rest
    assert_array_equal(ours.q, theirs.q)
    assert_array_equal(ours.w, theirs.w)


@PAIRS
def test_fits_are_the_same(own, built_in):
    dataset = tiny.dataset()
    problem = problem_of(dataset, plant_of(dataset), INTEGRAL)
    weights = everything(problem)
    ours, theirs = (LeastSquares(law()).fit(problem, weights, 0) for law in (own, built_in))
    assert_array_equal(ours.theta, theirs.theta)


@PAIRS
def test_shooting_gives_the_same(own, built_in):
    """A law that declares the same parameters, too: their neutral values say what is left out."""

    @dataclass(frozen=True)
    class Declared(own):
        parameters = built_in().parameters

    dataset, settings = tiny.dataset(), Settings(windows=(0.1, 0.33), iterations=6)
    theta = np.array([[0.04, 0.005, 0.0]])
    ours, theirs = (
        refine(Friction(law(), theta), dataset, (FrictionBlock(),), settings)
        for law in (Declared, built_in)
    )
    assert_array_equal(ours.friction.theta, theirs.friction.theta)
    assert_array_equal(ours.covariance.error, theirs.covariance.error)
