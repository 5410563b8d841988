"""Coulomb and viscous friction nearest to a model, and what it costs on recorded motion."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.signals import taken
from frictionid.deploy.export.exported import exported
from frictionid.deploy.export.nearest import (
    break_away,
    cost_of,
    cost_sentence,
    differs,
    lost_by,
    nearest,
)
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, MotorLoad, Quadratic, Stribeck


def shortened(data, count):
    """The first samples of the first recording."""
    run = data.recordings[0]
    angle, torque = (taken(s, range(count)) for s in (run.angle, run.torque))
    return replace(data, recordings=(replace(run, angle=angle, torque=torque, truth=None),))


@shared
def data():
    """Two seconds of one recording."""
    return replace(shortened(load_dataset("acrobot_clean"), 120), truth=None)


def test_a_law_without_its_own_terms_is_found_as_it_is():
    model = Friction(Stribeck(), [[0.1, 0.0, 0.5, 0.02]])
    own = exported(model, speeds=(7.0,))
    assert_allclose(nearest(own).theta, [[0.1, 0.02]], atol=1e-12)
    assert not differs(own, nearest(own))


def test_levels_of_two_directions_give_their_mean():
    model = Friction(CoulombViscous(symmetric=False), [[0.1, 0.3, 0.02]])
    assert_allclose(nearest(exported(model, speeds=(7.0,))).theta, [[0.2, 0.02]])
    assert_allclose(break_away(model), [0.2])


def test_the_level_of_an_arctangent_is_kept_as_the_level():
    model = Friction(CoulombViscous(width=0.01, shape="arctan"), [[0.1, 0.02]])
    own = exported(model, speeds=(7.0,))
    assert_array_equal(nearest(own).theta, model.theta)
    assert differs(own, nearest(own))


def test_a_law_that_follows_the_motor_says_that_it_is_taken_without():
    theta = np.array([[0.1, 0.02, 0.3]])
    for law, said in ((MotorLoad(), True), (Quadratic(), False)):
        own = exported(Friction(law, theta), speeds=(7.0,))
        (first, *_) = lost_by(own, nearest(own), "URDF", "friction and damping")
        assert ("at zero of the motor torque" in first) == said


@pytest.mark.parametrize("name, fitted", [("xl330", True), ("mx64_m6", False)])
def test_least_squares_are_said_where_there_were_some(name, fitted, tmp_path):
    done = fid.export(f"machine:{name}", "isaac", tmp_path / "it.py")
    assert any("least squares" in sentence for sentence in done.lost) == fitted
    assert fid.machine(name).nearest.cost in done.lost
    table = fid.export(f"machine:{name}", "yaml", tmp_path / "it.yaml")
    assert fid.machine(name).nearest.cost not in table.lost  # of another friction


def test_no_numbers_without_speeds():
    model = Friction(Quadratic(), [[0.1, 0.0, 0.01]])
    with assert_refused("name the data set"):
        nearest(exported(model))


def test_a_torque_that_is_not_finite_is_one_line():
    model = Friction(Quadratic(), [[0.1, 0.0, 0.01], [0.1, 0.0, 1e308]])
    with assert_refused("torque of joint 2 is not finite at a velocity of -30"):
        nearest(exported(model, speeds=(30.0, 30.0)))
    with assert_refused("parameters are not finite"):
        exported(replace(model, theta=np.full((2, 3), np.nan)))


def test_recorded_motion_weighs_speeds(data):
    """Of a square law, the line through slow motion is flatter than through all speeds alike."""
    model = Friction(Quadratic(), [[0.1, 0.0, 0.01]] * 2)
    own = exported(model, data=data, speeds=(30.0, 30.0))
    alike = exported(model, speeds=(30.0, 30.0))
    assert (nearest(own).theta[:, 1] < nearest(alike).theta[:, 1]).all()


def test_the_cost_is_the_difference_on_the_datas_motion(data):
    theta = np.array([[0.1, 0.02], [0.05, 0.01]])
    own = exported(Friction(CoulombViscous(), theta), data=data)
    same = cost_of(own, own.friction)
    assert same.torque == (0.0, 0.0) and same.apart == 0.0 and same.model == same.held
    w = own.prepared.integral.nodes.inputs.w
    more = cost_of(own, replace(own.friction, theta=theta + [[0.0, 0.01], [0.0, 0.0]]))
    assert more.torque[0] == pytest.approx(0.01 * np.sqrt((w[:, 0] ** 2).mean()), rel=1e-9)
    assert more.torque[1] == 0.0 and more.apart > 0.0 and more.held != more.model
    assert f"{more.apart:.3g} from these" in cost_sentence(own, more)


def test_short_recordings_show_the_cost_over_half_of_them(data):
    own = exported(Friction(CoulombViscous(), np.zeros((2, 2))), data=shortened(data, 80))
    assert own.horizon == 0.7  # of 1.3 s
    assert cost_of(own, own.friction).predictions > 0
