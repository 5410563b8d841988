"""Friction of joints on a base that moves, as MuJoCo moves it: by every method, and not without."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures import floating_legs as legs

import frictionid as fid
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.data.state_estimators import RTS
from frictionid.evaluation.free_run import free_run, make_trajectory
from frictionid.fitting.torque_balance import torque_balance
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


@pytest.fixture(scope="module")
def one_step(floating):
    return fid.fit(floating, "coulomb_viscous", method="one_step")


def errors(fit):
    """Largest error of Coulomb levels, and of viscous coefficients."""
    return np.abs(fit.friction.theta / TRUTH - 1.0).max(axis=0)


def test_friction_is_found_in_one_step_in_flight_and_on_a_tether(one_step):
    coulomb, viscous = errors(one_step)
    assert coulomb < 0.005 and viscous < 0.03


def test_friction_is_found_beside_inertias(floating):
    fit = fid.fit(floating, "coulomb_viscous", method="inverse_dynamics")
    coulomb, viscous = errors(fit)
    assert coulomb < 0.03 and viscous < 0.12


def test_friction_is_found_by_shooting(floating):
    free = {"free": ["friction", "delay"], "sample_time": 0.008}
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


@pytest.fixture(scope="module")
def flights():
    return {f"flight {k}": legs.run(1.5, 20 + k, tether=False) for k in range(3)}


def test_the_base_of_a_flight_tells_of_inertias(machines, flights):
    truth, off, free = machines[0].nominal_base, [], ["friction", "inertia"]
    for base in (legs.BASE, legs.BASE | {"wrench": "none"}):
        data = Dataset.from_frames(flights, machines[0], **legs.COLUMNS, base=base)
        fit = fid.fit(data, "coulomb_viscous", method="inverse_dynamics", free=free)
        off.append(np.abs(fit.friction.calibration.base - truth))
    assert np.median(off[1] / off[0]) < 0.5 and off[1].max() < off[0].max()


def test_rows_of_the_base_leave_nothing_of_the_true_bodies(machines):
    frame = legs.run(1.0, 10, tether=False, noise=0.0)
    base = legs.BASE | {"wrench": "none"}
    data = Dataset.from_frames({"flight": frame}, machines[0], **legs.COLUMNS, base=base)
    balance = torque_balance(data, RTS()([data["flight"].angle]), 0.05, 0.002)
    use = balance.start > 0.2
    wrench, p = balance.resolving(use).wrench, machines[0].nominal_base
    sizes = np.abs(wrench.regressor * p).max(axis=(0, 2))
    left = wrench.left(np.tile(p, (len(use), 1)))
    assert not left[~use].any() and (np.abs(left).max(axis=0) < 0.03 * sizes).all()
    held = replace(data["flight"], base_wrench=None)
    mixed = replace(data, recordings=(data["flight"], replace(held, name="tether")))
    states = RTS()([r.angle for r in mixed.recordings])
    assert torque_balance(mixed, states, 0.05, 0.002).wrench is None


def test_motion_is_predicted_on_the_base_as_it_moved(floating, one_step):
    motion = one_step.predict(floating)
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
