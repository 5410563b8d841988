"""The identifier `sindy`: which candidates friction has, their coefficients, active sets."""

import time
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from fixtures.driven_pendulum import driven_pendulum
from fixtures.exact_problems import COULOMB, cost, everything, explained_by, fit_to_all, half_widths
from fixtures.paths import DATA
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from pysindy import FourierLibrary, PolynomialLibrary

from frictionid.comparison.fit_model import with_notes
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.files import read_json
from frictionid.fitting.identifiers import LeastSquares, SINDy, active_sets
from frictionid.fitting.identifiers.active_sets import (
    Constraints,
    admissible,
    best_fits,
    best_proposals,
    best_sets_of_joint,
    held_out_costs,
)
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.one_step.linearised import clusters, columns, grams
from frictionid.fitting.one_step.recipe import INTEGRAL, one_step_fit, training_problem
from frictionid.fitting.shooting import Settings, Shooting
from frictionid.fitting.shooting.recipe import refine_folds
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.friction import Friction, Inputs, along, at_rest
from frictionid.friction.laws import CoulombViscous, Library, Stribeck, check_law
from frictionid.simulate import write_dataset

LAW = Library()
STRIBECK = np.array([[0.10, 0.05, 0.9, 0.02], [0.05, 0.04, 3.2, 0.01]])  # between the grid's ws
EVERYTHING = Library(harmonics=(1, 2), gear=2.0, load=True, direction=True, other=True)


def fit(problem, weights=None, **settings):
    weights = everything(problem) if weights is None else weights
    return SINDy(**settings).fit(problem, weights, 0)


def terms(friction):
    """Names of the candidates of each joint, of one friction (n, P)."""
    names = friction.law.names
    return [[names[i] for i in np.flatnonzero(row)] for row in friction.theta]


def theta_of(law, *joints):
    """Coefficients (n, P) from names and values."""
    return np.array([[joint.get(name, 0.0) for name in law.names] for joint in joints])


@pytest.mark.parametrize(
    ("law", "theta", "peaks"),
    [(CoulombViscous(), COULOMB, ([], [])), (Stribeck(), STRIBECK, (["peak_1"], ["peak_3.4"]))],
    ids=["coulomb", "stribeck"],
)
def test_ten_seeds_give_levels_viscous_friction_the_nearest_peak_and_nothing_else(
    law, theta, peaks
):
    found = [terms(fit(explained_by(law, theta, 1e-3, seed))[0]) for seed in range(10)]
    assert found.count([["coulomb", "viscous", *peak] for peak in peaks]) >= 9


@pytest.mark.parametrize("optimizer", ["stlsq", "sr3"])
def test_truth_in_truth_out(optimizer):
    truth = theta_of(
        LAW, {"coulomb": 0.1, "cubic": 1e-4}, {"coulomb": 0.05, "drag": 1e-3, "peak_3.4": 0.03}
    )
    found = fit(explained_by(LAW, truth), optimizer=optimizer)
    assert_allclose(found.theta[0], truth, rtol=1e-6, atol=1e-9)


def test_candidates_on_request_are_found_where_they_are_true():
    law = Library(harmonics=(1,), direction=True, other=True, velocities=(1.0, 3.0))
    truth = theta_of(
        law,
        {"coulomb": 0.1, "viscous": 0.02, "sin_1": -0.03, "offset_coulomb": 0.02},
        {"coulomb": 0.05, "peak_3": 0.03, "other": 0.004},
    )
    found = fit(explained_by(law, truth, 1e-5), library=law)
    assert terms(found[0]) == terms(Friction(law, truth))
    assert_allclose(found.theta[0], truth, atol=1e-3)


@pytest.fixture(scope="module")
def acrobot():
    """One-step problem of simulated recordings: set-valued truth, noise and a camera."""
    dataset = load_dataset(DATA / "acrobot_clean")
    return training_problem(dataset, plant_of(dataset), INTEGRAL)


def test_ten_folds_take_less_processor_time_than_promised(acrobot):
    identifier = SINDy()
    weights = (acrobot.recording % 10 != np.arange(10)[:, None]) * 1.0
    identifier.fit(acrobot, weights[:1], 0)  # imports
    times = []
    for _ in range(3):
        begin = time.process_time()
        identifier.fit(acrobot, weights, 0)
        times.append(time.process_time() - begin)
    assert min(times) < 0.5


def test_on_simulated_recordings_of_a_stick_it_finds_the_true_terms(acrobot):
    """The true peaks are at 2 rad/s, between 1.5 and 2.3."""
    problem = acrobot
    friction = fit(problem)[0]
    assert terms(friction) == [["coulomb", "viscous"], ["coulomb", "viscous", "peak_2.3"]]
    sided = fit(problem, library=Library(direction=True))[0]
    expected = ["coulomb", "viscous", "peak_2.3", "offset_coulomb", "offset_peak_2.3"]
    assert terms(sided) == [["coulomb", "viscous"], expected]
    half = half_widths(friction, problem, everything(problem)[0])
    coulomb = LAW.names.index("coulomb")
    assert friction.theta[0, coulomb] == pytest.approx(0.165, rel=0.03)
    assert (half[friction.theta != 0] < 0.2 * friction.theta[friction.theta != 0]).all()
    assert np.isnan(half[friction.theta == 0]).all()


def test_on_its_active_set_it_is_least_squares():
    problem = explained_by(Stribeck(), STRIBECK, 1e-3)
    weights = synthetic_weights(problem)
    found = fit(problem, weights)
    rng = default_rng(3)
    for _ in range(5):
        off = found.theta * (1 + 1e-3 * rng.standard_normal(found.theta.shape))
        assert (cost(problem, weights, Friction(LAW, off)) >= cost(problem, weights, found)).all()


def test_columns_are_those_of_pysindys_libraries():
    w = np.linspace(0.5, 3, 7)[:, None]
    x = at_rest(w)._replace(q=2 * w)
    law = Library(width=1e-9, widths=(), velocities=(), harmonics=(1, 2))
    ours = law.gradient(np.zeros((1, len(law.names))), x)[:, 0]
    powers = PolynomialLibrary(degree=3, include_bias=False).fit_transform(w)
    waves = FourierLibrary(n_frequencies=2, include_sin=True).fit_transform(x.q)
    assert_allclose(ours[:, 1:4], powers)
    assert_allclose(ours[:, 4:], np.asarray(waves)[:, [1, 0, 3, 2]])


def test_ensembles_say_how_often_a_term_is_there():
    problem = explained_by(CoulombViscous(), COULOMB, 1e-3)
    sindy = SINDy(Library(velocities=(1.0, 3.0), widths=()), ensemble=12)
    given = problem, everything(problem), 0
    share, found = sindy.inclusion(*given, draws=12)[0], sindy.fit(*given)
    assert (share[:, [sindy.library.names.index(n) for n in ("coulomb", "viscous")]] > 0.9).all()
    assert terms(found[0]) == [["coulomb", "viscous"]] * 2
    for line, own in zip(found.provenance.inclusion, share, strict=True):
        assert line.count("%") == (own > 0).sum() and f" {100 * own.max():.0f} %" in line
    assert_array_equal(share.clip(0, 1), sindy.inclusion(*given, draws=12)[0])


def test_the_law_keeps_to_the_contract_with_all_candidates():
    check_law(replace(EVERYTHING, direction=False, harmonics=()))
    check_law(EVERYTHING, level=False)
    narrow = replace(EVERYTHING, width=1e-9)
    theta = np.abs(default_rng(0).standard_normal((2, len(narrow.names))))
    x = Inputs(*default_rng(1).uniform(0, 1, (4, 9, 2)))
    for side in (1.0, -1.0):  # nothing but `other`, which is no level, sees the other joint
        near = at_rest(side * 1e-6 + 0 * x.w)._replace(q=x.q, load=x.load)
        level = side * narrow.torque(theta, near, ())
        assert_allclose(narrow.limit(theta, near, ()), np.maximum(level, 0), atol=1e-4)


def test_each_fold_is_refined_on_the_terms_that_it_has():
    dataset = driven_pendulum(80, 4)
    law = Library(velocities=(1.0,), widths=(), powers=(1, 2))
    own = ({"coulomb": 0.03, "viscous": 0.001}, {"coulomb": 0.03, "drag": 1e-4}, {"coulomb": 0.03})
    start = Friction(law, np.stack([theta_of(law, one) for one in own]))
    intervals = intervals_of(dataset)
    training = np.ones((3, len(intervals.dt)))
    training[:2] = intervals.recording[None] != np.arange(2)[:, None]
    recipe = Shooting(settings=Settings(windows=(0.2, 0.33)))
    whole = refine_folds(start, intervals, recipe, training)
    friction = whole.folds
    assert_array_equal(friction.theta != 0, start.theta != 0)
    names = [p.name for p in whole.covariance.parameters if p.block == "friction"]
    assert names == ["coulomb of joint 1"]
    assert_allclose(friction.theta[0, 0, :2], [0.02, 0.002], rtol=0.15)
    shot = with_notes(whole).provenance
    (line,) = shot.equation
    assert shot.equation_errors == "95 % intervals"
    assert line.startswith("Tf1 = (0.02") and "+-" in line


def test_fit_prints_and_keeps_its_equation(tmp_path, run):
    write_dataset(driven_pendulum(80, 4), tmp_path / "data")
    model = tmp_path / "model.json"
    words = ("fit", "data", "--identifier", "sindy", "--by", "one_step", "--out", model)
    code, out, _ = run(tmp_path, *words)
    assert code == 0
    lines = out.splitlines()
    meaning = "standard errors of the noise alone, bias of the smoothing not included"
    place = lines.index(f"with {meaning}:")
    assert lines[place + 1].startswith("  Tf1 = (0.0") and "s(w" in lines[place + 1]
    assert read_json(model)["provenance"]["equation"] == [lines[place + 1].strip()]
    assert read_json(model)["provenance"]["equation_errors"] == meaning
    assert "95 %" not in " ".join(lines)
    assert not any(" 0 N m" in line for line in lines)


def test_it_writes_its_equation_with_units_and_intervals():
    problem = explained_by(CoulombViscous(), COULOMB, 1e-3)
    found = fit(problem)
    own = one_step_fit(found, problem, everything(problem)[0])
    lines = with_notes(own).provenance.equation
    assert len(lines) == 2 and lines[0].startswith("Tf1 = (0.1")
    assert "N m s(w) + (0.0" in lines[0] and lines[1].endswith("N m s/rad w")
    assert lines[0].count("+-") == 2
    other = replace(found, law=CoulombViscous(), theta=COULOMB[None], provenance={})
    assert not with_notes(
        replace(own, friction=other[0], folds=other), intervals=False
    ).provenance.notes
    assert LAW.equation(0.0 * found.theta[0])[0] == "Tf1 = 0"
    axis = Library(velocities=()).equation(np.array([[1.0, 0, 0, -2.0, 0, 0]]), None, ("m",))
    assert axis == ["Tf1 = 1 N s(w) - 2 N s/m w"]


def test_intervals_hold_the_truth_about_as_often_as_they_say():
    inside = []
    for seed in range(40):
        problem = explained_by(CoulombViscous(), COULOMB, 1e-3, seed)
        found = fit_to_all(LeastSquares(CoulombViscous()), problem)[0]
        half = half_widths(found, problem, everything(problem)[0])
        inside.append(np.abs(found.theta - COULOMB) < half)
    assert 0.85 < np.mean(inside) < 0.995


def test_a_fold_that_trains_on_noise_alone_has_no_friction():
    problem = synthetic_problem(2)
    noise = default_rng(0).standard_normal(problem.r.shape)
    found = fit(replace(problem, r=noise))
    assert (found.theta[0] != 0).sum() <= 2
    assert along(found, problem.nodes).shape == (1, *problem.nodes.inputs.w.shape)


def test_a_soft_sign_and_a_level_at_rest_exclude_each_other():
    names, conflicts = LAW.names, LAW.conflicts
    pair = {(names[i], names[j]) for i, j in np.argwhere(conflicts)}
    assert ("sign_1", "peak_1") in pair and ("peak_1", "peak_1.5") in pair
    assert ("coulomb", "peak_1") not in pair and ("sign_1", "viscous") not in pair
    assert (conflicts == conflicts.T).all() and conflicts.diagonal().all()


def test_problems_without_motion_are_refused():
    problem = synthetic_problem(1)
    with assert_refused("no joint slides in the rows of fold 0"):
        fit(replace(problem, G=0.0 * problem.G))


# --- Active sets ----------------------------------------------------------------------------------


def gram_matrices(problem):
    """Gram matrices of one fold as SINDy sees them, and its constraints."""
    G, _, constraints = next(SINDy()._folds(problem, everything(problem)))
    return G, constraints


def test_the_search_finds_the_best_of_all_sets_of_a_joint():
    problem = explained_by(Stribeck(), STRIBECK, 1e-3)
    G, constraints = gram_matrices(problem)
    T, fixed = G.sum(0), [16, 19]
    sets = best_sets_of_joint(T, constraints, fixed, 0, [])
    assert [len(one.columns) for one in sets] == list(range(2, 2 + len(sets)))
    for one in sets[:4]:
        size = len(one.columns) - 2
        costs = [
            cost_[0]
            for own in combinations(np.flatnonzero(constraints.usable[:16]), size)
            if not (constraints.conflict[np.ix_(own, own)] & ~np.eye(size, dtype=bool)).any()
            for cost_, c in [best_fits(T, np.array([[*own, *fixed]]))]
            if (c > 0).all()
        ]
        assert one.cost == pytest.approx(min(costs), rel=1e-12)


def test_where_sets_are_too_many_they_are_extended_and_exchanged(monkeypatch):
    problem = explained_by(Stribeck(), STRIBECK, 1e-3)
    G, constraints = gram_matrices(problem)

    def by_size():
        sets = best_sets_of_joint(G.sum(0), constraints, [16, 19], 0, [])
        return {len(one.columns): one for one in sets}

    every = by_size()
    monkeypatch.setattr(active_sets, "_LIMIT", 20)
    few = by_size()
    assert few[3] == every[3]
    assert few[4].cost < few[3].cost
    assert all(few[size].cost >= every[size].cost * (1 - 1e-9) for size in few if size in every)


def test_held_out_costs_are_those_of_fits_to_the_other_clusters():
    problem = explained_by(CoulombViscous(), COULOMB, 1e-3)
    G, _ = gram_matrices(problem)
    A = columns(LAW, problem)
    label, S = clusters(problem), [0, 3]
    scale = np.sqrt(np.einsum("cii->i", grams(A, everything(problem) / len(A), label)[0]))
    A = A / scale / np.sqrt(len(A))
    losses = held_out_costs(G, S)
    for c in (0, 5, 20):
        rest, out = (A[which].reshape(-1, A.shape[-1]) for which in (label != c, label == c))
        b = np.linalg.lstsq(rest[:, S], rest[:, -1], rcond=None)[0]
        assert losses[c] == pytest.approx(((out[:, -1] - out[:, S] @ b) ** 2).sum(), rel=1e-6)


def test_active_sets_have_one_of_a_family_and_nothing_that_drives():
    rng = default_rng(0)
    a = rng.standard_normal((50, 4))
    a[:, 3] = a[:, 0] - a[:, 2]
    T = a.T @ a
    alike = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], dtype=bool)
    every, size = np.ones(3, dtype=bool), np.array([2.0, 1.0, -1.0])
    constraints = Constraints(np.zeros(3, dtype=int), alike, every, every)
    assert admissible(size, T, constraints) == (0,)
    assert admissible(np.abs(size), T, constraints) == (0,)  # the third one would drive
    free = constraints._replace(positive=np.array([True, True, False]))
    assert admissible(size, T, free) == (0, 2)
    assert best_sets_of_joint(T, free, [], 0, [(1,)])[-1].columns == (0, 2)
    assert best_proposals(T, free, [(1,), (0, 2)])[-1].columns == (0, 2)
    assert_allclose(best_fits(T, np.array([[0, 2]]))[1][0], [1.0, -1.0], atol=1e-9)


def test_peaks_that_the_motion_does_not_show_are_no_candidates():
    problem = explained_by(CoulombViscous(), COULOMB, 1e-3)
    _, constraints = gram_matrices(problem)
    usable = dict(zip(LAW.names, constraints.usable[:16], strict=True))
    assert usable["peak_3.4"] and not usable["peak_11"]
    fastest = np.abs(problem.nodes.inputs.w[:, 0]).max()
    assert 3.4 < fastest < 1.5 * 11
