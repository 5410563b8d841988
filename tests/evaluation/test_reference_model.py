"""The rule of the verdict: losses of models whose distance is known, and what it recommends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frictionid.evaluation.reference_model import (
    StartErrors,
    choose,
    loss,
    preferring,
    unsupported,
)
from frictionid.evaluation.statistics import (
    nested_complexity,
    nested_names,
    shown_names,
    zero_names,
)
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.friction.provenance import Estimate, Estimates

GROUP = np.repeat(np.arange(20), 50)
NOISE = 0.05 * np.random.default_rng(1).standard_normal((1000, 2))


def apart(distance, seed=2):
    """Errors of a model whose predictions differ from the reference's by so much, either way."""
    rng = np.random.default_rng(seed)
    return StartErrors(NOISE + distance * rng.standard_normal((1000, 2)), GROUP)


def scattered(share):
    """Errors of a law, and of a simpler one that one recording of five shows to be farther off."""
    group = GROUP % 5
    shown = np.where(group == 0, share, 0.0)[:, None]
    return [StartErrors(NOISE + far * (apart(1.0).error - NOISE), group) for far in (0.0, shown)]


BEST = StartErrors(NOISE, GROUP)
RICH_FIRST = np.array([8.0, 4.0])
LEVELS, PEAK = frozenset({"coulomb"}), frozenset({"coulomb", "peak"})
NO_ZEROS = [frozenset[str]()] * 2


@pytest.mark.parametrize("distance", [0.0, 0.01, 0.02, 0.05, 0.1])
def test_of_normal_errors_the_loss_is_that_of_their_squares(distance):
    """sqrt(1 + d^2/e^2), of errors and distances that are independent."""
    losses = loss(apart(distance), BEST)
    true = 0.5 * np.log1p((distance / 0.05) ** 2)
    assert np.log(losses.implied.value) == pytest.approx(true, abs=0.02)
    assert losses.measured.low / 1.1 < np.exp(true) < losses.measured.high * 1.1
    assert not losses.contradicted


def test_the_implied_loss_scatters_less_than_the_measured_one():
    pairs = [loss(apart(0.02, seed), BEST) for seed in range(50)]
    implied, measured = (
        np.std([getattr(p, k).value for p in pairs]) for k in ("implied", "measured")
    )
    assert implied < 0.5 * measured


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_models_that_are_wrong_in_different_ways_are_judged_by_their_errors(share):
    """Both predict otherwise, and as badly: the measured errors contradict what that implies."""
    turned = StartErrors(share * NOISE[:, ::-1] * [1.0, -1.0] + (1.0 - share) * NOISE, GROUP)
    twin = StartErrors(turned.error / turned.size.mean() * BEST.size.mean(), GROUP)
    losses = loss(twin, BEST)
    assert losses.contradicted and losses.factor is losses.measured
    assert losses.factor.standing == "adequate"


@given(st.floats(0.1, 10.0), st.integers(0, 5))
def test_the_unit_of_errors_does_not_matter(unit, seed):
    model, reference = (
        StartErrors(1e-3 * unit * e.error, GROUP) for e in (apart(0.02, seed), BEST)
    )
    assert loss(model, reference).implied == pytest.approx(
        loss(apart(0.02, seed), BEST).implied, abs=1e-6
    )


@pytest.mark.parametrize("share", [1e-3, 1.0, 1e3])
def test_recordings_at_rest_that_all_models_predict_decide_nothing(share):
    """There errors are of rounding, and the ratio of two of them is of nothing."""
    rest = GROUP < 5
    model, reference = apart(0.05, 1).error, BEST.error
    still = StartErrors(np.where(rest[:, None], 1e-8 * share * model, model), GROUP)
    best = StartErrors(np.where(rest[:, None], 1e-8 * reference, reference), GROUP)
    moving = StartErrors(model[~rest], GROUP[~rest]), StartErrors(reference[~rest], GROUP[~rest])
    for name in ("implied", "measured"):
        factors = [getattr(loss(*pair), name).value for pair in ((still, best), moving)]
        assert factors[0] == pytest.approx(factors[1], rel=0.02)


def test_one_far_recording_is_bounded():
    """What is farther than 1 is as far as 1, and counts once."""
    far = NOISE.copy()
    far[0] = 1e6
    assert StartErrors(far, GROUP).size.max() == 1.0
    far[0] = np.nan
    assert StartErrors(far, GROUP).size[0] == 1.0 and not StartErrors(far, GROUP).diverged


@pytest.mark.parametrize("distance", [0.01, 0.02, 0.025, 0.03, 0.05])
def test_the_interval_of_a_factor_says_what_is_shown(distance):
    """Its lower end is at 1.1 where 90 % of the chance lies above."""
    for between in loss(apart(distance), BEST)[:2]:
        assert between.low < between.value < between.high
        assert (between.low > 1.1) == (between.worse >= 0.9)
        assert (between.high < 1.1) == (between.worse <= 0.1)
        assert between.turned.turned == pytest.approx(between)


@pytest.mark.parametrize(
    ("simple", "standing", "recommended"),
    [
        (apart(0.005), "adequate", 1),
        (apart(0.1), "worse", 0),
        (StartErrors(0.5 * NOISE, GROUP), "best", 1),
        (StartErrors(np.where(GROUP[:, None] == 3, np.nan, NOISE), GROUP), "diverged", 0),
    ],
)
def test_the_simplest_model_that_is_not_practically_worse_is_recommended(
    simple, standing, recommended
):
    choice = choose([BEST, simple], RICH_FIRST)
    assert choice.standings[1] == standing
    assert choice.recommended == recommended


def test_what_scatters_between_recordings_is_undecided():
    """Of five recordings one shows what the others do not."""
    choice = choose(scattered(0.06), RICH_FIRST)
    assert choice.standings[1] == "undecided"
    assert (choice.recommended, choice.simplest, choice.adequate) == (None, 1, 0)


def test_an_unfit_model_is_recommended_only_where_no_other_is_left():
    errors = [BEST, apart(0.005)]
    assert choose(errors, RICH_FIRST, np.array([False, True])).recommended == 0
    assert choose(errors, RICH_FIRST, np.array([True, True])).recommended == 1


def test_too_few_recordings_and_models_that_diverge_give_no_choice():
    few = StartErrors(NOISE, GROUP % 2)
    lost = StartErrors(np.full_like(NOISE, np.nan), GROUP)
    assert choose([few], np.ones(1)).best is None
    assert choose([lost], np.ones(1)).best is None
    with pytest.raises(ValueError, match="at least 2 recordings"):
        loss(StartErrors(NOISE, 0 * GROUP), StartErrors(NOISE, 0 * GROUP))


@pytest.mark.parametrize(("share", "preferred"), [(0.03, 1), (0.05, 1), (0.07, 0)])
def test_a_near_law_with_an_identified_parameter_is_preferred_to_a_simpler_one(share, preferred):
    """Where it is undecided, and less than a tenth farther off."""
    choice = choose(scattered(share), np.array([1.0, 2.0]))
    assert choice.standings[1] == "undecided" and choice.recommended == 0
    assert preferring(choice, [LEVELS, PEAK], [LEVELS, PEAK], NO_ZEROS).recommended == preferred
    assert preferring(choice, [LEVELS, PEAK], [LEVELS, LEVELS], NO_ZEROS).recommended == 0
    assert preferring(choice, [PEAK, LEVELS], [PEAK, LEVELS], NO_ZEROS).recommended == 0


def test_a_near_law_is_not_preferred_for_what_an_adequate_one_has_as_well():
    """Its peak, which the data identify, is no reason for its spring, which they do not."""
    spring = PEAK | {"stiffness", "preload"}
    best, undecided = scattered(0.03)
    choice = choose([best, undecided, apart(0.005)], np.array([1.0, 3.0, 2.0]))
    assert choice.standings == ("best", "undecided", "adequate")
    settled = preferring(choice, [LEVELS, spring, PEAK], [LEVELS, PEAK, PEAK], [frozenset()] * 3)
    assert settled.recommended == 0


@pytest.mark.parametrize(
    ("share", "peak_is_identified", "recommended"),
    [(0.08, True, 0), (0.08, False, None), (0.035, False, None), (0.035, True, None)],
)
def test_errors_and_intervals_that_agree_decide_what_errors_cannot(
    share, peak_is_identified, recommended
):
    """More than a tenth farther off without a parameter that is identified."""
    choice = choose(scattered(share), RICH_FIRST)
    assert choice.standings[1] == "undecided" and choice.recommended is None
    settled = preferring(
        choice, [PEAK, LEVELS], [PEAK if peak_is_identified else LEVELS, LEVELS], NO_ZEROS
    )
    assert settled.recommended == recommended
    assert settled.lacking == ((1,) if recommended == 0 else ())
    loss = LEVELS | {"loss"}  # of which the data identify the levels
    assert preferring(choice, [PEAK, loss], [PEAK, LEVELS], NO_ZEROS).recommended == (
        0 if share > 0.05 else None
    )
    disjoint = frozenset({"knots"})
    assert preferring(choice, [disjoint, LEVELS], [disjoint, LEVELS], NO_ZEROS) == choice


def test_a_law_that_errors_show_to_be_adequate_stays_so_beside_an_identified_parameter():
    choice = choose([BEST, apart(0.005)], RICH_FIRST)
    assert preferring(choice, [PEAK, LEVELS], [PEAK, LEVELS], NO_ZEROS) == choice


def test_a_law_that_adds_nothing_that_data_identify_is_no_reference():
    """Unless the simpler one is practically farther off as measured."""
    near, far = [BEST, apart(0.02)], [BEST, apart(0.06)]
    assert unsupported(near, [PEAK, LEVELS], [LEVELS, LEVELS]).tolist() == [True, False]
    assert not unsupported(far, [PEAK, LEVELS], [LEVELS, LEVELS]).any()
    assert not unsupported(near, [PEAK, LEVELS], [PEAK, LEVELS]).any()
    assert not unsupported(near, [PEAK, LEVELS], [None, LEVELS]).any()  # without intervals
    assert unsupported(near, [PEAK, LEVELS], [frozenset(), frozenset()]).tolist() == [True, False]
    assert not unsupported(near, [PEAK, frozenset({"knots"})], [LEVELS, LEVELS]).any()


@pytest.mark.parametrize(("peak", "recommended"), [(0.0, 1), (0.3, 0)])
def test_a_law_with_further_parameters_of_zero_is_the_simpler_law(peak, recommended):
    """Even where folds, whose fits differ, count that one as worse; else its peak is kept."""
    choice = choose([BEST, apart(0.06)], RICH_FIRST)
    assert choice.standings[1] == "worse" and choice.recommended == 0
    values = {"coulomb": (1.0, "N m"), "peak": (peak, "N m"), "stribeck_velocity": (1.0, "rad/s")}
    joint = {name: {"value": value, "unit": unit} for name, (value, unit) in values.items()}
    none = joint | {"peak": {"value": 0.0, "unit": "N m"}}
    zero = [zero_names({"joints": [none, joint]}), zero_names({})]
    names = [PEAK | {"stribeck_velocity"}, LEVELS]
    settled = preferring(choice, names, [LEVELS, LEVELS], zero)
    assert settled.recommended == recommended
    assert settled.degenerate == (0 if recommended else None)
    lost = choose([BEST, StartErrors(np.full_like(NOISE, np.nan), GROUP)], RICH_FIRST)
    settled = preferring(lost, names, [LEVELS, LEVELS], zero)
    assert settled.recommended == 0


def levels(forward, backward, error, correlation=0.0, at_bound=False):
    """Estimates of the two Coulomb levels of a joint."""
    pair = [
        Estimate("friction", f"coulomb_{side} of hip", "N m", 0, value, error, at_bound=at_bound)
        for side, value in (("positive", forward), ("negative", backward))
    ]
    covariance = error**2 * np.array([[1.0, correlation], [correlation, 1.0]])
    return Estimates(parameters=tuple(pair), covariance=covariance, freedom=20)


def test_friction_differs_by_direction_where_the_difference_is_shown():
    """Not where both levels are: each may well be known better than their difference."""
    different = LEVELS | {"coulomb by direction"}
    assert shown_names(levels(1.0, 1.1, 0.1)) == LEVELS
    assert shown_names(levels(1.0, 1.5, 0.1)) == different
    assert shown_names(levels(1.0, 1.2, 0.1, 0.9)) == different
    assert shown_names(levels(1.0, 1.5, 0.1, -0.9)) == LEVELS
    assert shown_names(levels(1.0, 0.1, 0.1)) == different
    assert shown_names(levels(0.1, 0.1, 0.1)) == shown_names(levels(9.0, 1.0, 0.1, at_bound=True))


def test_a_law_by_direction_is_never_the_simpler_one():
    laws = [
        CoulombViscous(),
        CoulombViscous(symmetric=False),
        Stribeck(),
        Stribeck(symmetric=False),
    ]
    counts = nested_complexity([4.0, 3.0, 4.0, 3.0], [nested_names(law.names) for law in laws])
    assert counts[0] < counts[1] < counts[3] and counts[0] < counts[2] < counts[3]
