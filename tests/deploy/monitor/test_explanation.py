"""Differences of recordings whose scatter is known: the rate, and which cause is named."""

import numpy as np
import pytest
from numpy.random import default_rng

from frictionid.deploy.monitor.changes import Changes
from frictionid.deploy.monitor.effects import Effect
from frictionid.deploy.monitor.explanation import (
    CauseTests,
    cause_tests,
    difference_of,
    explained,
    true_scatter,
)

D = 6
CAUSES = {"a": np.array([0, 1, 2]), "b": np.array([3]), "c": np.array([4, 5])}
SIZE = np.full(D, 1e3)
rng = default_rng(0)
TURN = rng.standard_normal((D, D))
NOISE = TURN @ TURN.T + 0.1 * np.eye(D)  # strongly correlated, as parts of friction are


def recordings(rng, count, off=0.0, noise=1.0, motion=0.0, slope=0.0):
    """Changes that scatter by themselves (0.5) and by the noise of each estimate."""
    w = motion + rng.standard_normal((count, 1, 2))
    root = np.linalg.cholesky(NOISE) * np.sqrt(noise)
    value = 0.5 * rng.standard_normal((count, D)) + rng.standard_normal((count, D)) @ root.T
    inverse = np.repeat(noise * NOISE[None], count, axis=0)
    ones = np.ones((count, D))
    shift = slope * w[:, 0, :1]
    return Changes(value + off + shift, inverse, ones, w, ones[:, :1], np.empty((count, 0)))


def p_of(healthy, new):
    return explained(cause_tests(difference_of(healthy, new, SIZE), CAUSES, {}), 0.01)


@pytest.mark.parametrize("count, noise", [(20, 1.0), (8, 1.0), (20, 4.0), (20, 0.25)])
def test_alarms_are_no_more_often_than_the_rate(count, noise):
    """New recordings may tell more or less than the healthy ones."""
    rng = default_rng(1)
    p = [p_of(recordings(rng, count), recordings(rng, 5, noise=noise)).p for _ in range(200)]
    assert np.mean(np.array(p) <= 0.05) <= 0.05 + 2.0 * np.sqrt(0.05 * 0.95 / 200)


@pytest.mark.parametrize("cause", CAUSES)
def test_the_cause_that_changed_is_named_alone(cause):
    rng = default_rng(2)
    off = np.zeros(D)
    off[CAUSES[cause][0]] = 6.0
    said = [p_of(recordings(rng, 20), recordings(rng, 10, off=off)).groups for _ in range(20)]
    assert sum(groups == ((cause,),) for groups in said) >= 18


def test_one_recording_tells_a_change_along_what_is_likely():
    rng = default_rng(7)
    shape = np.array([0.8, 0.5, 0.332, 0.0, 0.0, 0.0])

    def share(off, likely):
        """Of a hundred sets, each with five healthy recordings, that tell a change."""
        sets = [(recordings(rng, 5), recordings(rng, 1, off=off)) for _ in range(100)]
        tests = [cause_tests(difference_of(*pair, SIZE), CAUSES, likely) for pair in sets]
        return np.mean([each.p("a") < 0.01 for each in tests])

    assert share(0.0, {"a": shape}) <= 0.03
    assert share(8.0 * shape, {}) < 0.1
    assert share(8.0 * shape, {"a": shape}) > 0.5


def test_causes_that_do_the_same_cannot_be_told_apart():
    """Estimates whose sum alone is known: a change of one is as well one of the other."""
    blind = np.eye(D)
    blind[3:5, 3:5] = [[50.0, -49.99], [-49.99, 50.0]]
    rng = default_rng(3)

    def drawn(count, off):
        changes = recordings(rng, count)
        value = rng.multivariate_normal(np.zeros(D), blind, count) + off
        return changes._replace(value=value, inverse=np.repeat(blind[None], count, axis=0))

    off = np.array([0.0, 0, 0, 2.0, 0, 0])
    (group,) = p_of(drawn(20, 0.0), drawn(20, off)).groups
    assert set(group) == {"b", "c"}


def test_a_cause_that_leaves_little_is_taken_before_several_that_stand_for_it():
    """Each of four numbers of a is nearly done by another cause, whose single p is smaller."""
    causes = {"a": np.arange(4)} | {name: np.array([4 + k]) for k, name in enumerate("bcde")}
    inverse = 100.0 * np.eye(8)
    inverse[:4, 4:] = inverse[4:, :4] = 97.0 * np.eye(4)
    pull = inverse @ np.repeat([10.0, 0.0], 4)
    tests = CauseTests(inverse, pull, causes, {}, dict.fromkeys(causes, [1.0]), 10.0)
    assert tests.p("b") < tests.p("a")
    assert explained(tests, 0.01).groups == (("a",),)


def test_what_only_stood_for_a_cause_is_no_cause():
    """One number of b does nearly what three of a did."""
    along = np.array([0.8, 0.5, 0.332])
    inverse = 100.0 * np.eye(D)
    inverse[3, :3] = inverse[:3, 3] = 97.0 * along
    off = np.concatenate([np.sqrt(20.0) * along, np.zeros(3)])
    tests = CauseTests(inverse, inverse @ off, CAUSES, {}, dict.fromkeys(CAUSES, [1.0]), 10.0)
    assert tests.p("b") < tests.p("a")
    explanation = explained(tests, 0.01)
    assert explanation.groups == (("a",),)
    assert explanation.p_of_cause["a"] < 0.01 and explanation.p_of_cause["b"] == 1.0


@pytest.mark.parametrize("friction, doubt", [(10.0, False), (12.5, True)])
def test_a_cause_that_another_explains_with_friction_is_said(friction, doubt):
    """The effect of c is the sum of those of b and friction, as of a gain, a mass and friction."""
    causes = {"friction of a": np.array([0]), "b": np.array([1]), "c": np.array([2])}
    columns = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    pull, inverse = columns.T @ [friction, 10.0], columns.T @ columns + 1e-9 * np.eye(3)
    tests = CauseTests(inverse, pull, causes, {}, dict.fromkeys(causes, [1.0]), 1e3)
    explanation = explained(tests, 0.01)
    assert explanation.groups == (("c",),)
    assert explanation.hidden == (("c", "b", "friction of a"),) and explanation.doubt == doubt
    assert explanation.ways == [("c",), ("b", "friction of a")][: 1 + doubt]


@pytest.mark.parametrize("true", [0.0, 20.0])
def test_errors_of_estimates_are_no_scatter(true):
    effects = [Effect("friction of a", "", "1", 1e3)] * 4 + [Effect("b", "", "1", 1e3)] * 2
    healthy = recordings(default_rng(8), 100)
    noise = default_rng(9).standard_normal((100, D)) @ np.linalg.cholesky(NOISE).T
    noise[:, 0] += true * default_rng(10).standard_normal(100)
    (found,) = true_scatter(healthy._replace(value=noise), effects, np.array([[1.0, 1, 1, 0]]))
    assert found == pytest.approx(true, rel=0.2)


def test_what_follows_the_motion_is_no_change():
    """Slopes are learnt from the healthy recordings' variety."""
    rng = default_rng(4)
    healthy = recordings(rng, 40, noise=0.1, slope=3.0)
    new = recordings(rng, 10, noise=0.1, motion=1.8, slope=3.0)
    assert p_of(healthy, new).p > 0.01
    blind = [x._replace(motion=np.zeros_like(x.motion)) for x in (healthy, new)]
    with_, without = difference_of(healthy, new, SIZE), difference_of(*blind, SIZE)
    assert np.abs(with_.mean).max() < 0.2 * np.abs(without.mean).min()
