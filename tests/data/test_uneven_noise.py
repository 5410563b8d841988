"""Samples whose noise is known one by one: smoother, shooting and reader weigh them."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.dataset_files import load_single
from fixtures.refusals import assert_refused
from fixtures.true_curves import plain_friction
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.kalman import likeliest_jerk_ratio, padded_series, rts_smoother
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal, cut, relative_noise
from frictionid.data.state_estimators import RTS
from frictionid.fitting.parameters import FrictionBlock
from frictionid.fitting.shooting import refine
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.simulate import Camera, Rig, Run, simulate

RATE = 60.0


def noisy(true, rng, sigma):
    return true + sigma * rng.standard_normal(true.shape)


def test_the_smoother_trusts_samples_by_their_noise():
    """Of rough samples that are not left out as outliers, as `RTS` would."""
    t = np.arange(240) / RATE
    true = np.sin(4 * t)[:, None]
    rng = default_rng(0)
    sigma = np.where(rng.random(t.shape) < 0.3, 0.05, 0.001)[:, None]
    errors = []
    for _ in range(20):
        value = noisy(true, rng, sigma)
        each = (padded_series([Signal(t, value, sigma=own)]) for own in (sigma, None))
        smooth = (rts_smoother(series, likeliest_jerk_ratio(series)) for series in each)
        errors.append([np.sqrt(np.mean((mean[..., 0] - true) ** 2)) for mean in smooth])
    weighted, unweighted = np.median(errors, axis=0)
    assert weighted < 0.2 * unweighted


def test_equal_deviations_change_nothing():
    t = np.arange(90) / RATE
    value = noisy(np.sin(5 * t)[:, None], default_rng(1), 0.002)
    plain = RTS()([Signal(t, value)])[0]
    weighted = RTS()([Signal(t, value, sigma=np.full_like(value, 0.7))])[0]
    assert_array_equal(weighted.q, plain.q)


def swings(sigma_of):
    """A pendulum seen by a camera whose noise differs from frame to frame."""
    rig = Rig(
        "swing",
        {"kind": "pendulum", "parameters": {"mass": 0.4, "length": 0.2}},
        plain_friction(0.02, 0.004),
        Camera(samples=240, rate=RATE),
        tuple(Run(f"r{k}", start_angle=(a,)) for k, a in enumerate((2.4, -2.0, 1.5, 2.8))),
        substeps=4,
    )
    data = simulate(rig)
    rng = default_rng(3)
    recordings = []
    for r in data.recordings:
        sigma = sigma_of(rng, r.truth.angle.value.shape)
        angle = Signal(r.angle.time, noisy(r.truth.angle.value, rng, sigma), sigma=sigma)
        recordings.append(Recording(r.name, angle, r.torque))
    return Dataset(data.name, data.mechanism, tuple(recordings))


def unweighted(data):
    recordings = (replace(r, angle=r.angle._replace(sigma=None)) for r in data.recordings)
    return replace(data, recordings=tuple(recordings))


def test_shooting_trusts_samples_by_their_noise():
    data = swings(lambda rng, shape: np.where(rng.random(shape) < 0.4, 0.03, 0.0005))
    start = Friction(CoulombViscous(), [[0.03, 0.002]])
    errors = []
    for d in (data, unweighted(data)):
        theta = refine(start, d, (FrictionBlock(),)).friction.theta[0]
        errors.append(np.abs(theta / [0.02, 0.004] - 1).max())
    assert errors[0] < 0.02 and errors[0] < 0.5 * errors[1]


def test_a_part_of_a_signal_keeps_its_deviations():
    signal = Signal(np.arange(4.0), np.ones((4, 1)), sigma=np.array([[1.0], [2.0], [4.0], [8.0]]))
    part = cut(signal, 1.0, 2.0)
    assert part.sigma.tolist() == [[2.0], [4.0]]
    assert_allclose(relative_noise(part).ravel(), [2 / 3, 4 / 3])


TOML = b"""
name = "tracked"
[mechanism]
kind = "pendulum"
[columns]
time = "time"
angle = ["q1"]
sigma = ["sigma1"]
torque = [""]
missing = "drop"
[units]
angle = "deg"
[recordings]
patterns = ["*.csv"]
"""
ROWS = [
    "time,q1,sigma1,state",
    "0,90,0.1,found",
    "1,,,predicted",
    "2,60,0.2,found",
    "3,30,0.4,found",
]


def test_a_table_of_a_tracker_has_deviations_and_holes(tmp_path):
    angle = load_single(tmp_path, TOML, a_csv="\n".join(ROWS).encode()).angle
    assert angle.time.tolist() == [0.0, 2.0, 3.0]
    assert_allclose(np.degrees(angle.value.ravel()), [90, 60, 30])
    assert_allclose(np.degrees(angle.sigma.ravel()), [0.1, 0.2, 0.4])


@pytest.mark.parametrize(
    "rows, line",
    [
        ([*ROWS[:2], "2,60,0,found"], "sigma must be positive"),
        ([ROWS[0], "0,,,lost", "1,,,lost"], "no row has all angles"),
        ([*ROWS[:2], "2,60,,found"], "'sigma1' is empty or nan"),
    ],
)
def test_wrong_deviations_are_reported_in_one_line(tmp_path, rows, line):
    with assert_refused(line):
        load_single(tmp_path, TOML, a_csv="\n".join(rows).encode())
