"""Friction as a configuration of Isaac Lab: it executes, and PhysX's friction is the held one."""

import re
import sys
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frictionid.data.envelope import Envelope
from frictionid.data.plants import Calibration
from frictionid.data.servo import PositionControl
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.nearest import break_away, nearest
from frictionid.friction import Friction
from frictionid.friction.laws import Stribeck

THETA = np.array([[0.1, 0.05, 0.5, 0.02], [0.0, 0.2, 9.0, 0.01]])


@dataclass
class ImplicitActuatorCfg:
    """Fields of Isaac Lab's class of this name, those that friction concerns."""

    joint_names_expr: list
    stiffness: object
    damping: object
    armature: object = None
    friction: object = None
    dynamic_friction: object = None
    viscous_friction: object = None


@dataclass
class DelayedPDActuatorCfg(ImplicitActuatorCfg):
    """The same with the delay of commands, in steps of the physics."""

    min_delay: int = 0
    max_delay: int = 0


@dataclass
class DCMotorCfg(ImplicitActuatorCfg):
    """The same with a torque-speed envelope, whose saturation effort is one for all joints."""

    effort_limit: object = None
    velocity_limit: object = None
    saturation_effort: float = 0.0


@pytest.fixture
def isaaclab(monkeypatch):
    package, actuators = ModuleType("isaaclab"), ModuleType("isaaclab.actuators")
    vars(actuators).update(
        ImplicitActuatorCfg=ImplicitActuatorCfg,
        DelayedPDActuatorCfg=DelayedPDActuatorCfg,
        DCMotorCfg=DCMotorCfg,
    )
    monkeypatch.setitem(sys.modules, "isaaclab", package)
    monkeypatch.setitem(sys.modules, "isaaclab.actuators", actuators)


def configured(friction):
    own = exported(friction, ("hip.a", "knee")[: friction.n], (5.0,) * friction.n)
    made = writer_of("isaac")(own, ExportSettings(name="leg"))
    module: dict = {}
    exec(made.files[".py"], module)
    return own, made, module["ACTUATORS"]["leg"]


def physx(cfg, joint, w):
    """Friction effort of a moving joint, as PhysX documents it."""
    (key,) = (k for k in cfg.dynamic_friction if re.fullmatch(k, joint))
    assert cfg.friction[key] >= cfg.dynamic_friction[key]
    return cfg.dynamic_friction[key] * np.sign(w) + cfg.viscous_friction[key] * w


@pytest.mark.usefixtures("isaaclab")
def test_physx_has_the_held_friction():
    own, made, cfg = configured(Friction(Stribeck(), THETA))
    assert isinstance(cfg, ImplicitActuatorCfg) and not isinstance(cfg, DelayedPDActuatorCfg)
    w = np.linspace(-5, 5, 40)
    wanted = nearest(own).curve(w)
    for j, joint in enumerate(("hip.a", "knee")):
        assert [bool(re.fullmatch(e, joint)) for e in cfg.joint_names_expr].count(True) == 1
        assert_allclose(physx(cfg, joint, w), wanted[:, j], atol=1e-12)
    static = np.array(list(cfg.friction.values()))
    level = np.array(list(cfg.dynamic_friction.values()))
    assert_allclose(static, np.maximum(break_away(own.friction), level))
    assert made.held is not None and not any("breaks away" in s for s in made.lost)


@pytest.mark.usefixtures("isaaclab")
def test_a_delay_is_in_steps_of_the_physics():
    late = Calibration.ideal(1)
    late = Calibration(None, late.gain, np.array(0.012), late.bias, late.offset)
    model = Friction(Stribeck(), THETA[:1], {"rotor": 0.002}, calibration=late)
    _, _, cfg = configured(model)
    assert isinstance(cfg, DelayedPDActuatorCfg)
    assert (cfg.min_delay, cfg.max_delay) == (2, 3)  # 0.012 s of steps of 0.005 s
    assert list(cfg.armature.values()) == [0.002]


MOTORS = Envelope(*np.array([[0.8, 1.5], [4.0, 10.0], [12.0, 20.0]]))


@pytest.mark.usefixtures("isaaclab")
def test_a_motor_with_an_envelope_is_a_dc_motor_and_joints_of_one_stall_torque_share_it():
    one, none = np.ones(2), np.zeros(2)
    drive = PositionControl(
        *(20.0 * one, 0.5 * one, MOTORS.peak, none, 0.012, none, MOTORS.stall, MOTORS.slope)
    )
    model = exported(Friction(Stribeck(), THETA), ("hip", "knee"), (5.0, 5.0))
    made = writer_of("isaac")(replace(model, drive=drive), ExportSettings(name="leg"))
    module: dict = {}
    exec(made.files[".py"], module)
    configurations = module["ACTUATORS"].values()
    assert sorted(module["ACTUATORS"]) == ["leg_hip", "leg_knee"]
    w = np.linspace(-30.0, 30.0, 61)
    for cfg in configurations:
        (joint,) = cfg.joint_names_expr
        j = ("hip", "knee").index(joint)
        assert isinstance(cfg, DCMotorCfg) and cfg.stiffness == {joint: 20.0}
        fast = cfg.velocity_limit[joint] * (1 + cfg.effort_limit[joint] / cfg.saturation_effort)
        clipped = np.clip(w, -fast, fast)  # as DCMotor does
        top = cfg.saturation_effort * (1 - clipped / cfg.velocity_limit[joint])
        ours = Envelope(*(x[j] for x in MOTORS)).top(w)
        assert_allclose(np.minimum(top, cfg.effort_limit[joint]), ours, atol=1e-12)
    assert any("DCMotor does not delay commands" in sentence for sentence in made.lost)
