"""A fault of one or two recordings is named with them, and the others are judged without it.

Cases: four rigs of the planted faults, five recordings of 5 s each, seed 5.
"""

from dataclasses import replace

import numpy as np
import pytest
from fixtures import planted_faults as pool
from fixtures.changed_data import each, one_changed, with_value
from fixtures.driven_pendulum import driven_pendulum
from numpy.testing import assert_allclose

from frictionid.check import check


@pytest.fixture(scope="module")
def cases():
    rigs, rng = pool.pool(0, 4), np.random.default_rng(5)
    return [pool.case(rig, rng, driven=4) for rig in rigs]


def turned(r):
    """The zero of the first angle 5 degrees off."""
    first = np.arange(r.angle.value.shape[1]) == 0
    return with_value(r, "angle", lambda q: q + np.radians(5.0) * first)


def in_degrees(r):
    return with_value(r, "angle", np.degrees)


def torque_times(factor):
    return lambda r: with_value(r, "torque", lambda u: factor * u)


def spoiled(case, fault, odd):
    names = iter(range(len(case.recordings)))
    named = each(case, lambda r: replace(r, name=f"r{next(names)}"))
    return each(named, lambda r: fault(r) if int(r.name[1:]) in odd else r)


@pytest.mark.parametrize("odd", [{3}, {1, 3}], ids=str)
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (turned, "the zero of angle 1 is off by +"),
        (torque_times(0.8), ", not 1: wrong gear or torque constant"),
        (torque_times(-1.0), "the wrong sign"),
        (in_degrees, "angles are in degrees, not rad"),
    ],
)
def test_a_fault_is_named_with_its_recordings(fault, words, odd, cases):
    missed = []
    for case in cases:
        verdict = check(spoiled(case, fault, odd))
        wrong = [f.text for f in verdict.findings if f.level != "good"]
        named = {k for k in range(5) if any(f"in 'r{k}' " in text for text in wrong)}
        if named != odd or not all(words in text for text in wrong):
            missed.append((case.name, wrong))
    assert len(missed) <= 1, missed


def test_the_others_are_judged_without_it(cases):
    others = [r for k, r in enumerate(spoiled(cases[0], turned, set()).recordings) if k != 3]
    expected, verdict = (
        check(replace(cases[0], recordings=tuple(others))),
        check(spoiled(cases[0], turned, {3})),
    )
    assert_allclose(verdict.estimate.value, expected.estimate.value, rtol=1e-9)
    assert verdict.level == "doubtful" and expected.level == "good"


def test_the_bias_of_a_torque_sensor_in_one_recording_is_named_with_its_size():
    """Alone it is friction's offset, which is one for all recordings. A command has no sensor."""
    plain, names = driven_pendulum(900), iter(range(6))
    case = each(plain, lambda r: replace(r, name=f"r{next(names)}"))
    off = one_changed(
        case, "torque", 3, 0, slice(None), case.recordings[3].torque.value[:, 0] + 0.08
    )
    (wrong,) = (f for f in check(off).findings if f.level != "good")
    assert wrong.kind == "bias_of_recording" and wrong.text.startswith("in 'r3' torque 1 is off")
    assert wrong.numbers["size"] == pytest.approx(0.08, rel=0.05)
    commanded = check(replace(off, torque_at="command")).findings
    assert "bias_of_recording" not in {f.kind for f in commanded}
