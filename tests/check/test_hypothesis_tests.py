"""Samples that are too far apart for the motion are named, and torques that act later."""

from dataclasses import replace

import numpy as np
import pytest
from drive_logs import ServoPendulum
from fixtures.changed_data import changed, each
from fixtures.servo_logs import by_controller

from frictionid.check.hypothesis_tests import run_tests, sampling_findings
from frictionid.check.motion import Measured, motions_of
from frictionid.data.signals import Signal


def thinned(data, every, slower=1.0):
    """One angle out of so many, on clocks that run slower."""
    return each(
        data,
        lambda r: replace(
            r,
            angle=Signal(slower * r.angle.time[::every], r.angle.value[::every]),
            torque=r.torque._replace(time=slower * r.torque.time),
            truth=None,
        ),
    )


def found(data):
    return sampling_findings(Measured.of_dataset(data, motions_of(data.recordings)))


@pytest.mark.parametrize(("every", "gap"), [(1, ""), (2, ""), (4, "66.7 ms"), (6, "100 ms")])
def test_samples_at_60_and_30_hz_are_enough_and_those_at_15_and_10_hz_too_few(clean, every, gap):
    findings = found(thinned(clean, every))
    assert len(findings) == bool(gap)
    for finding in findings:
        assert (finding.kind, finding.level) == ("slow_sampling", "doubtful")
        assert finding.numbers["change"] > 0.1
        assert gap in finding.text
        assert "times as often" in finding.remedy


def test_only_the_samples_count_and_not_the_speed_of_the_clock(clean):
    """The same motion at a tenth of its speed, at a tenth of the rate, is as well sampled."""
    (fast,), (slow,) = found(thinned(clean, 6)), found(thinned(clean, 6, slower=10.0))
    np.testing.assert_allclose(slow.numbers["change"], fast.numbers["change"], rtol=0.05)


def test_a_torque_that_is_computed_has_no_clock_to_correct():
    """That of a controller, from targets: what to do about a delay is a block of the fit."""
    rig = ServoPendulum(delay=0.0)
    logs = {f"{seed}": rig.log(4.0, 0.05, seed, seconds=4.0) for seed in range(4)}
    late = changed(by_controller(rig, logs, P=4.0, D=0.05), "torque", np.array, -0.01)
    tests = run_tests(Measured.of_dataset(late, motions_of(late.recordings)))
    (asked,) = (f for f in tests.findings if f.kind in ("hold", "delay"))
    assert asked.numbers["delay"] == pytest.approx(0.01, abs=2e-3)
    assert "block 'backlash'" in asked.remedy and "clock" not in asked.remedy
