"""Steps of shooting: each is heard once; one that the physics cannot follow is shortened."""

import numpy as np
import pytest
from fixtures.tiny_pendulums import PENDULUM, dataset
from fixtures.true_curves import plain_friction
from numpy.testing import assert_array_equal

from frictionid.errors import NoFitError
from frictionid.fitting.parameters import FrictionBlock
from frictionid.fitting.shooting import Settings, gauss_newton, refine
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.progress import listening
from frictionid.simulate import Camera, Rig, Run, simulate

START = Friction(CoulombViscous(), np.array([[0.02, 0.002]]))


def test_every_iteration_is_heard_once():
    heard, settings = [], Settings(iterations=6)
    with listening(lambda *said: heard.append(said)):
        result = refine(START, dataset(), (FrictionBlock(),), settings)
    assert len(heard) == result.diagnostics.iterations
    begins = [k for k, (_, left) in enumerate(heard) if k == 0 or left >= heard[k - 1][1]]
    assert len(begins) == len(settings.windows) + 1  # the last length twice, coarse and fine
    for first, end in zip(begins, [*begins[1:], len(heard)], strict=True):
        left = [left for _, left in heard[first:end]]
        assert left == list(range(left[0], left[0] - len(left), -1)) and left[-1] >= 0
    unheard = refine(START, dataset(), (FrictionBlock(),), settings)
    assert_array_equal(unheard.friction.theta, result.friction.theta)


def steep_at(calls, monkeypatch):
    """Let the physics step refuse some of the linearisations, by their numbers."""
    count, linearised_at = [0], gauss_newton.linearised_at

    def refusing(*arguments):
        count[0] += 1
        if count[0] in calls:
            raise NoFitError("too steep")
        return linearised_at(*arguments)

    monkeypatch.setattr(gauss_newton, "linearised_at", refusing)


def test_steps_into_friction_too_steep_are_taken_back_and_the_fit_ends_where_it_would(monkeypatch):
    free = refine(START, dataset(), (FrictionBlock(),), Settings())
    steep_at({2, 3}, monkeypatch)
    damped = refine(START, dataset(), (FrictionBlock(),), Settings())
    off = np.abs(damped.covariance.values - free.covariance.values) / free.covariance.error
    assert free.diagnostics.settled and damped.diagnostics.settled
    assert off.max() < 0.1


def test_a_start_too_steep_and_steps_that_no_damping_helps_are_refused(monkeypatch):
    for calls in ({1}, set(range(2, 40))):
        with monkeypatch.context() as patch, pytest.raises(NoFitError, match="steep"):
            steep_at(calls, patch)
            refine(START, dataset(), (FrictionBlock(),), Settings())


def test_an_encoder_that_rests_most_of_the_time_does_not_make_its_steps_the_noise():
    """At rest nothing is left over, and the usual residual is none: rounding stays."""
    machine = {"kind": "pendulum", "driven": False, "parameters": PENDULUM["parameters"]}
    runs = tuple(Run(f"{k}", (0.4 + 0.1 * k,)) for k in range(3))
    camera = Camera(1000, 100.0, 0.0, resolution=2e-3)  # at rest after 0.9 s
    rig = Rig("p", machine, plain_friction(0.05, 0.004), camera, runs, substeps=8)
    fit = refine(START, simulate(rig), (FrictionBlock(),))
    assert (fit.covariance.error < [0.001, 0.0005]).all()
    assert (np.abs(fit.friction.theta[0] - [0.05, 0.004]) < [0.0005, 0.0002]).all()
