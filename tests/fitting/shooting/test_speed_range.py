"""Stribeck velocities of slow joints: bounds come from the data, in the joint's own unit."""

import json

import numpy as np
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.true_curves import curve_errors
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.check import check
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.evaluation import EstimatedStates, Prepared, Protocol, torque_frame, torque_left
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, training_problem
from frictionid.fitting.shooting import refine
from frictionid.friction import DataRange, Friction, constraints_of
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.simulate import Camera, Curve, Drive, Rig, Run, Sine, simulate, write_dataset
from frictionid.simulate import Stribeck as Truth

NAMES = ("coulomb", "peak", "stribeck_velocity", "viscous")
AXIS = {"kind": "linear_axis", "parameters": {"mass": 20.0}}
PENDULUM = {"kind": "pendulum", "parameters": {"mass": 0.5, "length": 0.2}}
LINKS = {"m1": 0.5, "m2": 0.4, "l1": 0.2, "r1": 0.1, "r2": 0.1, "I1": 0.005, "I2": 0.004}
DOUBLE = {"kind": "double_pendulum", "parameters": LINKS}
AXIS_FRICTION = (12.0, 4.0, 0.02, 30.0)  # N, N, m/s, N s/m
PENDULUM_FRICTION = (0.06, 0.03, 0.02, 0.01)  # N m, N m, rad/s, N m s/rad


def recorded(mechanism, friction, torque, noise, seed=0):
    """Four recordings of 1.5 s at 1 kHz; friction (4,) of all joints, which have torques (n,)."""
    coulomb, peak, velocity, viscous = ((x,) * len(torque) for x in friction)
    curve = Curve(coulomb, coulomb, viscous, peak, peak, velocity)
    draw = np.random.default_rng(seed)
    runs = tuple(
        Run(
            f"{k}",
            (0.0,) * len(torque),
            torques=tuple(Sine(u * draw.uniform(1, 2), draw.uniform(0.5, 2.0)) for u in torque),
        )
        for k in range(4)
    )
    camera, exact = Camera(1500, 1000.0, noise), {"drive": Drive(1000.0), "substeps": len(torque)}
    return simulate(Rig("slow", mechanism, Truth(curve), camera, runs, **exact))


def problem_of(data):
    return training_problem(data, plant_of(data), INTEGRAL)


def fitted(problem, **settings):
    return LeastSquares(Stribeck(), **settings).fit(problem, np.ones((1, len(problem.r))), 0)[0]


@pytest.fixture(scope="module")
def axis():
    return recorded(AXIS, AXIS_FRICTION, (22.0,), 2e-6)


@pytest.fixture(scope="module")
def problem(axis):
    return problem_of(axis)


@pytest.mark.parametrize("kind", ["axis", "pendulum"])
def test_slow_stribeck_friction_comes_out_within_its_intervals(kind, axis):
    data = axis if kind == "axis" else recorded(PENDULUM, PENDULUM_FRICTION, (0.5,), 2e-5)
    truth = np.array(AXIS_FRICTION if kind == "axis" else PENDULUM_FRICTION)
    found = refine(fitted(problem_of(data)), data)
    assert found.diagnostics.settled
    interval = found.covariance.interval(0.99)[: len(truth)]
    assert ((interval[:, 0] <= truth) & (truth <= interval[:, 1])).all()
    assert (curve_errors(found.friction, data) < 0.02).all()


def test_a_narrow_peak_is_fitted_even_where_the_fit_begins_without_it():
    """At a peak of zero its velocity has no trace, and a far one would keep the peak at zero."""
    data = recorded(PENDULUM, (0.06, 0.03, 0.2, 0.01), (0.5,), 1e-4)
    ends = [
        refine(Friction(Stribeck(), [theta]), data)
        for theta in ([0.065, 0.0, 9.0, 0.008], [0.06, 0.03, 0.2, 0.01])
    ]
    assert_allclose(ends[0].friction.theta, ends[1].friction.theta, rtol=0.03)


def test_so_are_those_of_two_joints():
    """Within half a standard error of a fit that begins at the truth."""
    truth = (0.06, 0.03, 0.2, 0.01)
    data = recorded(DOUBLE, truth, (1.2, 0.5), 1e-4)
    ends = [
        refine(Friction(Stribeck(), np.array([theta] * 2)), data).covariance
        for theta in ([0.065, 0.0, 9.0, 0.008], truth)
    ]
    assert (np.abs(ends[0].values - ends[1].values)[:8] < 0.5 * ends[1].error[:8]).all()


def test_a_peak_of_slower_motion_than_there_is_is_none():
    """It would be of any height: of exp(-(w/ws)^2) such data show the tail alone."""
    curve = Curve((0.12,), (0.12,), (0.008,))
    runs = tuple(Run(f"{k}", (0.5 * k,), (22.0 + k,)) for k in range(4))
    camera = Camera(61, 60.0, 1e-3)
    data = simulate(Rig("turns", PENDULUM, Truth(curve), camera, runs, substeps=24))
    slow = min(np.abs(r.truth.velocity.value).min() for r in data.recordings)
    found = refine(fitted(problem_of(data)), data)
    for limits in (fitted(problem_of(data)).constraints, found.fitted.constraints):
        assert np.ravel(limits.low)[2] == pytest.approx(slow / 2, rel=0.05)
    assert curve_errors(found.friction, data).max() < 0.1


def test_a_velocity_beyond_what_the_data_resolve_ends_there_without_intervals(axis, problem):
    held = fitted(problem, bounds={"stribeck_velocity": (0.3, 10.0)})
    assert 0.3 <= held.theta[0, 2] <= 10.0
    found = refine(held, axis)
    assert np.isclose(found.friction.theta[0, 2], (0.3, 10.0)).any()
    own = [p.block == "friction" for p in found.covariance.parameters]
    assert not found.covariance.identified[own].any()
    assert not np.isfinite(found.covariance.error[own]).any()
    (words,) = (w for w in found.covariance.undetermined if w.startswith("stribeck_velocity"))
    assert "ends at 0.3 m/s" in words or "ends at 10 m/s" in words


def test_bounds_and_priors_of_parameters(axis, problem):
    viscous = fitted(problem, prior={"viscous": (20.0, 1e-6)}).theta[0, 3]
    assert viscous == pytest.approx(20.0, abs=1e-4)
    loose = fitted(problem, prior={"viscous": (20.0, 1e6)}).theta
    assert_allclose(loose, fitted(problem).theta, rtol=1e-4)
    held = fitted(problem, bounds={"coulomb": (13.0, 14.0)})
    assert held.theta[0, 0] == pytest.approx(13.0)
    found = refine(fitted(problem, prior={"viscous": (20.0, 1e-6)}), axis)
    assert found.friction.theta[0, 3] == pytest.approx(20.0, abs=1e-4)


WRONG = r"""
bounds = {viscuos = [0.0, 1.0]} => no parameter 'viscuos'; did you mean 'viscous'
bounds = {viscous = [1.0, 1.0]} => bounds of 'viscous' = \[1, 1\] must increase
bounds = {viscous = [-1.0, 1.0]} => within the law's own \[0, inf\]
prior = {viscous = [1.0, 0.0]} => prior of 'viscous' = \[1, 0\] must be a mean
"""


@mistakes(WRONG)
def test_mistakes_in_bounds_and_priors_are_refused(wrong, words):
    speeds = DataRange(np.array([0.1]), np.array([5.0]))
    with assert_refused(words):
        constraints_of(CoulombViscous(), speeds, **changes(wrong))


def test_bounds_and_priors_from_the_command_line(axis, tmp_path, run):
    write_dataset(axis, tmp_path / "data")
    out = tmp_path / "model.json"
    words = ("fit", "data", "--identifier", "stribeck", "--out", out, "--set")
    bounds = "bounds.stribeck_velocity=[0.01, 0.015]"
    assert run(tmp_path, *words, bounds, "--set", "prior.viscous=[20, 1e-6]")[0] == 0
    joint = json.loads(out.read_text())["joints"][0]
    assert 0.01 <= joint["stribeck_velocity"]["value"] <= 0.015
    assert joint["viscous"]["value"] == pytest.approx(20.0, abs=1e-3)
    outcome = run(tmp_path, *words, "bounds.viscuos=[0, 1]", "--replace")
    assert_one_line(outcome, "did you mean 'viscous'")


# --- Slow motion under friction that falls with the speed -----------------------------------------


SLOW = (0.9, 0.5, 0.01, 0.6)  # N, N, m/s, N s/m


def slow_axis(level, peak, velocity, viscous, mass):
    """A carriage that a controller leads along slow sines, in steps of .1 ms, friction as it is.

    Four recordings of 5 s at 250 Hz, positions to 2 um, forces to 20 mN.
    """
    rng, time, per, h = np.random.default_rng(3), np.arange(1250) / 250, 40, 1e-4
    rate, phase = 2 * np.pi * np.array([0.2, 0.4, 0.6]), rng.uniform(0, 2 * np.pi, (4, 3))
    waves = rate * time[:, None, None] + phase
    aim, speed = 0.012 * np.sin(waves).sum(-1), 0.012 * (rate * np.cos(waves)).sum(-1)
    q, w = aim[0], speed[0]
    angle, force = np.empty_like(aim), np.empty_like(aim)
    for k in range(len(time)):
        angle[k], force[k] = q, 900.0 * (aim[k] - q) + 40.0 * (speed[k] - w)
        for _ in range(per):  # what friction cannot stop within a step slides on
            most = h / mass * (level + peak * np.exp(-((w / velocity) ** 2)))
            free = w + h / mass * (force[k] - viscous * w)
            w = np.sign(free) * np.maximum(np.abs(free) - most, 0.0)
            q = q + h * w
    angle += 2e-6 * rng.standard_normal(angle.shape)
    logged = force + 0.02 * rng.standard_normal(force.shape)
    runs = {
        f"r{i}": {"time": time, "angle": angle[:, [i]], "torque": logged[:, [i]]} for i in range(4)
    }
    machine = {"kind": "linear_axis", "parameters": {"mass": 1.02 * mass}}
    return Dataset.from_arrays(runs, machine, hold="previous")


def test_windows_are_shorter_where_friction_that_falls_lets_predictions_run_away():
    """In .3 s the noise of a start grows by e^80: fits of usual windows ran to any inertia."""
    data = slow_axis(*SLOW, mass=0.2)
    assert check(data).level == "good"
    friction = fid.fit(data, "stribeck").friction
    assert friction.law.names == NAMES
    assert_allclose(friction.theta[0], SLOW, rtol=0.1)
    assert_allclose(friction.calibration.base.ravel(), 0.2, rtol=0.1)
    ready = Prepared(data, Protocol(), EstimatedStates(data), plant_of(data))
    assert torque_frame(map(tuple, torque_left(friction, ready)))["left"].max() < 0.01
