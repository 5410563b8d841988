"""What data do not tell stays at neutral values, and priors weigh what they say."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.exact_problems import everything, explained_by
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from test_sandwich import of_rows

from frictionid.fitting.fit import Covariance
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.neutral import LocalCost, Unknown, followed, sentences_of, with_held
from frictionid.fitting.one_step.recipe import covariance_of_fit
from frictionid.fitting.parameter_block import FREE, Parameter
from frictionid.fitting.parameters import FrictionBlock, InertiaBlock
from frictionid.fitting.sandwich import Groups, excess_of
from frictionid.fitting.shooting import Settings, refine, stages
from frictionid.fitting.shooting.gauss_newton import solve
from frictionid.friction import DataRange, Friction, constraints_of
from frictionid.friction.laws import CoulombViscous, LoadDependent, MotorLoad, Quadratic, Stribeck
from frictionid.mechanics import mechanism_of, pendulum

FAST = 2.0  # [rad/s]
SHORT = Settings(windows=(0.1, 0.3))
LINE = [[0.1, 0.02]]
START = Friction(CoulombViscous(), [[0.02, 0.002]])


def fitted(law, problem, rows, **settings):
    return LeastSquares(law, **settings).fit(problem, rows, 0)[0]


@pytest.mark.parametrize(("unit", "value"), [("N m", "0 N m."), ("1", "0.")])
def test_what_stays_at_its_neutral_value_is_said_in_its_unit(unit, value):
    held = Unknown(Parameter("friction", "loss of joint 1", unit, 0.2), 0.0, 0.3, 1.0, 1.0)
    assert held.sentence.endswith(f"stays at {value}")


@pytest.mark.parametrize("count", [3, 30])
def test_many_base_parameters_are_named_in_one_sentence(count):
    loss = Unknown(Parameter("friction", "loss of joint 1", "1", 0.2), 0.0, 0.3, 1.0, 1.0)
    base = [
        loss._replace(parameter=Parameter("inertia", f"Ixx_{k}", "kg m^2", 0.2))
        for k in range(count)
    ]
    first, *others = sentences_of([loss, *base])
    assert first == loss.sentence
    assert len(others) == (3 if count == 3 else 1) and all("Ixx_0" in others[0] for _ in others)
    assert count == 3 or "Ixx_2 and 27 more are not identified" in others[0]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("one_way", "close"), [(False, 0.01), (True, 1e-4)])
def test_what_fast_rows_show_of_a_rich_law_is_the_law_without_the_rest(one_way, close, seed):
    """Even where the peak has taken the level's place, which the other direction followed then."""
    problem = explained_by(CoulombViscous(), LINE, 2e-3, seed)
    speeds = problem.nodes.inputs.w[problem.stencil]
    speeds = speeds if one_way else np.abs(speeds)
    rows = (speeds > FAST).all(axis=(1, 2))[None] * 1.0
    laws = CoulombViscous(), Stribeck(symmetric=not one_way)
    plain, rich = (fitted(law, problem, rows) for law in laws)
    w = np.linspace(FAST, 8.0, 20)
    assert_allclose(rich.curve(w), plain.curve(w), rtol=close)
    assert_allclose(rich.curve(-w), plain.curve(-w), rtol=close)
    assert one_way or rich.theta[0, 1] < 0.1 * rich.theta[0, 0]  # the peak


def test_what_the_rows_tell_is_the_plain_minimum():
    truth = [[0.1, 0.04, 1.5, 0.02]]
    problem = explained_by(Stribeck(), truth, 1e-3, 1)
    both = [fitted(Stribeck(), problem, everything(problem), neutral=n) for n in (True, False)]
    assert_array_equal(both[0].theta, both[1].theta)


def test_a_prior_stands_in_place_of_the_neutral_value():
    problem = explained_by(CoulombViscous(), LINE, 2e-3, 2)
    rows = everything(problem)
    held = fitted(Quadratic(), problem, rows, prior={"drag": (0.004, 1e-9)})
    assert held.theta[0, 2] == pytest.approx(0.004, rel=1e-3)


@pytest.mark.parametrize("lasting", [6, 12])
def test_a_prior_of_one_step_weighs_what_it_says_beside_the_scatter_of_stretches(lasting):
    """Errors that last as long as some rows: mean by the precisions of both, two routes."""
    problem = explained_by(CoulombViscous(), LINE, 0.0, 3)
    count = -(-len(problem.r) // lasting)
    noise = default_rng(4).normal(size=(count, 1)).repeat(lasting, axis=0)
    problem = replace(problem, r=problem.r + 0.01 * noise[: len(problem.r)])
    rows, plain = everything(problem), LeastSquares(CoulombViscous(), robust=None)
    theta = plain.fit(problem, rows, 0)[0].theta[0]
    covariance, _ = covariance_of_fit(plain.fit(problem, rows, 0)[0], problem, rows[0])
    error = float(np.sqrt(covariance[1, 1]))
    informed = replace(plain, prior={"viscous": (theta[1] + error, error)})
    found = informed.fit(problem, rows, 0)[0].theta[0, 1]
    assert (found - theta[1]) / error == pytest.approx(0.5, abs=0.05)


def test_shooting_says_what_it_holds_and_how_far_off_that_may_be():
    """Without motor torque nothing shows of the share that a gear loses of it."""
    start = Friction(MotorLoad(), [[0.02, 0.002, 0.2]])
    found = refine(start, tiny.dataset(recordings=tiny.still()), (FrictionBlock(),), SHORT)
    (loss,) = (k for k, p in enumerate(found.covariance.parameters) if "loss" in p.name)
    assert found.friction.theta[0, 2] == found.covariance.values[loss] == 0.0
    assert found.covariance.error[loss] == pytest.approx(0.3)
    assert not found.covariance.identified[loss]
    assert any("loss of joint 1 is not identified" in w for w in found.diagnostics.warnings)


def test_of_two_directions_that_data_do_not_tell_one_follows_the_other():
    law = CoulombViscous(symmetric=False)
    limits = constraints_of(law, DataRange(*np.array([[0.1], [9.0], [0.2]])))
    friction = Friction(law, [[0.3, 0.1, 0.01]], constraints=limits)
    parameters = tuple(
        Parameter("friction", name, "N m", 0.0, 0.0, place=(0, i), size=float(limits.size[0, i]))
        for i, name in enumerate(law.names)
    )
    X = default_rng(1).normal(size=(30, 5, 3)) * [1.0, 0.0, 0.3]
    H, values = np.einsum("gri,grj->gij", X, X), friction.theta[0]
    score = default_rng(2).normal(size=(30, 3)) * [9.0, 0.0, 0.1]
    groups = Groups(H, score - score.mean(axis=0), 0 * values, values > 0, *2 * (np.arange(30),))
    cost = LocalCost(parameters, values, groups, friction, (FrictionBlock(),))
    held, _ = cost.idle((), 1.0)
    assert [(u.parameter.name, u.neutral) for u in held] == [("coulomb_negative", 0.3)]
    later = replace(friction, theta=np.array([[0.4, 0.3, 0.01]]))
    assert [u.neutral for u in followed(later, held)] == [0.4]


def test_what_a_quadratic_foresees_is_what_a_fit_without_the_parameter_finds():
    """Linear rows with a bound and a prior: held parameters, minimum, groups and their scores."""
    draw = default_rng(0)
    X, truth = draw.normal(size=(40, 5, 4)), np.array([1.0, 0.1, -1.0, 2.0])
    y = X @ truth + draw.normal(size=(40, 5))
    kinds = ({"low": 0.0}, {"tolerance": 0.5}, {}, {})
    parameters = tuple(
        Parameter("bias", str(k), "N m", 0.0, place=(k,), **kind) for k, kind in enumerate(kinds)
    )

    def fit(rest, start, y):
        H, g = (np.einsum("gri,gr...->gi...", X[..., rest], z) for z in (X[..., rest], y))
        prior = np.diag([parameters[k].tolerance ** -2.0 for k in rest])
        end = np.linalg.solve(H.sum(axis=0) + prior, g.sum(axis=0))
        at = start[rest]
        groups = Groups(H, g - H @ at, end - at, np.ones(len(rest)) > 0, *2 * (np.arange(40),))
        return end, groups

    start, law = draw.normal(size=4), Friction(CoulombViscous(), np.array(LINE))
    end, groups = fit([0, 1, 2, 3], start, y)
    without = LocalCost(parameters, end, groups, law, ()).holding({3: 1.5})
    again, other = fit([0, 1, 2], start, y - 1.5 * X[..., 3])
    assert_allclose(without.values, again)
    assert_allclose(without.groups.score, other.score, atol=1e-9)
    assert_allclose(without.groups.H, other.H)
    assert [p.name for p in without.parameters] == ["0", "1", "2"] and without.groups.free.all()
    bound = LocalCost(parameters, end, groups, law, ()).holding({2: 50.0, 3: -90.0})
    assert bound.values[0] == 0.0 and not bound.groups.free[0]


# --- Weights of priors ----------------------------------------------------------------------------


def groups_of(seed, copies):
    """Normal equations of 12 recordings; with copies every sample counts so many times."""
    rng = default_rng(seed)
    A = rng.standard_normal((12, 30, 2))
    y = A @ [1.0, 0.5] + rng.standard_normal((12, 30))
    groups = of_rows(A, y, np.arange(12))
    return groups._replace(H=copies * groups.H, g=copies * groups.g)


def test_a_prior_weighs_the_same_however_often_a_sample_is_counted():
    parameters = (
        Parameter("inertia", "inertia", "kg m^2", 1.0, tolerance=0.1),
        Parameter("inertia", "gravity", "N m", 0.5),
    )
    once, often = (excess_of(groups_of(3, copies), parameters) for copies in (1, 100))
    assert 1.0 <= once[0] < 3.0 and once[1] == often[1] == 1.0
    assert often[0] == pytest.approx(100.0 * once[0], rel=0.4) or once[0] == 1.0


def test_a_tolerance_draws_a_wrong_mass_towards_what_was_stated():
    """Nominal masses 3 % off, stated as 5 %: the data correct them; stated as .01 % they stay."""
    wrong = tiny.heavier(1.03)
    found = {}
    for tolerance in (5.0, 0.01):
        mechanism = mechanism_of({**wrong, "tolerances": {"mass": tolerance}})
        data = replace(tiny.dataset(), mechanism=mechanism)
        fit = refine(START, data, (FrictionBlock(), InertiaBlock()), SHORT)
        found[tolerance] = float(fit.calibration.base[0])
    nominal = 0.206 * 0.2**2
    assert found[0.01] == pytest.approx(nominal, rel=1e-3)
    assert abs(found[5.0] - tiny.INERTIA) < 0.5 * abs(nominal - tiny.INERTIA)


def test_the_interval_of_a_load_coefficient_holds_what_the_mass_may_be_off():
    """Ten times the mass's tolerance adds ten times as much; parameters without load ignore it."""
    start, data = Friction(LoadDependent(), [[0.01, 0.002, 0.002]]), tiny.dataset()
    squares = {}
    for tolerance in (0.0, 0.5, 5.0):
        tolerances = {"mass": tolerance} if tolerance else {}
        mechanism = replace(data.mechanism, tolerances=tolerances)
        fit = refine(start, replace(data, mechanism=mechanism), (FrictionBlock(),), SHORT)
        squares[tolerance] = np.diag(fit.covariance.matrix)
    added = [np.sqrt(squares[t] - squares[0.0]) for t in (0.5, 5.0)]
    load = float(fit.covariance.values[1])
    assert_allclose(added[0][1], 0.005 * load, rtol=0.2)
    assert_allclose(added[1][1], 10.0 * added[0][1], rtol=0.1)
    assert (added[1][[0, 2]] < 0.3 * np.sqrt(squares[0.0][[0, 2]])).all()


def test_tolerances_reach_the_base_parameters_to_first_order():
    m = replace(pendulum(mass=0.5, length=0.2), tolerances={"length": 2.0})
    share = m.base_tolerances() / m.base(m.nominal())
    assert_allclose(share, [0.04, 0.02], rtol=1e-3)  # m l^2 and m g l
    assert not np.isfinite(pendulum(mass=0.5, length=0.2).base_tolerances()).any()
    every = replace(m, tolerances={"all": 1.0})
    assert (every.base_tolerances() > 0).all()
    assert every.table["tolerances"] == {"all": 1.0}


WRONG = """
mas = 1.0 => did you mean 'mass'
mass = -1.0 => must be a positive number, in %
"""


@mistakes(WRONG)
def test_wrong_tolerances_are_refused(wrong, words):
    with assert_refused(words):
        mechanism_of({"kind": "pendulum", "tolerances": changes(wrong)})


def test_a_fit_that_predicts_no_window_says_so(monkeypatch):
    """Far off, all windows may be left out: then nothing is known, and that is no traceback."""

    def astray(*arguments):
        solution = solve(*arguments)
        return solution._replace(counts=0.0 * solution.counts)

    monkeypatch.setattr(stages, "solve", astray)
    with assert_refused("went astray, and predicts no window"):
        refine(START, tiny.dataset(), (FrictionBlock(), InertiaBlock()), SHORT)


def two_free(count, matrix):
    """Parameters, and the covariance of the first two."""
    parameters = [Parameter("friction", f"p{i}", "N m", 0.5, place=(0, i)) for i in range(count)]
    return parameters, Covariance(tuple(parameters[:2]), np.full(2, 0.5), matrix)


def test_free_parameters_are_as_uncertain_beside_held_ones_as_beside_ones_with_a_prior():
    X, size = default_rng(5).normal(size=(40, 4)), np.array([0.3, 0.8])
    H = X.T @ X
    parameters, free = two_free(4, np.linalg.inv(H[:2, :2]))
    held = [Unknown(p, 0.0, s, 1.0, 0.0) for p, s in zip(parameters[2:], size, strict=True)]
    both = with_held(free, held, (), parameters, H)
    prior = np.diag([0.0, 0.0, *size**-2])
    assert_allclose(both.matrix, np.linalg.inv(H + prior), rtol=1e-12)
    assert [p.tolerance for p in both.parameters] == [FREE, FREE, 0.0, 0.0]


def test_what_nobody_knows_at_all_stays_so_beside_held_ones():
    parameters, free = two_free(3, np.diag([0.1, np.inf]))
    both = with_held(free, [Unknown(parameters[2], 0.0, 0.3, 1.0, 0.0)], (), parameters, np.eye(3))
    assert_array_equal(both.matrix[1], [0.0, np.inf, 0.0])


def test_intervals_beside_sensors_that_were_left_out_are_those_beside_free_ones():
    """But for one whose column others add up to: nothing tells it, and it is ideal."""
    X = default_rng(5).normal(size=(40, 5))
    X[:, 4] = X[:, 0] - X[:, 1]
    H = X.T @ X
    parameters, free = two_free(5, np.linalg.inv(H[:2, :2]))
    both = with_held(free, (), (), parameters, H)
    assert_allclose(both.matrix, np.linalg.inv(H[:4, :4])[:2, :2], rtol=1e-9)
