"""Harmonics of cogging and ripple by evidence: those of the truth, none where there are none.

Motion is of a simulated servo, by an integrator and a friction of its own.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from drive_logs import ServoPendulum
from fixtures.servo_logs import by_torque
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.plants import plant_of
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.harmonics import harmonics, with_harmonics
from frictionid.fitting.one_step.formulation import INTEGRAL, training_problem
from frictionid.friction import present
from frictionid.friction.laws import Cogging, CoulombViscous, Ripple, Sum

WAVES = ((6, 0.02, 0.6), (12, 0.01, -1.2))
LAW = Sum(("coulomb_viscous", Cogging("auto")))


@cache
def dataset(waves=(), seed=0, gear=1, **rig):
    own = ServoPendulum(waves=tuple((gear * k, size, phase) for k, size, phase in waves), **rig)
    logs = {f"{k}": own.log(20.0, 0.2, seed=100 * seed + k, seconds=6.0) for k in range(4)}
    return by_torque(own, logs)


def chosen(data, law):
    problem = training_problem(data, plant_of(data), INTEGRAL)
    has = harmonics(law, problem, np.ones((1, len(problem.r))))[0, 0]
    return tuple(np.array(law.orders)[has].tolist())


def wave(friction, k):
    """Amplitude and phase of a harmonic."""
    values = dict(zip(friction.law.names, friction.theta[0], strict=True))
    cos, sin = values[f"cos_{k}"], values[f"sin_{k}"]
    return np.hypot(cos, sin), np.arctan2(-sin, cos)


@pytest.mark.parametrize("seed", range(4))
def test_those_of_the_truth_are_chosen(seed):
    assert chosen(dataset(WAVES, seed), Cogging("auto")) == (6, 12)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "law", [Cogging("auto"), Ripple(harmonics="auto")], ids=["cogging", "ripple"]
)
def test_none_is_chosen_where_there_is_none(law, seed):
    assert chosen(dataset((), seed), law) == ()


def test_behind_a_gear_they_are_those_of_the_motor():
    data = dataset(((7, 0.01, 0.3),), gear=9)
    assert chosen(data, Cogging("auto", gear=9.0)) == (7,)


@pytest.mark.parametrize("method", ["one_step", "shooting"])
def test_amplitude_and_phase_are_within_5_percent(method):
    friction = fid.fit(dataset(WAVES), LAW, method=method).friction
    assert friction.law == with_harmonics(LAW, (6, 12))
    for k, size, phase in WAVES:
        assert wave(friction, k) == pytest.approx((size, phase), rel=0.05)


def test_a_law_without_any_is_the_law_below():
    friction = fid.fit(dataset(), LAW, method="one_step").friction
    assert friction.law == CoulombViscous()
    friction = fid.fit(
        dataset(), "ripple", settings={"harmonics": "auto"}, method="one_step"
    ).friction
    assert friction.law == CoulombViscous()


def test_each_fold_chooses_by_its_own_rows():
    waved, plain = dataset(WAVES), dataset()
    others = (replace(r, name=f"plain {r.name}") for r in plain.recordings)
    both = replace(waved, recordings=(*waved.recordings, *others))
    problem = training_problem(both, plant_of(both), INTEGRAL)
    first = problem.recording < len(waved.recordings)
    fit = LeastSquares(LAW).fit(problem, np.stack([first, ~first]) + 0.0, 0)
    assert fit.law == with_harmonics(LAW, (6, 12))
    assert fit.theta[0].all() and not fit.theta[1, 0, 2:].any()
    alone = LeastSquares(CoulombViscous()).fit(problem, (~first)[None] + 0.0, 0)
    assert_allclose(fit.theta[1, 0, :2], alone.theta[0, 0], rtol=1e-6)


def test_other_joints_keep_to_what_they_show():
    """Terms that friction does not have are neither printed nor freed nor counted."""
    law = with_harmonics(LAW, (6, 12))
    theta = np.array([[0.1, 0.02, 0.03, 0.01, 0.0, 0.0], [0.1, 0.02, 0.0, 0.0, 0.0, 0.0]])
    assert present(law, theta).sum(axis=1).tolist() == [4, 2]
    lines = str(fid.Friction(law, theta)).splitlines()
    assert "cos_6" in lines[1] and "cos_12" not in lines[1] and "cos" not in lines[2]


@pytest.mark.parametrize("harmonics", ["all", "AUTO"])
def test_other_words_are_one_clear_line(harmonics):
    with pytest.raises(fid.InputError, match="harmonics"):
        Ripple(harmonics=harmonics)
