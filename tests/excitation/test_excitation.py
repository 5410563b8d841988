"""Experiment design: predictions against measurements, limits, and laws of the optimum."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures.pendulum_experiment import on_pendulum
from fixtures.refusals import assert_refused
from fixtures.true_curves import plain_friction
from numpy.random import default_rng

from frictionid.data.kalman import Series, rts_smoother
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import States
from frictionid.excitation import (
    Experiment,
    Information,
    Motions,
    Search,
    covariances,
    design_signals,
    expected_information,
    limits_of,
    monte_carlo,
    predict_motions,
    prior_friction_of,
)
from frictionid.excitation.design import e_criterion, exchange, simulated
from frictionid.excitation.information import (
    Concatenated,
    base_jacobian,
    friction_jacobian,
    smoother_gains,
)
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, training_problem
from frictionid.fitting.one_step.residual import mask_stiction, one_step_problem
from frictionid.friction import along
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import Plant, acrobot, linear_axis
from frictionid.report.experiment_design import (
    command_frame,
    csv_of,
    described,
    design_figure,
)
from frictionid.report.figures.style import png
from frictionid.simulate.integrate import TrueSystem, integrate_motion

SEEDS = range(1000, 1040)  # of the noise in measurements
COULOMB, VISCOUS = (0.165, 0.0525), (0.004, 0.0008)


@cache
def on_acrobot():
    """A design for the acrobot with the simulated rig's level of friction, quickly searched."""
    machine = acrobot()
    limits = limits_of("torque=0.14, velocity=20, angle=3.1", machine)
    friction = prior_friction_of(f"coulomb={list(COULOMB)}, viscous={list(VISCOUS)}", limits)
    experiment = Experiment(
        Plant.from_parameters(machine, {}), friction, limits, length=3.0, recordings=3
    )
    return design_signals(experiment, Search(pool=96, generations=2, children=48))


@cache
def swinging():
    """The same for a pendulum, the second rig."""
    return design_signals(on_pendulum(), Search(pool=96, generations=2, children=64))


def really(experiment, torque, start):
    """Angles and velocities (T + 1, N, n) by the independent simulator with set-valued friction."""
    theta = experiment.friction.theta
    coulomb, viscous = (tuple(map(float, column)) for column in theta.T)
    system = TrueSystem(
        experiment.plant.mechanism,
        experiment.plant.p,
        plain_friction(coulomb, viscous),
    )
    states = integrate_motion(
        system, start, 0.0 * start, torque[:-1], experiment.images, 1 / 60 / 4
    )
    return states[:, 0], states[:, 1]


def sine(experiment, frequency):
    """The plain sine at the torque limit, from rest hanging down, in each recording."""
    wave = np.sin(2 * np.pi * frequency * experiment.commands)
    count = experiment.recordings
    torque = np.repeat((wave[:, None] * experiment.limits.torque)[:, None], count, axis=1)
    return torque, np.zeros((count, experiment.plant.n))


def measured(experiment, torque, start):
    """Training problem of SEEDS noisy repetitions of the recordings, and each row's seed."""
    q = really(experiment, torque, start)[0]
    recordings = []
    for seed in SEEDS:
        noise = default_rng(seed).normal(0.0, experiment.angle_noise, q.shape)
        for r in range(q.shape[1]):
            angle = Signal(experiment.images, q[:, r] + noise[:, r])
            held = Signal(experiment.commands, torque[:, r], hold="previous")
            recordings.append(Recording(f"{seed}_{r}", angle, held))
    repeated = Dataset("noisy", {"kind": "acrobot"}, tuple(recordings), {}, {}, None)
    plant = experiment.plant
    many = Plant(
        plant.mechanism,
        {k: np.repeat(v, len(recordings)) for k, v in plant.parameters.items()},
        np.repeat(plant.p[None], len(recordings), axis=0),
    )
    recipe = replace(INTEGRAL, velocity_threshold=float(experiment.velocity_threshold[0]))
    problem = training_problem(repeated, many, recipe)
    return problem, problem.recording // q.shape[1]


def scatter(experiment, torque, start):
    """Standard deviations of fits of friction, and of friction and base parameters, over seeds.

    The first are those of `frictionid fit`; the second take one Gauss-Newton step from the truth,
    where the residual is linear.
    """
    problem, seed = measured(experiment, torque, start)
    parts = [
        friction_jacobian(experiment.friction, problem),
        base_jacobian(experiment.plant, problem),
    ]
    A = np.concatenate(parts, axis=-1)
    e = problem.residual(along(experiment.friction, problem.nodes))
    alone, free = [], []
    for s in range(len(SEEDS)):
        drawn = seed == s
        rows, left = A[drawn].reshape(-1, A.shape[-1]), e[drawn].ravel()
        free.append(np.linalg.lstsq(rows, -left, rcond=None)[0])
        part = problem.of_rows(np.flatnonzero(drawn))
        fitted = LeastSquares(CoulombViscous()).fit(part, np.ones((1, len(part.r))), 0)
        alone.append(fitted.theta.ravel())
    return np.std(alone, axis=0, ddof=1), np.std(free, axis=0, ddof=1)


def standard_errors(each):
    """Standard errors (P,) by all recordings of `each` (1, R, P, P) together."""
    total = Information(*(x[0].sum(0) for x in each))
    return np.sqrt(np.diagonal(covariances(total)))


# --- Predictions against measurements ---------------------------------------------------------


@pytest.mark.parametrize("rig", ["acrobot with a sine", "pendulum"])
def test_predicted_standard_errors_are_right_within_1_5(rig):
    """Of friction and of base parameters; the scatter of 40 fits is itself known to 11 %."""
    design = on_acrobot() if rig.startswith("acrobot") else swinging()
    e, predicted, signal = design.experiment, design.monte_carlo, (design.torque, design.start)
    if "sine" in rig:
        signal = sine(e, 1.0)
        predicted = monte_carlo(e, predict_motions(e, *signal), 0)
    for inertia, found in zip((False, True), scatter(e, *signal), strict=True):
        ratio = found / predicted.errors(inertia=inertia)
        assert ((ratio > 1 / 1.5) & (ratio < 1.5)).all(), (inertia, ratio)


def test_the_information_that_is_searched_promises_what_repetitions_give():
    """Within 2, at a tenth of the cost: it knows of one bandwidth of the smoother only."""
    design = on_acrobot()
    e = design.experiment
    ratio = design.monte_carlo.errors(inertia=True) / standard_errors(
        expected_information(e, predict_motions(e, design.torque, design.start), 0)
    )
    assert ((ratio > 0.5) & (ratio < 2.0)).all(), ratio


@pytest.mark.parametrize(("rig", "frequency"), [("acrobot", 2.0), ("pendulum", 1.5)])
def test_friction_is_known_twice_as_well_as_from_a_plain_sine(rig, frequency):
    """With free inertia. Near a resonance of the acrobot the gain is smaller (see `advise`)."""
    design = on_acrobot() if rig == "acrobot" else swinging()
    e = design.experiment
    plain = monte_carlo(e, predict_motions(e, *sine(e, frequency)), 0).errors(inertia=True)
    count = e.friction.theta.size
    assert (design.monte_carlo.errors(inertia=True)[:count] <= 0.5 * plain[:count]).all()


def test_the_stiction_mask_is_that_of_a_fit():
    design = on_acrobot()
    motions = Concatenated.at_level(design.experiment, design.motions, 0)
    fitted = mask_stiction(motions.problem, design.experiment.velocity_threshold).G
    assert np.allclose(motions.projector @ motions.problem.G, fitted, atol=1e-9)
    assert motions.mask.any(0).all() and not motions.mask.all(0).any()


def test_a_slow_linear_axis_can_be_planned_too():
    """At up to 0.1 m/s; a threshold in rad/s would take all of that for rest."""
    machine = linear_axis()
    limits = limits_of("torque=60, velocity=0.1", machine)
    friction = prior_friction_of("coulomb=12, viscous=30", limits)
    plant = Plant.from_parameters(machine, {"mass": 20.0})
    e = Experiment(plant, friction, limits, length=3.0, recordings=1, angle_noise=2e-5)
    time = e.commands
    torque = (12 + 20 * 0.05 * 9) * np.sin(9 * time)[:, None, None]
    motions = predict_motions(e, torque, np.zeros((1, 1)))
    assert 0.01 < np.abs(motions.w).max() < 0.2
    error = standard_errors(expected_information(e, motions, 0))
    assert np.isfinite(error).all()
    assert (error < 0.5 * np.array([12.0, 30.0, 20.0])).all()


def test_without_noise_repetitions_differ_by_nothing():
    """What then remains is bias: what the smoother bends."""
    design = swinging()
    still = replace(design.experiment, angle_noise=1e-9)
    many = monte_carlo(still, design.motions, 0, draws=5)
    size = np.concatenate([still.friction.theta.ravel(), still.plant.p])
    assert (many.errors(inertia=True) < 1e-5 * size).all()
    assert (np.abs(many.bias(inertia=True)) < 0.02 * size).all()


def test_the_smoothers_gains_are_those_of_the_whole_recording():
    samples, dt, decade = 200, 1 / 60, 9.0
    noise = default_rng(0).normal(size=(samples, 3))
    series = Series(
        np.full((samples, 3), dt),
        noise,
        np.ones((samples, 3)),
        np.ones((samples, 3), dtype=bool),
        (),
    )
    whole = rts_smoother(series, np.full(3, 10.0**decade))
    angle, velocity = smoother_gains(samples, dt, decade)
    assert np.allclose(angle @ noise, whole[:, :, 0], atol=1e-6)
    assert np.allclose(velocity @ noise, whole[:, :, 1], atol=1e-4)


def test_derivatives_by_base_parameters_are_those_of_numeric_differences():
    design = on_acrobot()
    e = design.experiment
    q, w = design.motions.q[:, 0, 0], design.motions.w[:, 0, 0]
    held = Signal(e.commands, design.torque[:, 0], hold="previous")
    recording = Recording("one", Signal(e.images, q), held)
    one = Plant(
        e.plant.mechanism, {k: v[None] for k, v in e.plant.parameters.items()}, e.plant.p[None]
    )

    def residual(p):
        problem = one_step_problem(
            "integral", replace(one, p=p[None]), (recording,), (States(e.images, q, w),)
        )
        return problem, problem.residual(along(e.friction, problem.nodes))

    problem, left = residual(e.plant.p)
    for i in range(e.plant.p.size):
        step = 1e-6 * e.plant.p[i] * np.eye(e.plant.p.size)[i]
        change = (residual(e.plant.p + step)[1] - residual(e.plant.p - step)[1]) / (2 * step[i])
        # the fit sees de/dp where e = 0; here e is the error of Simpson's rule
        M = e.plant.mechanism.inertia(np.eye(e.plant.p.size)[i], q[1:])
        change += np.einsum("kij,kjl,kl->ki", problem.G / problem.dt[:, None, None], M, left)
        analytic = base_jacobian(e.plant, problem)[..., i]
        assert np.allclose(analytic, change, atol=1e-5 * np.abs(analytic).max())


# --- Limits -----------------------------------------------------------------------------------


def test_the_simulated_motion_keeps_the_limits():
    design = on_acrobot()
    limits = design.experiment.limits
    q, w = really(design.experiment, design.torque, design.start)
    assert (np.abs(design.torque) <= limits.torque).all()
    assert (np.abs(w) <= limits.velocity).all()
    assert (np.abs(q) <= limits.angle).all()
    assert np.abs(w).max() > 0.5 * limits.velocity.max()  # not by doing nothing


def test_a_tight_angle_limit_is_kept_by_weaker_signals():
    experiment = on_pendulum()
    tight = replace(experiment, limits=experiment.limits._replace(angle=np.array([0.4])))
    design = design_signals(tight, Search(pool=96, generations=1, children=16))
    q, _ = really(tight, design.torque, design.start)
    assert np.abs(q).max() <= 0.4
    assert "angle     joint 1" in described(design)


def test_impossible_limits_are_one_clear_line():
    experiment = on_pendulum(start=(2.5,))
    slow = replace(experiment, limits=experiment.limits._replace(velocity=np.array([0.1])))
    with assert_refused("none of 12 signals keeps the limits, velocity"):
        design_signals(slow, Search(pool=4, generations=0))


# --- Laws of the optimum ----------------------------------------------------------------------


def test_more_torque_never_hurts():
    """Every weaker signal is allowed as well: the best of all tells at least as much."""
    values, pool = [], None
    scale = np.array([0.001, 0.0001, 0.001, 0.01])
    x = default_rng(3).uniform(size=(64, 18))
    for torque in ("0.05", "0.1", "0.2", "0.4"):
        more = simulated(on_pendulum(torque), x, 0)
        assert more is not None
        pool = more if pool is None else pool.joined(more)
        values.append(exchange(pool.information, scale, 2)[1])
    assert np.all(np.diff(values) >= 0)
    assert values[-1] > 1.2 * values[0]
    twice = Information(*(2 * sums for sums in pool.information))
    assert np.allclose(e_criterion(twice, scale), 2 * e_criterion(pool.information, scale))


def test_mirrored_signals_tell_the_same():
    # the draw of noise is not mirrored; at 1e-3 rad it finds the same bandwidths for both
    experiment = on_pendulum(angle_noise=1e-3)
    x = default_rng(1).uniform(size=(6, experiment.size))
    torque, start = experiment.torque_of(x), experiment.start_of(x)
    there, back = (predict_motions(experiment, s * torque, s * start) for s in (1, -1))
    assert np.allclose(there.q, -back.q, atol=1e-9)
    sides = [covariances(expected_information(experiment, m, 0)) for m in (there, back)]
    variances = [np.diagonal(side, axis1=-2, axis2=-1) for side in sides]
    assert np.allclose(*variances, rtol=1e-3)


def test_a_machine_that_does_not_move_tells_nothing():
    experiment = on_pendulum()
    still = Motions(np.zeros((181, 1, 1, 1)), np.zeros((181, 1, 1, 1)), np.zeros((180, 1, 1)))
    sums = expected_information(experiment, still, 0)
    assert np.isinf(np.diagonal(covariances(sums)[0, 0])).all()
    assert e_criterion(sums, np.ones(4)) == 0.0


def test_refinement_never_loses_and_the_same_seed_gives_the_same_signal():
    search = Search(pool=12, generations=2, children=6, seed=5)
    experiment = on_pendulum(length=1.5)
    once, again = (design_signals(experiment, search) for _ in range(2))
    assert np.all(np.diff(once.values) >= 0)
    assert command_frame(once, 1).equals(command_frame(again, 1))
    assert described(once) == described(again)
    other = design_signals(experiment, replace(search, generations=0, seed=6))
    assert not command_frame(once, 0).equals(command_frame(other, 0))


def test_half_of_the_signals_are_chirps_and_all_reach_the_limit():
    experiment = on_pendulum()
    x = default_rng(0).uniform(size=(8, experiment.size))
    x[:, 0], x[:, 1] = np.linspace(0.0, 1.0, 8), 0.4
    assert experiment.family_of(x) == [["multisine"]] * 4 + [["chirp"]] * 4
    assert np.all(np.abs(experiment.torque_of(x)).max(axis=(0, 2)) == 0.3)


# --- Files -----------------------------------------------------------------------


def test_the_table_can_be_played_and_the_picture_is_one():
    design = on_acrobot()
    header, *rows = csv_of(command_frame(design, 0)).splitlines()
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    assert header == "time,u2"
    assert np.allclose(table[:, 0], design.experiment.commands)
    assert np.array_equal(table[:, 1], design.torque[:, 0, 1])
    assert table[-1, 1] == 0.0
    assert png(lambda: design_figure(design)).startswith(b"\x89PNG")
