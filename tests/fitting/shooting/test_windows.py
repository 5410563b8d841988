"""Initial states eliminated, no window that explodes, and steps of shooting."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.tiny_pendulums import PENDULUM, dataset
from fixtures.true_curves import plain_friction
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.arrays import picked
from frictionid.dynamics import step_size
from frictionid.errors import NoFitError
from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, beginning, gauss_newton, refine, stages
from frictionid.fitting.shooting.gauss_newton import _initial_noise
from frictionid.fitting.shooting.problem import Linearisation
from frictionid.fitting.shooting.sample_intervals import cut_windows, intervals_of
from frictionid.fitting.shooting.window_steps import Point, cost_of, counts_of, with_windows_checked
from frictionid.fitting.shooting.windows import WindowPrediction, eliminate_states, predict_windows
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.progress import listening
from frictionid.report.shooting_results import shooting_words
from frictionid.simulate import Camera, Rig, Run, simulate

W, N, JOINTS, SHARED = 5, 7, 2, 3
STATE = 2 * JOINTS
SIGMA = np.array([0.5, 2.0])


def prediction_of(rng, steep=1.0):
    shape = (W, N + 1, JOINTS)
    columns = steep ** rng.random((W, 1, 1, STATE + SHARED))
    return WindowPrediction(
        error=rng.normal(size=shape),
        slope=columns * rng.normal(size=(*shape, STATE + SHARED)),
        share=np.full((W, N + 1), 0.5),
        moved=np.zeros((W, N, STATE)),
        carried=np.zeros((W, N, STATE, STATE + SHARED)),
    )


def prior_of(rng):
    return np.stack([rng.normal(size=(W, STATE)), rng.random((W, STATE))])


def test_the_step_is_that_of_all_unknowns_together():
    rng = default_rng(0)
    prediction, prior = prediction_of(rng), prior_of(rng)
    weight = rng.random(prediction.error.shape)
    normal = eliminate_states(prediction, weight, SIGMA, prior)
    step = np.linalg.solve(normal.H.sum(0), normal.g.sum(0))
    size = W * STATE
    rows, right = [], []
    for w in range(W):
        root = np.sqrt(weight[w] * prediction.share[w][:, None]) / SIGMA
        A = np.zeros((N + 1, JOINTS, size + SHARED))
        A[..., w * STATE : (w + 1) * STATE] = prediction.slope[w, ..., :STATE]
        A[..., size:] = prediction.slope[w, ..., STATE:]
        rows.append((A * root[..., None]).reshape(-1, size + SHARED))
        right.append((prediction.error[w] * root).ravel())
        known = np.zeros((STATE, size + SHARED))
        known[:, w * STATE : (w + 1) * STATE] = np.diag(np.sqrt(prior[1, w]))
        rows.append(known)
        right.append(np.sqrt(prior[1, w]) * prior[0, w])
    everything = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]
    assert_allclose(step, everything[size:], rtol=1e-9)
    states = normal.start - normal.to_start @ step
    assert_allclose(states.ravel(), everything[:size], rtol=1e-9)


def test_steep_windows_keep_a_curvature_that_is_not_negative():
    rng = default_rng(1)
    normal = eliminate_states(
        prediction_of(rng, 1e9), np.ones((W, N + 1, JOINTS)), SIGMA, prior_of(rng)
    )
    least = np.linalg.eigvalsh(normal.H).min(axis=1)
    assert (least >= -1e-12 * np.abs(normal.H).max(axis=(1, 2))).all()
    assert (np.einsum("wii->wi", normal.H) >= 0).all()


@pytest.mark.parametrize("wrong", [1e5, np.inf, np.nan])
def test_a_window_that_explodes_is_held_and_the_others_stay_as_they_are(wrong):
    rng, K = default_rng(2), 2 * N
    before, after = rng.normal(size=(2, K, JOINTS))
    weight = {name: np.ones((K, JOINTS)) for name in ("weight_before", "weight_after")}
    scales = SimpleNamespace(size=np.ones(JOINTS))
    dataset = SimpleNamespace(scales=scales)
    intervals = SimpleNamespace(n=JOINTS, dataset=dataset, before=before, after=after, **weight)
    nodes = rng.normal(size=(K, STATE))
    lines = Linearisation(
        end=rng.normal(size=(K, STATE)),
        by_start=np.eye(STATE) + 0.1 * rng.normal(size=(K, STATE, STATE)),
        by=rng.normal(size=(K, STATE, SHARED)),
        angle=np.zeros((SHARED, JOINTS)),
    )
    windows = np.arange(K).reshape(2, N)
    sound = predict_windows(intervals, lines, nodes, windows, 0.0)
    lines.by_start[N + 1] = wrong
    held = predict_windows(intervals, lines, nodes, windows, 0.0)
    for whole, right in zip(held, sound, strict=True):
        assert_array_equal(whole[0], right[0])
        assert np.isfinite(whole).all()
    assert not held.slope[1].any() and not held.moved[1].any()
    assert (np.abs(held.error[1]) > 100.0).all()


def test_a_window_counts_as_its_cost_grows():
    """Fully while it is explained, not at all when it is lost, and without a jump."""
    rng = default_rng(5)
    off = np.linspace(0.0, 12.0, 400)
    one = prediction_of(rng)
    alike = WindowPrediction(*(np.repeat(x[:1], len(off), axis=0) for x in one))
    alike = alike._replace(error=off[:, None, None] * np.ones_like(alike.error) * SIGMA)
    none = np.zeros(len(off))
    point = Point(None, none, none, alike, none, none, none, none > 0, none > 0, none)
    counts = counts_of(point, SIGMA, 2.5)
    assert counts[0] == 1.0 and counts[-1] == 0.0
    assert (np.diff(counts) <= 0.0).all() and np.abs(np.diff(counts)).max() < 0.05
    # derivatives of all costs by the logarithm of how far windows are off: those of plain ones
    # (without an end to the growth of their costs) times what they count
    step = 1e-5

    def cost(grown):
        each = alike._replace(error=alike.error * grown)
        return np.array(
            [cost_of(picked(each, [k]), none[:1] > 0, SIGMA, 2.5) for k in range(len(off))]
        )

    def plain(grown):
        e = np.abs(alike.error * grown) / SIGMA
        rho = np.where(e <= 2.5, e**2, 5.0 * e - 2.5**2) * alike.share[..., None]
        return rho.sum(axis=(1, 2))

    slope, full = ((f(1 + step) - f(1 - step)) / (2 * step) for f in (cost, plain))
    assert_allclose(slope, counts * full, atol=1e-4 * full.max())


def test_a_window_is_left_out_where_its_gap_stays_open_and_not_while_it_closes():
    """Of eight windows one stays open, another one halves its gap and more with each step."""
    shape, none = (8, N + 1, JOINTS), np.zeros(8)
    alike = WindowPrediction(
        error=np.zeros(shape),
        slope=np.zeros((*shape, STATE + SHARED)),
        share=np.ones(shape[:2]),
        moved=np.zeros((8, N, STATE)),
        carried=np.zeros((8, N, STATE, STATE + SHARED)),
    )
    point = Point(
        None,
        np.zeros((8 * N, STATE)),
        np.arange(8 * N).reshape(8, N),
        alike,
        np.zeros((2, 8, STATE)),
        none,
        none,
        none > 0,
        none > 0,
        none,
    )
    gaps = [np.array([9.0, 40.0 * 0.4**k, *(0.01,) * 6]) for k in range(4)]
    last = point._replace(gap=gaps[0])
    damping = []
    for gap in gaps[1:]:
        last = with_windows_checked(
            point._replace(gap=gap), last, np.zeros(SHARED), SIGMA, 2.5, False
        )
        damping.append(last.damping[0])
    assert_allclose(damping, [0.1, 1.0, 10.0])  # its steps become ten times as small
    assert last.gap[1] > 1.0
    assert_array_equal(last.kinked, [True] + 7 * [False])
    assert_array_equal(last.failures, [3.0] + 7 * [0.0])


@pytest.mark.parametrize("seconds", [1e-6, 0.1, 0.5, 100.0])
def test_windows_have_three_intervals_at_least_and_hold_each_interval_once(seconds):
    intervals = intervals_of(tiny.dataset(recordings=tiny.recordings()[:2]))
    windows = cut_windows(intervals, np.ones(len(intervals.dt), dtype=bool), seconds)
    assert (windows >= 0).sum(axis=1).min() >= 3
    assert_array_equal(np.sort(windows[windows >= 0]), np.arange(len(intervals.dt)))


def test_each_angle_of_a_window_counts_by_its_own_noise():
    """The last one, too: it is that behind the window's last interval."""
    rng = default_rng(3)
    some = tiny.dataset(recordings=tiny.recordings()[:2])
    plain = intervals_of(some)
    K, n = plain.q.shape
    before, after = rng.uniform(0.1, 1.0, (2, K, n))
    nodes = np.concatenate([plain.q, plain.w], axis=1)
    linear = Linearisation(
        rng.normal(size=(K, 2 * n)),
        rng.normal(size=(K, 2 * n, 2 * n)),
        np.zeros((K, 2 * n, 0)),
        np.zeros((0, n)),
    )
    windows = cut_windows(plain, np.ones(K, dtype=bool), 0.1)
    own = replace(plain, weight_before=before, weight_after=after)
    one = replace(plain, weight_before=np.ones((K, n)), weight_after=np.ones((K, n)))
    weighted, alike = (
        predict_windows(i, linear, nodes, windows, np.zeros(n)).error for i in (own, one)
    )
    for w, window in enumerate(windows):
        inside = window[window >= 0]
        expected = np.concatenate([before[inside], after[inside[-1:]]])
        found = weighted[w, : len(inside) + 1] / alike[w, : len(inside) + 1]
        assert_allclose(found, expected, rtol=1e-9)


def test_of_exact_angles_the_noise_starts_above_zero_and_below_any_other():
    """Residuals are divided by it; also those of a joint that stays at zero."""
    q = np.array([[1.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    use = np.ones(3, dtype=bool)
    exact, rough = (
        _initial_noise(
            SimpleNamespace(intervals=SimpleNamespace(before=q + off, q=q, rounding=0.0)), use
        )
        for off in (0.0, 1e-4)
    )
    assert (exact > 0).all() and (exact < 1e-5).all()
    assert_allclose(rough, 1.4826e-4, rtol=1e-3)


# --- Steps ----------------------------------------------------------------------------------------

START = Friction(CoulombViscous(), [[0.02, 0.002]])


def test_every_iteration_is_heard_once():
    heard, settings = [], Settings(iterations=6)
    with listening(lambda *said: heard.append(said)):
        result = refine(START, dataset(), (FrictionBlock(),), settings)
    assert len(heard) == result.diagnostics.iterations
    begins = [k for k, (_, left) in enumerate(heard) if k == 0 or left >= heard[k - 1][1]]
    assert len(begins) == len(settings.windows) + 1  # the last length twice, coarse and fine
    for first, end in zip(begins, [*begins[1:], len(heard)], strict=True):
        left = [left for _, left in heard[first:end]]
        assert left == list(range(left[0], left[0] - len(left), -1)) and left[-1] >= 0
    unheard = refine(START, dataset(), (FrictionBlock(),), settings)
    assert_array_equal(unheard.friction.theta, result.friction.theta)


def refined(settings=None):
    return refine(START, dataset(), (FrictionBlock(),), settings)


def assert_ends_at(fit, other):
    off = np.abs(fit.covariance.values - other.covariance.values) / other.covariance.error
    assert fit.diagnostics.settled and off.max() < 0.1


def steep_at(calls, monkeypatch):
    """Let the physics step refuse some of the linearisations, by their numbers."""
    count, linearised_at = [0], gauss_newton.linearised_at

    def refusing(*arguments):
        count[0] += 1
        if count[0] in calls:
            raise NoFitError("too steep")
        return linearised_at(*arguments)

    monkeypatch.setattr(gauss_newton, "linearised_at", refusing)


def test_steps_into_friction_too_steep_are_taken_back_and_the_fit_ends_where_it_would(monkeypatch):
    free = refined()
    steep_at({2, 3}, monkeypatch)
    damped = refined()
    assert free.diagnostics.settled
    assert_ends_at(damped, free)


def test_steps_that_tear_closed_gaps_open_are_taken_back(monkeypatch):
    """The cost is that of the linearisation, and shows no change."""
    next_step, linearised_at = gauss_newton._next_step, gauss_newton.linearised_at
    begun, torn = [], []

    def heard(problem, point, sigma, damping, share):
        begun.append((problem, point, damping))
        return next_step(problem, point, sigma, damping, share)

    def torn_open(problem, windows, *others):
        point = linearised_at(problem, windows, *others)
        same = begun and problem is begun[-1][0] and windows is begun[-1][1].windows  # stage
        if same and not torn and np.median(begun[-1][1].gap) < 0.1:
            torn.append(len(begun))
            point = point._replace(gap=100.0 + point.gap)
        return point

    monkeypatch.setattr(gauss_newton, "_next_step", heard)
    monkeypatch.setattr(gauss_newton, "linearised_at", torn_open)
    assert refined().diagnostics.settled
    (_, before, _), (_, after, damping) = begun[torn[0] - 1 : torn[0] + 1]
    assert after is before and damping >= 1e-3


def test_a_start_too_steep_and_steps_that_no_damping_helps_are_refused(monkeypatch):
    for calls in ({1, 2}, set(range(2, 40))):  # the start with windows of both lengths
        with monkeypatch.context() as patch, pytest.raises(NoFitError, match="steep"):
            steep_at(calls, patch)
            refined()


@pytest.mark.parametrize("iterations", [2, 30])
def test_a_fit_that_comes_to_friction_too_steep_ends_before_it_and_says_so(iterations, monkeypatch):
    """The physics step follows 95 % of the viscous friction."""
    free, inertia = refined(), tiny.INERTIA
    fastest = 0.95 * free.friction.theta[0, 1] / inertia
    monkeypatch.setattr(step_size, "_FASTEST", fastest)
    near = refined(Settings(iterations=iterations))
    assert 0.8 * fastest < near.friction.theta[0, 1] / inertia <= fastest
    assert not near.diagnostics.settled
    assert any("cannot be computed" in w for w in near.diagnostics.warnings)


def test_where_a_further_fit_fails_the_one_that_there_was_comes_out(monkeypatch):
    free, solve = refined(), stages.solve

    def failing(problem, estimate, use, ended=None):
        if ended is not None:
            raise NoFitError("astray")
        return solve(problem, estimate, use)

    monkeypatch.setattr(stages, "solve", failing)
    found = refine(START, dataset(), (FrictionBlock(), DelayBlock()))  # a rough fit comes first
    off = found.friction.theta[0] - free.friction.theta[0]
    assert (np.abs(off) < free.covariance.error).all()
    assert "A further fit failed, this one stays: astray" in found.diagnostics.warnings


@pytest.mark.parametrize(("explained", "at_once"), [(True, True), (False, True), (False, False)])
def test_base_parameters_that_run_off_are_held_at_once_or_in_the_end_where_nothing_is_explained(
    explained, at_once, monkeypatch
):
    """Along a tie, as of a weight and a bias, base parameters go far and explain the motion."""

    def free(of):
        return "inertia" in {p.block for p in of.parameters}

    monkeypatch.setattr(beginning, "base_runs_off", lambda solution: free(solution.problem))
    monkeypatch.setattr(beginning, "is_astray", lambda solution: at_once and free(solution.problem))
    monkeypatch.setattr(beginning, "explained", lambda _: explained)
    blocks = FrictionBlock(), InertiaBlock(offered=True)
    result = refine(START, dataset(), blocks, Settings(iterations=2))
    words = shooting_words(result.estimates(dataset(), np.ones((1, 1))))[1]
    assert free(result.covariance) is explained
    assert ("base parameters, as predictions went astray" in words) is not explained


def test_where_no_window_is_predicted_longer_ones_are_taken_unless_their_length_was_given(
    monkeypatch,
):
    longer = Settings(windows=(0.25, 0.5, 1.0))
    free, solve = refined(longer), stages.solve

    def astray(problem, *others):
        if problem.settings.windows[-1] < 0.9:
            raise NoFitError("astray")
        return solve(problem, *others)

    monkeypatch.setattr(stages, "solve", astray)
    found = refined()
    assert_ends_at(found, free)
    with pytest.raises(NoFitError, match="astray"):
        refined(Settings(windows=(0.1, 0.2)))


def test_an_encoder_that_rests_most_of_the_time_does_not_make_its_steps_the_noise():
    """At rest nothing is left over, and the usual residual is none: rounding stays."""
    machine = {"kind": "pendulum", "driven": False, "parameters": PENDULUM["parameters"]}
    runs = tuple(Run(f"{k}", (0.4 + 0.1 * k,)) for k in range(3))
    camera = Camera(1000, 100.0, 0.0, resolution=2e-3)  # at rest after 0.9 s
    rig = Rig("p", machine, plain_friction(0.05, 0.004), camera, runs, substeps=2)
    fit = refine(START, simulate(rig), (FrictionBlock(),))
    assert (fit.covariance.error < [0.001, 0.0005]).all()
    assert (np.abs(fit.friction.theta[0] - [0.05, 0.004]) < [0.0005, 0.0002]).all()
