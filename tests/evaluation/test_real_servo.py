"""Whole logs of a real servo: the published models as their authors judge them, and ours."""

import json

import numpy as np
import pytest
from fixtures.bam_formula import bam_friction
from fixtures.shared import shared
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.state_estimators import KalmanFilter
from frictionid.evaluation import (
    Split,
    free_run,
    free_run_scores,
    make_folds,
    make_trajectory,
    trajectory_folds,
    with_motor_torque,
)
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, training_problem
from frictionid.friction.laws import MotorLoad
from frictionid.friction.model_files import load_model

pytestmark = pytest.mark.real

MODELS = ("m1", "m6")
# names of the published parameters, in the order of the laws' own
PUBLISHED = {
    "m1": ("friction_base", "friction_viscous"),
    "m6": (
        *("friction_base", "friction_viscous", "load_friction_motor", "load_friction_external"),
        *("friction_stribeck", "load_friction_motor_stribeck", "load_friction_external_stribeck"),
        *("load_friction_motor_quad", "load_friction_external_quad", "dtheta_stribeck", "alpha"),
    ),
}


@shared
def logs(request, real_data):
    path = request.config.rootpath / "data/bam_xl330_whole"
    return load_dataset(path, real_data / "bam_xl330")


@shared
def models(request):
    folder = request.config.rootpath / "data/bam_xl330"
    return {name: load_model(folder / f"{name}.json") for name in MODELS}


@shared
def runs(logs, models):
    """Angles of each published model's free runs, and their trajectory."""
    found = {}
    for name, friction in models.items():
        plant = plant_of(logs, friction.parameters)
        trajectory = trajectory_of(with_motor_torque(logs, plant))
        found[name] = free_run(plant, friction, trajectory), trajectory
    return found


def trajectory_of(data):
    return make_trajectory(data, KalmanFilter()([r.angle for r in data.recordings]))


def errors(q, trajectory):
    """Mean error of each recording, (R,) [rad]."""
    return np.nanmean(np.abs(q - trajectory.measured)[..., 0], axis=0)


def mean(q, trajectory, fold):
    rows = free_run_scores(q, trajectory, fold, ("rad",))
    return next(r.value for r in rows if (r.fold, r.statistic) == ("all", "mean"))


@pytest.mark.parametrize("name", MODELS)
def test_the_models_have_the_published_numbers(name, models, real_data, logs):
    file = real_data / "bam_xl330/published_parameters" / f"{name}.json"
    published, friction = json.loads(file.read_text()), models[name]
    assert_array_equal(friction.theta[0], [published[key] for key in PUBLISHED[name]])
    own = {key: friction.parameters[key] for key in ("kt", "R", "rotor")}
    assert own == {"kt": published["kt"], "R": published["R"], "rotor": published["armature"]}
    if name == "m6":  # what loads the gear is what the mechanism says
        gravity = plant_of(logs, friction.parameters).p[:, 1]
        assert_allclose(friction.law.moment, gravity, rtol=1e-9)


def as_published(published, log):
    """Mean error of a log by the published scheme, in steps ten times finer than a sample.

    tau_stop brings the joint to rest within the step; friction is that much, or its limit.
    """
    mass, length, servo = log.parameters["mass"], log.parameters["length"], log.servo
    time, q = log.angle.time, log.angle.value[:, 0]
    inertia, kt, R = mass * length**2 + published["armature"], published["kt"], published["R"]
    x, w, out = q[0], 0.0, [q[0]]
    goals = servo.goal.value[:, 0]
    enabled = servo.enabled.value[:, 0]
    for k in range(len(time) - 1):
        h = (time[k + 1] - time[k]) / 10
        for part in range(10):
            goal = goals[k] + part / 10 * (goals[k + 1] - goals[k])
            volts = servo.supply * min(max(servo.gain * (goal - x), -1.0), 1.0)
            u = enabled[k] * kt * (volts - kt * w) / R
            te = -mass * 9.80665 * length * np.sin(x)
            total = inertia / h * w + u + te
            w = (
                (total - np.sign(total) * min(abs(total), bam_friction(published, u, te, w)))
                * h
                / inertia
            )
            x += w * h
        out.append(x)
    return np.mean(np.abs(out - q))


@pytest.mark.parametrize("name", MODELS)
def test_free_runs_err_as_by_the_published_scheme(name, runs, real_data, logs):
    """Two simulators, one answer: ours holds joints at rest, theirs clips the stopping torque."""
    file = real_data / "bam_xl330/published_parameters" / f"{name}.json"
    published = json.loads(file.read_text())
    own = errors(*runs[name])
    theirs = np.array([as_published(published, r) for r in logs.recordings])
    assert_allclose(own, theirs, rtol=0.1, atol=2e-3)
    assert own.mean() == pytest.approx(theirs.mean(), rel=0.03)


def test_friction_fitted_elsewhere_errs_less_than_both_published_models(runs, logs):
    """Three numbers by least squares, on logs left out, with M1's motor: below M1, and below M6."""
    folds = make_folds(logs.recordings, Split(count=4))
    plant = plant_of(logs)
    problem = training_problem(logs, plant, INTEGRAL)
    weights = folds.training(problem.recording, problem.time, problem.dt)
    fitted = LeastSquares(MotorLoad()).fit(problem, weights, 0)
    trajectory = trajectory_of(logs)
    held = trajectory_folds(trajectory, folds)
    own = mean(free_run(plant, fitted[held], trajectory), trajectory, held)
    assert all(own < 0.9 * mean(*run, held) for run in runs.values())
