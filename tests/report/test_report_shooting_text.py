"""What shooting found, in sentences: what they say, and when they are silent."""

from __future__ import annotations

import re

import numpy as np
import pytest
from fixtures import result_folders as made
from scipy.stats import norm
from scipy.stats import t as student

from frictionid.report.shooting_numbers import estimates
from frictionid.report.shooting_text import coverage, doubts, findings, late


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (made.parameter("delay", "torque delay", 0.018, 1e-4), "acts 18.0 ms (17.8 to 18.2) later"),
        (made.parameter("delay", "torque delay", -0.01, 1e-3), "acts 10 ms (8 to 12) earlier"),
        (
            made.parameter("delay", "torque delay", 1e-4, 1e-3, identified=True),
            "No delay of the torque shows: 0 ms (−2 to 2)",
        ),
        (made.parameter("gain", "torque gain", 1.05, 0.01, joint=0), "logged torque is too small"),
        (made.parameter("gain", "torque gain", 0.9, 0.01, joint=0), "logged torque is too large"),
        (made.parameter("gain", "torque gain", 1.01, 0.01, joint=0), "has the right size"),
        (
            made.parameter("bias", "torque bias", -0.2, 0.01, joint=1),
            "bias of joint 2 is −0.20 N m",
        ),
        (
            made.parameter("offset", "angle offset", 0.02, 1e-3, joint=0),
            "angle lies above the true",
        ),
        (made.parameter("offset", "angle offset", -0.02, 1e-3, joint=0), "lies below the true one"),
        (
            made.parameter("inertia", "gravity", 1.2, 0.01, told=1.0),
            "differs from what is told: gravity by +20 % (+18 to +22)",
        ),
        (made.parameter("inertia", "gravity", 1.2, 0.2, told=1.0), "told value lies in the 95 %"),
        (made.parameter("actuator", "kt", 0.5, 0.01, told=0.4), "kt is 0.50 N m (0.48 to 0.52)"),
    ],
)
def test_a_finding_in_words(entry, words):
    (sentence,) = findings(estimates(made.shot([entry])))
    assert words in sentence


@pytest.mark.parametrize("block", ["delay", "gain", "bias", "offset", "inertia", "actuator"])
def test_nothing_is_said_of_what_is_not_identified(block):
    entry = made.parameter(block, "x", 0.1, 1.0, told=1.0)
    refined = made.shot([entry])
    assert not list(findings(estimates(refined)))
    assert "Not identified" in " ".join(doubts(refined, estimates(refined)))


@pytest.mark.parametrize("seed", range(20))
def test_a_delay_explains_viscous_friction_where_its_interval_holds_one_that_does(seed):
    """By another route: the delay at which the expected viscous friction vanishes."""
    rng = np.random.default_rng(seed)
    value, errors, r = rng.uniform(0.5, 3.0), rng.uniform(0.3, 1.5, 2), rng.uniform(-0.99, 0.99)
    pair = [
        made.parameter("friction", "viscous", value, errors[0], joint=0),
        made.parameter("delay", "torque delay", 0.01, 1e-3 * errors[1]),
    ]
    refined = made.shot(pair, correlation=[[1.0, r], [r, 1.0]])
    # E[viscous | delay] = value + slope (delay - its estimate)
    slope = r * errors[0] / (1e-3 * errors[1])
    reach = student.ppf(0.975, refined["freedom"]) * 1e-3 * errors[1]
    told = list(late(refined, estimates(refined)))
    assert bool(told) == (abs(value / slope) <= reach)


def test_a_delay_that_was_not_free_is_told_where_a_motor_pulls():
    viscous = made.parameter("friction", "viscous", 0.1, 0.001, joint=0)
    for driven in (True, False):
        refined = made.shot([viscous], driven=driven)
        assert bool(list(late(refined, estimates(refined)))) is driven
    coulomb = made.shot([made.parameter("friction", "coulomb", 0.1, 0.001)], driven=True)
    assert not list(late(coulomb, estimates(coulomb)))


def test_true_values_outside_are_named():
    about = {"joints": ["joint 1"], "true_parameters": {"inertia": {"a": 1.0, "b": 2.0}}}
    pair = [made.parameter("inertia", name, 1.0, 0.1) for name in "ab"]
    words = coverage(estimates(made.shot(pair), about))
    assert "1 of the 2 true values" in words and words.endswith("not those of b.")


def test_the_interval_shown_covers_what_it_says():
    """The rounding of intervals loses little of what they cover."""
    rng = np.random.default_rng(0)
    error = 10 ** rng.uniform(-5, 1, 300)
    value = error * rng.uniform(3, 1000, 300)
    covered = []
    for v, e in zip(value, error, strict=True):
        entry = made.parameter("delay", "torque delay", 1e-3 * v, 1e-3 * e)
        (sentence,) = findings(estimates(made.shot([entry])))
        low, high = map(float, re.search(r"\(([\d.]+) to ([\d.]+)\)", sentence).groups())
        covered.append(norm.cdf((high - v) / e) - norm.cdf((low - v) / e))
    assert np.mean(covered) > 0.93 and min(covered) > 0.85
