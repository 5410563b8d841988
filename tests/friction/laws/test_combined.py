"""Laws made of others: one for each joint as the laws alone, sums with each term once."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose

from frictionid.comparison.fit_model import fit_model
from frictionid.comparison.suite import identifier_named
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.shooting import Settings, Shooting
from frictionid.friction import Friction, Inputs
from frictionid.friction.laws import (
    CoulombViscous,
    LoadDependent,
    MotorLoad,
    PerJoint,
    Quadratic,
    Stribeck,
    Sum,
)
from frictionid.friction.laws.combined import PARTS, part_of
from frictionid.friction.model_files import load_model, save_model
from frictionid.simulate import Camera, Curve, Multisine, Rig, Run, simulate
from frictionid.simulate import Stribeck as TrueStribeck

MIXED = PerJoint(("stribeck", "coulomb_viscous"))
TRUE = Curve((0.12, 0.05), (0.12, 0.05), (0.02, 0.01), (0.05, 0.0), (0.05, 0.0), (0.8, 1.0))


@pytest.mark.parametrize(
    ("first", "second"), [*((name, "dahl") for name in PARTS), ("coulomb_viscous", "stribeck")]
)
def test_it_is_the_laws_side_by_side(first, second):
    """Torque, limit, memory and gradient of each joint are those of its law alone."""
    rng = default_rng(3)
    x = Inputs(*rng.normal(size=(4, 50, 2)))
    law, dt = PerJoint((first, second)), np.full((50, 1), 0.01)
    theta = np.zeros((2, len(law.names)))
    has = law.has_parameters(2)
    theta[has] = rng.uniform(0.1, 1.0, has.sum())
    memory = law.advance(theta, x, law.start(theta, x), dt)
    for j, alone in enumerate(part_of(name, "per_joint") for name in (first, second)):
        one = x.each(lambda entry, j=j: entry[..., j : j + 1])
        places = [law.names.index(name) for name in alone.names]
        own = theta[j : j + 1][:, places]
        state = alone.advance(own, one, alone.start(own, one), dt)
        for method in ("torque", "limit"):
            both = getattr(law, method)(theta, x, memory)[:, j]
            assert both == pytest.approx(getattr(alone, method)(own, one, state)[:, 0])
        if law.has_gradient and alone.names:
            both = law.gradient(theta, x)[:, j]
            own_columns = np.broadcast_to(alone.gradient(own, one)[:, 0], (50, len(alone.names)))
            assert both[:, places] == pytest.approx(own_columns)
            assert not both[:, ~has[j]].any()


def data():
    links = {"m1": 0.6, "m2": 0.5, "l1": 0.25, "r1": 0.12, "r2": 0.13, "I1": 0.013, "I2": 0.012}
    rig = Rig(
        "two",
        {"kind": "double_pendulum", "parameters": links},
        TrueStribeck(TRUE),
        Camera(samples=240, rate=120.0, angle_noise=5e-4),
        tuple(
            Run(
                f"{k}",
                (0.4 * k - 0.8, 0.3 * k),
                torques=(Multisine(1.0, (0.4, 0.9 + 0.1 * k)), Multisine(0.4, (0.5, 1.3))),
            )
            for k in range(4)
        ),
        substeps=4,
    )
    return simulate(rig, 2)


@pytest.fixture(scope="module")
def two_joints():
    return data()


def test_fits_find_each_joint_s_own(two_joints, tmp_path):
    """By one step and by shooting; the second joint has no peak, and none is counted."""
    for method in ({}, {"recipe": Shooting(settings=Settings(windows=(0.1, 0.2)))}):
        friction = fit_model(two_joints, LeastSquares(MIXED), **method)
        coulomb, peak, velocity, viscous = friction.theta.T
        assert coulomb == pytest.approx([0.12, 0.05], rel=0.1)
        assert viscous == pytest.approx([0.02, 0.01], rel=0.2)
        assert peak[0] == pytest.approx(0.05, rel=0.4)
        assert (peak[1], velocity[1]) == (0.0, 0.0)
    names = [e.name for e in friction.provenance.refined.parameters]
    assert sum("peak" in name for name in names) == 1
    assert "peak" not in str(friction).splitlines()[2]
    save_model(friction, tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    assert again.law == MIXED
    assert again.theta == pytest.approx(friction.theta)


def test_a_joint_may_have_no_friction(two_joints):
    friction = fit_model(two_joints, LeastSquares(PerJoint(("stribeck", "none"))))
    assert friction.theta[0].any()
    assert not friction.theta[1].any()


def test_as_many_laws_as_joints(two_joints):
    with assert_refused("3 laws for 2 joints"):
        fit_model(two_joints, LeastSquares(PerJoint(("stribeck",) * 3)))
    with assert_refused("laws"):
        PerJoint(("stribek",))
    assert identifier_named("per_joint", {"laws": ["none", "stribeck"]}) == LeastSquares(
        PerJoint(("none", "stribeck"))
    )


def test_smoothing_reaches_the_parts():
    assert MIXED.sharpened().parts == (Stribeck().sharpened(), CoulombViscous().sharpened())
    friction = Friction(MIXED, [[0.1, 0.05, 1.0, 0.01], [0.1, 0.0, 0.0, 0.01]])
    wide = replace(friction, law=MIXED.with_width(0.5)).torque(Inputs(*np.full((4, 1, 2), 0.1)))
    assert (np.abs(wide) < 0.5 * np.abs(friction.torque(Inputs(*np.full((4, 1, 2), 0.1))))).all()


X = Inputs(*default_rng(0).normal(size=(4, 60, 2)))._replace(
    load=default_rng(1).uniform(1.0, 5.0, (60, 2))
)


def torque(law, *theta):
    return law.torque(np.array([theta, theta]), X, ())


def test_a_sum_is_the_sum_of_its_laws_with_each_term_once():
    both = torque(Sum(), 0.1, 0.05, 1.5, 0.02, 0.3)
    apart = torque(Stribeck(), 0.1, 0.05, 1.5, 0.02) + torque(MotorLoad(), 0.0, 0.0, 0.3)
    assert_allclose(both, apart, rtol=1e-13)


def test_levels_by_direction_stand_for_a_level_of_both():
    law = Sum((Stribeck(symmetric=False), "motor_load"))
    assert "coulomb" not in law.names and law.names[-1] == "loss"
    both = torque(law, 0.1, 0.2, 0.05, 0.03, 1.5, 0.02, 0.3)
    own = torque(Stribeck(symmetric=False), 0.1, 0.2, 0.05, 0.03, 1.5, 0.02)
    assert_allclose(both, own + torque(MotorLoad(), 0.0, 0.0, 0.3), rtol=1e-13)


def test_of_laws_that_hold_each_other_the_larger_one_is_the_sum():
    for laws, whole in (
        (("stribeck", LoadDependent(stribeck=True)), LoadDependent(stribeck=True)),
        (("motor_load", MotorLoad(squared=True)), MotorLoad(squared=True)),
        (("coulomb_viscous", "quadratic"), Quadratic()),
    ):
        law = Sum(laws)
        numbers = dict(zip(whole.names, np.linspace(0.1, 0.9, len(whole.names)), strict=True))
        both = torque(law, *(numbers[name] for name in law.names))
        assert_allclose(both, torque(whole, *numbers.values()), rtol=1e-13)


NO_SUM = """
laws = ["dahl", "stribeck"] => 'dahl' has a memory
laws = ["stribeck", "coulomb_viscous"] => 'coulomb_viscous' adds nothing to the laws before it
laws = ["none", "stribeck"] => 'none' adds nothing
laws = ["stribeck"] => at least 2 items
"""


@mistakes(NO_SUM)
def test_what_is_no_sum_is_refused(wrong, words):
    with assert_refused(words):
        Sum(**changes(wrong))
