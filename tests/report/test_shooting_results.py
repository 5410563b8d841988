"""Results of shooting as facts and words: what they say, and when they are silent."""

import numpy as np
import pytest
from fixtures import result_folders as made
from fixtures.mistakes import changes, rows
from scipy.stats import norm
from scipy.stats import t as student

from frictionid.fitting.parameter_block import IDEAL
from frictionid.report.shooting_results import (
    delay_explains,
    delay_fixed,
    shooting_results,
    shooting_words,
)
from frictionid.report.terminal import parameter_table


def results(refined, **data):
    """Facts of a document; `data` changes what is known of the data set."""
    known = made.description(1, **data) if data else None
    return shooting_results(made.estimates(refined), known)


def said(refined):
    """All that is said of a document."""
    return shooting_words(made.estimates(refined))[1]


FINDINGS = """
block = "delay"; name = "torque delay"; value = 0.018; error = 1e-4
    => Torque delay: 18.0 ms (17.8 to 18.2); the torque acts later
block = "delay"; name = "torque delay"; value = -0.01; error = 1e-3
    => Torque delay: −10 ms (−12 to −8); the torque acts earlier
block = "delay"; name = "torque delay"; value = 1e-4; error = 1e-3; identified = true
    => Torque delay: 0 ms (−2 to 2); no delay shows
block = "gain"; name = "torque gain"; value = 1.05; error = 0.01; joint = 0
    => logged torque is too small
block = "gain"; name = "torque gain"; value = 0.9; error = 0.01; joint = 0
    => logged torque is too large
block = "gain"; name = "torque gain"; value = 1.01; error = 0.01; joint = 0
    => has the right size
block = "bias"; name = "torque bias"; value = -0.2; error = 0.01; joint = 1
    => bias of joint 2: −0.20 N m
block = "target_delay"; name = "target delay"; value = 0.01; error = 1e-4; unit = "s"
    => Target delay: 10.0 ms (9.8 to 10.2); targets act later than logged
block = "target_delay"; name = "target delay"; value = 1e-4; error = 1e-3; identified = true
    => Target delay: 0 ms (−2 to 2); no delay shows
block = "backlash"; name = "backlash"; value = 0.009; error = 1e-4; unit = "rad"; joint = 0
    => Backlash of joint 1: 0.0090 rad (0.0088 to 0.0092); the encoder that the controller
block = "offset"; name = "angle offset"; value = 0.02; error = 1e-3; joint = 0
    => angle lies above the true
block = "offset"; name = "angle offset"; value = -0.02; error = 1e-3; joint = 0
    => lies below the true one
block = "inertia"; name = "gravity"; value = 1.2; error = 0.01; nominal = 1.0
    => 1 of 1 with a nominal value differ: gravity by +20 % (+18 to +22)
block = "inertia"; name = "gravity"; value = 1.2; error = 0.2; nominal = 1.0
    => 0 of 1 with a nominal value differ (95 % intervals)
block = "inertia"; name = "Ixy"; value = 1.2; error = 0.1; nominal = -1e-4; unit = "kg m^2"
    => 1 of 1 with a nominal value differ: Ixy by +1.2 kg m^2 (+1.0 to +1.4)
block = "actuator"; name = "kt"; value = 0.5; error = 0.01; nominal = 0.4
    => Kt: 0.50 N m (0.48 to 0.52); nominal 0.4, difference +25 % (+20 to +30)
"""


@pytest.mark.parametrize("entry, words", rows(FINDINGS))
def test_a_finding_in_words(entry, words):
    (sentence,) = said(made.shot([made.parameter(**changes(entry))])).strip().splitlines()
    assert words in sentence


@pytest.mark.parametrize("block", ["delay", "gain", "bias", "offset", "inertia", "actuator"])
def test_nothing_is_said_of_what_is_not_identified(block):
    document = made.shot([made.parameter(block, "x", 0.1, 1.0, nominal=1.0)])
    found = results(document)
    assert not found["calibration"] and not found["differing"] and not found["nominal"]
    assert [estimate.name for estimate in found["not_identified"]] == ["x"]
    assert "Not identified" in said(document)


@pytest.mark.parametrize("seed", range(20))
def test_a_delay_explains_viscous_friction_where_its_interval_holds_one_that_does(seed):
    """By another route: the delay at which the expected viscous friction vanishes."""
    rng = np.random.default_rng(seed)
    value, errors, r = rng.uniform(0.5, 3.0), rng.uniform(0.3, 1.5, 2), rng.uniform(-0.99, 0.99)
    pair = [
        made.parameter("friction", "viscous", value, errors[0], joint=0),
        made.parameter(("delay", "target_delay")[seed % 2], "delay", 0.01, 1e-3 * errors[1]),
    ]
    refined = made.shot(pair, correlation=[[1.0, r], [r, 1.0]])
    # E[viscous | delay] = value + slope (delay - its estimate)
    slope = r * errors[0] / (1e-3 * errors[1])
    half_width = student.ppf(0.975, refined["freedom"]) * 1e-3 * errors[1]
    explained = delay_explains(made.estimates(refined))
    assert bool(explained) == (abs(value / slope) <= half_width)


def test_a_delay_that_was_not_free_is_named_where_a_motor_pulls():
    viscous = made.parameter("friction", "viscous", 0.1, 0.001, joint=0)
    for driven in (True, False):
        refined = made.shot([viscous], driven=driven)
        assert bool(delay_fixed(made.estimates(refined))) is driven
    late = made.parameter("target_delay", "target delay", 0.01, 1e-4, unit="s")
    of_targets = made.shot([viscous, late], driven=True)
    assert not delay_fixed(made.estimates(of_targets))
    coulomb = made.shot([made.parameter("friction", "coulomb", 0.1, 0.001)], driven=True)
    assert not delay_fixed(made.estimates(coulomb))


@pytest.mark.parametrize("block", IDEAL)
def test_a_block_that_was_left_out_is_named(block):
    refined = made.shot([], dropped=[{"block": block, "p_value": 0.4}])
    assert "Left out of the fit" in said(refined) and "(p = 0.4)" in said(refined)


def test_true_values_outside_are_named():
    pair = [made.parameter("inertia", name, 1.0, 0.1) for name in "ab"]
    found = results(made.shot(pair), true_parameters={"inertia": {"a": 1.0, "b": 2.0}})
    assert found["with_truth"] == 2 and found["missed"] == ("b",)


def test_the_interval_shown_covers_what_it_says():
    """The rounding of intervals loses little of what they cover."""
    rng = np.random.default_rng(0)
    error = 10 ** rng.uniform(-5, 1, 300)
    value = error * rng.uniform(3, 1000, 300)
    covered = []
    for v, e in zip(value, error, strict=True):
        entry = made.parameter("delay", "torque delay", 1e-3 * v, 1e-3 * e)
        (calibration,) = results(made.shot([entry]))["calibration"]
        low, high = map(float, calibration["text"][1:])
        covered.append(norm.cdf((high - v) / e) - norm.cdf((low - v) / e))
    assert np.mean(covered) > 0.93 and min(covered) > 0.85


def test_a_value_that_is_held_has_no_interval_that_seems_to_tell_it_from_zero():
    entry = made.parameter("inertia", "Ixx_link", 0.5, 0.05, identified=False, held=True)
    (held,) = parameter_table(made.estimates(made.shot([entry])).parameters).lines
    assert [cell.text for cell in held.cells][1:3] == ["held at 0.5", "–"]
