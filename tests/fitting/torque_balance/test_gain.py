"""Motor currents with an unknown constant: gains that gravity or a payload pins, and others."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.changed_data import changed
from fixtures.refusals import assert_refused
from fixtures.sines import sines, torque_without_friction

from frictionid.comparison.fit_model import fit_model
from frictionid.comparison.suite_recipes import blocks_of
from frictionid.data.recordings import Dataset
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.parameters import FrictionBlock, GainBlock, InertiaBlock
from frictionid.fitting.torque_balance import InverseDynamics
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import urdf

GAINS = np.array([1.3, 0.8, 1.15])
FRICTION = np.stack([wrist.COULOMB, wrist.VISCOUS], axis=-1)[:3]


def logged(data, gains=GAINS):
    """The data set as logged by motors whose constants are taken to be smaller by these gains."""
    return changed(data, "torque", lambda u: u / gains)


def fitted(data, *blocks):
    return fit_model(data, LeastSquares(CoulombViscous()), InverseDynamics(blocks=blocks))


def intervals(friction, block):
    estimates = friction.provenance.refined.parameters
    return np.array([e.interval_95 for e in estimates if e.block == block])


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return wrist.mechanism(tmp_path_factory.mktemp("arm"), gravity=[0.0, 0.0, -9.81], payload="c")


def test_gravity_pins_the_gains(arm):
    """With the nominal bodies held: gains and friction of all joints, within their intervals."""
    friction = fitted(logged(wrist.dataset(arm, wrist.frame(arm))), FrictionBlock(), GainBlock())
    gain = np.asarray(friction.calibration.gain)
    assert gain == pytest.approx(GAINS, rel=0.01)
    assert np.asarray(friction.theta) == pytest.approx(FRICTION, rel=0.03)
    low, high = intervals(friction, "gain").T
    assert ((low < GAINS) & (GAINS < high)).all() and (high - low < 0.05).all()


def test_a_known_payload_pins_the_gains_of_unknown_bodies(arm):
    """All base parameters are free; without the payload one scale is, and the fit is refused."""
    heavy = arm.with_values({"payload_mass": 3.0, "payload_x": 0.1})
    frames = {"light": wrist.frame(arm, seed=1), "heavy": wrist.frame(heavy, seed=2)}
    known = {"heavy": {"payload_mass": 3.0, "payload_x": 0.1}}
    data = logged(wrist.dataset(arm, frames, parameters=known))
    friction = fitted(data, FrictionBlock(), InertiaBlock(), GainBlock())
    assert np.asarray(friction.calibration.gain) == pytest.approx(GAINS, rel=0.03)
    alone = replace(data, recordings=data.recordings[:1])
    with assert_refused("only ratios of inertia, gravity and friction"):
        fitted(alone, FrictionBlock(), InertiaBlock(), GainBlock())


LIFT = """<robot name="lift"><link name="base"/>
<link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<link name="b"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="lift" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0"/>
<axis xyz="0 1 0"/></joint></robot>"""


def test_a_slow_vertical_axis_does_not_show_its_gain(tmp_path):
    """Refused by the name of the joint; kept, the other one is found."""
    (tmp_path / "lift.urdf").write_text(LIFT, encoding="utf-8")
    arm, draw = urdf(tmp_path / "lift.urdf"), np.random.default_rng(4)
    t = np.arange(0.0, 40.0, 0.01)
    q, w, a = sines(t, ((0.8, 0.15),), ((0.8, 0.43),))
    u = torque_without_friction(arm, q, w, a) + 2.0 * np.sign(w) + 1.0 * w
    u += 0.05 * draw.standard_normal(u.shape)
    q += 1e-5 * draw.standard_normal(q.shape)
    arrays = {"a": {"time": t, "angle": q, "torque": u}}
    data = logged(Dataset.from_arrays(arrays, arm, hold="linear"), np.array([1.5, 0.7]))
    with assert_refused(r"torque gain of turn is not pinned .*gain\.turn"):
        fitted(data, FrictionBlock(), GainBlock())
    blocks = blocks_of(["friction", "gain"], ["gain.turn"], {}, "here")
    friction = fitted(data, *blocks)
    assert np.asarray(friction.calibration.gain) == pytest.approx([1.0, 0.7], rel=0.01)


def test_a_joint_that_is_not_there_cannot_be_kept(arm):
    with assert_refused("no joint 'elbow' to fix; known are one, two, three"):
        fitted(wrist.dataset(arm, wrist.frame(arm)), FrictionBlock(), GainBlock(fixed=("elbow",)))
