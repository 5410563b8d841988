"""Friction that varies with the angle."""

import numpy as np
import pytest
from fixtures.exact_problems import BY_DIRECTION, COULOMB, STRIBECK, WAVES, explained_by, fit_to_all
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose

from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction import Inputs
from frictionid.friction.laws import CoulombViscous, Ripple, Stribeck

THETA = {CoulombViscous(): COULOMB, Stribeck(symmetric=False): BY_DIRECTION}
EVERY = pytest.mark.parametrize("base", THETA, ids=str)


def rippled(base, waves=WAVES):
    return np.concatenate([THETA[base], waves], axis=-1)


def drawn(seed=0):
    q, w, u = np.random.default_rng(seed).normal(size=(3, 80, 2))
    return Inputs(3 * q, 3 * w, u, 0 * u)


@EVERY
def test_the_level_varies_and_viscous_friction_does_not(base):
    law, x, theta = Ripple(base, (1, 2), 1.0), drawn(), rippled(base)
    height = 1 + sum(
        theta[:, -4 + i] * wave
        for i, wave in enumerate(f(k * x.q) for k in (1, 2) for f in (np.cos, np.sin))
    )
    level = np.array(THETA[base])
    viscous = level[:, -1] * x.w
    plain = base.torque(level, x, ())
    assert_allclose(law.torque(theta, x, ()), height * (plain - viscous) + viscous)


@EVERY
def test_it_repeats_with_each_turn_behind_the_gear_and_not_before(base):
    law, x, theta = Ripple(base, (1, 2), 7.5), drawn(), rippled(base)

    def torque(turns):
        return law.torque(theta, x._replace(q=x.q + turns * 2 * np.pi), ())

    assert_allclose(torque(1 / 7.5), torque(0.0), rtol=1e-9)
    assert np.abs(torque(0.5 / 7.5) - torque(0.0)).max() > 0.01


@EVERY
def test_it_never_drives_however_large_its_amplitudes(base):
    law, x, rng = Ripple(base, (1, 2)), drawn(), np.random.default_rng(1)
    low, high = np.transpose(law.bounds)[:, -4:]
    for _ in range(50):
        corner = np.where(rng.random((2, 4)) < 0.5, low, high)
        assert (law.torque(rippled(base, corner), x, ()) * x.w >= -1e-12).all()
        assert (law.limit(rippled(base, corner), x, ()) >= -1e-12).all()


def test_a_law_without_ripple_misses_it_and_one_with_it_finds_none_where_there_is_none():
    law = Ripple("stribeck")
    problem = explained_by(Stribeck(), STRIBECK)
    found = fit_to_all(LeastSquares(law), problem).theta[0]
    assert_allclose(found[:, -2:], 0.0, atol=1e-6)
    assert_allclose(found[:, :-2], STRIBECK, rtol=1e-5)


WRONG = r"""
base = "coulomb" => Ripple: base: it should be 'coulomb_viscous'.*, not 'coulomb'
harmonics = [] => harmonics: .*at least 1 item
harmonics = [1, 1] => harmonics = \[1, 1\] must differ
harmonics = [0, 1] => harmonics\[0\]: it should be greater than or equal to 1
harmonics = [0.5] => harmonics\[0\]: it should be a valid integer
gear = 0.0 => gear: it should be greater than 0, not 0.0
"""


@mistakes(WRONG)
def test_settings_that_mean_nothing_are_refused(wrong, words):
    with assert_refused(words):
        Ripple(**changes(wrong))
