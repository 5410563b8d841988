"""Intervals of one-step fits that hold the bias of smoothed states."""

from dataclasses import replace

import numpy as np
import pytest
from coverage_cases import case_of, parts_of, rig_of
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.simulate import simulate

SETS, RECORDINGS, RATE = 2, 8, 250.0
CASE = case_of("stribeck", "acrobot")


@shared
def sets():
    """Simulated acrobots of a truth that sticks, 2 s at 250 Hz, finely integrated."""
    rig = rig_of(CASE, range(1, 1 + SETS), RECORDINGS, late=False)
    camera = replace(rig.camera, samples=round(2 * RATE) + 1, rate=RATE)
    return parts_of(simulate(replace(rig, camera=camera, substeps=3)), RECORDINGS)


@shared
def fits(sets):
    """One-step fits of all sets with intervals of the noise alone, and with the bias too."""
    return [
        [fid.fit(data, "stribeck", method="one_step", bias=bias) for data in sets]
        for bias in (False, True)
    ]


def held(fit):
    """Which true parameters (n P,) lie in their intervals."""
    true, frame = CASE.values.ravel(), fit.frame
    return ((frame.low_95 <= true) & (true <= frame.high_95)).to_numpy()


def test_intervals_with_the_bias_hold_the_truth_where_those_of_noise_alone_do_not(fits):
    alone, known = (np.mean([held(fit) for fit in group]) for group in fits)
    assert alone < 0.85 < 0.9 <= known


def test_the_bias_widens_intervals_by_its_size_and_moves_no_parameter(fits, tmp_path):
    alone, known = (group[0] for group in fits)
    assert_array_equal(known.friction.theta, alone.friction.theta)
    bias = known.friction.provenance.smoothing_bias
    wider = known.frame.high_95 - alone.frame.high_95
    assert_allclose(wider, np.abs(bias).ravel(), rtol=1e-9)
    assert "bias=True" in repr(alone) and "too narrow" in repr(alone)
    assert "the noise, and the bias of smoothed states" in repr(known) and "95 %" in repr(known)
    assert "noise alone" in alone.friction.provenance.half_widths_hold
    known.save(tmp_path / "known.json")
    assert repr(fid.load_model(tmp_path / "known.json")).count("bias of smoothed states") == 1


@pytest.mark.parametrize("law", ["none", "mlp"])
def test_fits_without_intervals_have_no_bias_to_add(sets, law):
    with assert_refused("bias: .* has none: give a law with parameters"):
        fid.fit(sets[0], law, bias=True)


def test_a_friction_that_replays_other_motion_says_nothing_of_the_bias(sets):
    with assert_refused("unlike the recordings: fit by shooting"):
        fid.fit(with_torque(sets[0], 30.0), "coulomb_viscous", bias=True)


def with_torque(data, factor):
    """The data with torques that are so much larger than those that acted."""
    recordings = [
        replace(r, torque=r.torque._replace(value=factor * r.torque.value)) for r in data.recordings
    ]
    return replace(data, recordings=tuple(recordings[2:]))
