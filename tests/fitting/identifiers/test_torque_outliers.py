"""Gross outliers of torques: found where the motion denies them, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from frictionid.data.plants import plant_of
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import RTS
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.fitting.one_step.torque_outliers import (
    torque_outliers,
    without_torque_outliers,
)
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.simulate import Camera, Curve, Rig, Run, Sine, Stribeck, simulate


def states_of(data):
    return RTS()([r.angle for r in data.recordings])


def with_wild_torques(data, share, size, rng):
    recordings, masks = [], []
    for r in data.recordings:
        value = np.array(r.torque.value)
        wild = (rng.random(value.shape) < share) & value.any(axis=0)
        value += wild * rng.choice([-size, size], value.shape)
        recordings.append(replace(r, torque=r.torque._replace(value=value)))
        masks.append(wild)
    return replace(data, recordings=tuple(recordings)), masks


@pytest.mark.parametrize(("share", "hold"), [(0.01, "previous"), (0.1, "linear")])
def test_torques_that_the_motion_denies_are_replaced_by_their_neighbours(clean, share, hold):
    held = tuple(replace(r, torque=r.torque._replace(hold=hold)) for r in clean.recordings)
    data = replace(clean, recordings=held)
    wild, masks = with_wild_torques(data, share, 1.0, np.random.default_rng(0))
    found = torque_outliers(wild, plant_of(wild), states_of(wild))
    missed = sum((a & ~b).sum() for a, b in zip(masks, found, strict=True))
    assert missed <= 0.1 * sum(a.sum() for a in masks)
    assert not any((b & ~a).any() for a, b in zip(masks, found, strict=True))
    mended = without_torque_outliers(wild, plant_of(wild), states_of(wild))
    off = []
    each = zip(data.recordings, wild.recordings, mended.recordings, found, strict=True)
    for before, logged, after, mask in each:
        assert_array_equal(after.torque.value[~mask], logged.torque.value[~mask])
        off.append(np.abs(after.torque.value - before.torque.value)[mask])
    assert np.quantile(np.concatenate(off), 0.9) < 0.1  # but beside one that was missed


def test_torques_of_clean_data_stay_steps_and_all(clean):
    assert without_torque_outliers(clean, plant_of(clean), states_of(clean)) is clean


def test_short_pulses_that_acted_stay():
    """A pendulum that is struck: one sample of torque in twenty, far off its neighbours."""
    strokes = (Sine(1.5, 0.4),)
    rig = Rig(
        "struck",
        {"kind": "pendulum"},
        Stribeck(Curve((0.3,), (0.3,), (0.05,))),
        Camera(300, 60.0, 1e-3),
        (Run("a", (1.0,), (), strokes),),
        substeps=4,
    )
    data = simulate(rig)
    recording = data.recordings[0]
    rng = np.random.default_rng(1)
    wild = rng.random(recording.torque.value.shape) < 0.05
    pulses = recording.torque.value + 6.0 * wild * rng.choice([-1.0, 1.0], wild.shape)
    struck = replace(recording, torque=recording.torque._replace(value=pulses))
    # the pulses are logged, but did not act: all are denied
    logged = replace(data, recordings=(struck,))
    found = torque_outliers(logged, plant_of(logged), states_of(logged))[0]
    assert (found & wild).sum() >= 0.9 * wild.sum()
    # the motion of a pendulum that they did act on shows them: none is
    acted = replace(data, recordings=(moved_by(struck, data),))
    assert not torque_outliers(acted, plant_of(acted), states_of(acted))[0].any()


def moved_by(recording, data):
    """The recording with the motion under its own torque and viscous friction, and angle noise."""
    time, torque = recording.angle.time, recording.torque
    viscous = Friction(CoulombViscous(), np.array([[0.0, 0.3]]))
    start = State(recording.angle.value[0], np.zeros(1))
    q = rollout(plant_of(data)[0], viscous, start, torque.value[: len(time) - 1], np.diff(time)).q
    noise = 1e-3 * np.random.default_rng(2).normal(size=q.shape)
    held = torque._replace(hold="previous")
    return replace(recording, angle=Signal(time, q + noise), torque=held, truth=None)
