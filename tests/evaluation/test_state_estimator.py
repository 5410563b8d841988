"""Start states that a model finds itself: right for the right model, blind to what comes later."""

from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
import pytest
from fixtures.changed_data import one_changed
from fixtures.driven_pendulum import LEVEL, VISCOUS, driven_pendulum
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.evaluation import Protocol, prepare
from frictionid.evaluation.initial_states import estimate_initial_states
from frictionid.friction import Friction, Law
from frictionid.friction.law import smooth_sign
from frictionid.friction.laws import CoulombViscous, FilmLag, Stribeck

TRUE = Friction(CoulombViscous(), [[LEVEL, VISCOUS]])
data = cache(partial(driven_pendulum, 150, 3, seed=3))


def ready(dataset):
    return prepare(dataset, Protocol(horizons=(0.5,), initial_states="model"))


def states(prepared, friction=TRUE):
    starts = prepared.initial_states
    each = friction[None][np.zeros(len(starts.index), int)]
    return estimate_initial_states(
        prepared.plant[starts.recording], each, prepared.preceding, starts
    )


@cache
def estimated():
    """Prepared data, and the states that the true model estimates of it."""
    prepared = ready(data())
    return prepared, states(prepared)


def errors(dataset, prepared, w):
    starts = prepared.initial_states
    pairs = zip(starts.recording, starts.index, strict=True)
    true = np.stack([dataset.recordings[r].truth.velocity.value[k] for r, k in pairs])
    return np.abs(w - true)


def test_the_true_model_knows_velocities_ten_times_better_than_a_filter():
    prepared, state = estimated()
    own = errors(data(), prepared, state.w)
    filtered = errors(data(), prepared, prepared.initial_states.w)
    assert np.median(own) < 0.1 * np.median(filtered)
    assert np.median(own) < 0.01


@pytest.mark.parametrize("rate", [60.0, 10.0])
def test_without_noise_the_true_model_finds_the_true_state(rate):
    dataset = data(noise=0.0, frames=rate)
    prepared = ready(dataset)
    assert np.median(errors(dataset, prepared, states(prepared).w)) < 2e-3


def test_what_comes_later_changes_nothing():
    dataset = data()
    prepared, before = estimated()
    at, angle = 90, dataset.recordings[1].angle.value[:, 0]
    rows = slice(at + 1, None)
    later = one_changed(dataset, "angle", 1, 0, rows, angle[rows] + 0.3)
    changed = ready(one_changed(later, "torque", 1, 0, rows, -0.2))
    early = (prepared.initial_states.recording == 1) & (prepared.initial_states.index <= at)
    assert early.sum() > 3
    after = states(changed)
    assert_allclose(before.w[early], after.w[early], atol=2e-3)
    assert_allclose(before.q[early], after.q[early], atol=2e-4)


def test_starts_side_by_side_are_each_alone():
    prepared, _ = estimated()
    starts = prepared.initial_states
    theta = np.stack([TRUE.theta * (1 + 0.2 * (s % 2)) for s in range(len(starts.index))])
    plant = prepared.plant[starts.recording]
    together = estimate_initial_states(
        plant, Friction(CoulombViscous(), theta), prepared.preceding, starts
    )
    for factor in (0, 1):
        alone = states(prepared, replace(TRUE, theta=TRUE.theta * (1 + 0.2 * factor)))
        own = np.arange(len(starts.index)) % 2 == factor
        assert_allclose(together.w[own], alone.w[own], atol=1e-9)


@dataclass(frozen=True)
class SampledViscous(Law):
    """Coulomb friction, and viscous friction of the velocity at the newest sample."""

    names = ("coulomb", "viscous")
    units = ("N m", "N m s/rad")
    bounds = ((0.0, 1.0), (0.0, 1.0))
    sample_time = 1 / 60
    width: float = 0.02

    def start(self, theta, x):
        return (x.w + 0.0 * theta[..., 0],)

    def torque(self, theta, x, memory):
        return theta[..., 0] * smooth_sign(x.w, self.width, "tanh") + theta[..., 1] * memory[0]

    def advance(self, theta, x, memory, dt):
        return (x.w + 0.0 * memory[0],)

    def limit(self, theta, x, memory):
        return theta[..., 0] + 0.0 * x.w


@pytest.mark.parametrize("drag", [0.002, 0.02])
def test_a_memory_of_samples_is_that_of_the_motion_found(drag):
    prepared, _ = estimated()
    starts = prepared.initial_states
    state = states(prepared, Friction(SampledViscous(), [[0.02, drag]]))
    own = np.abs(state.w - starts.w).max(axis=-1) > 0.0  # the others are the filter's
    assert own.mean() > 0.9
    assert_array_equal(state.memory[0][own], state.w[own])


@pytest.mark.parametrize(
    ("law", "theta"),
    [
        (Stribeck(symmetric=False), [[0.02, 0.02, 0.0, 0.0, 1.0, 0.002]]),
        (FilmLag(), [[0.02, 0.0, 1.0, 0.002, 0.01]]),
    ],
)
def test_any_law_finds_its_start(law, theta):
    prepared, _ = estimated()
    state = states(prepared, Friction(law, np.array(theta)))
    assert all(np.isfinite(z).all() and z.shape == state.w.shape for z in state.memory)
    assert np.median(errors(data(), prepared, state.w)) < 0.02
