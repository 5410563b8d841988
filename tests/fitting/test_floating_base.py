"""Friction of joints on a base that moves, as MuJoCo moves it: by every method, and not without."""

import numpy as np
import pytest
from fixtures import floating_legs as legs

import frictionid as fid
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.data.state_estimators import RTS
from frictionid.evaluation.free_run import free_run, make_trajectory
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous

TRUTH = np.stack([legs.COULOMB, legs.VISCOUS], axis=1)


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    """The mechanism floating, and held at its trunk."""
    folder = tmp_path_factory.mktemp("legs")
    return legs.mechanism(folder, floating=True), legs.mechanism(folder, base="trunk")


@pytest.fixture(scope="module")
def frames():
    """Two runs on a swaying tether, and one in flight."""
    runs = {f"tether {k}": legs.run(4.0, k) for k in range(2)}
    return runs | {"flight": legs.run(1.0, 2, tether=False)}


@pytest.fixture(scope="module")
def floating(machines, frames):
    return Dataset.from_frames(frames, machines[0], **legs.COLUMNS, base=legs.BASE)


def errors(fit):
    """Largest error of Coulomb levels, and of viscous coefficients."""
    return np.abs(fit.friction.theta / TRUTH - 1.0).max(axis=0)


def test_friction_is_found_in_one_step_in_flight_and_on_a_tether(floating):
    coulomb, viscous = errors(fid.fit(floating, "coulomb_viscous", method="one_step"))
    assert coulomb < 0.005 and viscous < 0.03


def test_friction_is_found_beside_inertias(floating):
    fit = fid.fit(floating, "coulomb_viscous", method="inverse_dynamics")
    coulomb, viscous = errors(fit)
    assert coulomb < 0.03 and viscous < 0.12


def test_friction_is_found_by_shooting(floating):
    free = {"free": ["friction", "delay"], "sample_time": 0.004}
    coulomb, viscous = errors(fid.fit(floating, "coulomb_viscous", method="shooting", **free))
    assert coulomb < 0.005 and viscous < 0.02


def test_a_pose_serves_as_an_imu_does(machines, frames):
    data = Dataset.from_frames(frames, machines[0], **legs.COLUMNS, base=legs.POSE)
    coulomb, viscous = errors(fid.fit(data, "coulomb_viscous", method="one_step"))
    assert coulomb < 0.02 and viscous < 0.05


def test_a_base_that_is_taken_as_held_makes_friction_of_its_motion(machines, frames, floating):
    held = Dataset.from_frames(frames, machines[1], **legs.COLUMNS)
    coulomb, viscous = errors(fid.fit(held, "coulomb_viscous", method="one_step"))
    assert coulomb > 0.5 and viscous > 1.0
    assert [fid.check(data).level for data in (held, floating)] == ["doubtful", "good"]


def test_motion_is_predicted_on_the_base_as_it_moved(floating):
    truth = fid.fit(floating, "coulomb_viscous", method="one_step")
    motion = truth.predict(floating)
    ahead = motion[np.isclose(motion["time_s"] - motion["start_s"], 0.1, atol=5e-4)]
    off = [np.abs(ahead[f"q{j}"] - ahead[f"measured_q{j}"]).median() for j in (1, 2, 3)]
    assert max(off) < 2e-3


def test_a_free_run_in_flight_stays_near_the_motion(machines):
    frame = legs.run(1.0, 2, tether=False, noise=0.0)
    data = Dataset.from_frames({"flight": frame}, machines[0], **legs.COLUMNS, base=legs.BASE)
    trajectory = make_trajectory(data, RTS()([data["flight"].angle]), 0.2)
    friction = Friction(CoulombViscous(), TRUTH)
    held = trajectory._replace(base_motion=None)
    off = [
        np.abs(free_run(plant_of(data), friction, each) - trajectory.measured).max()
        for each in (trajectory, held)
    ]
    assert off[0] < 1e-3 and off[1] > 1.0
