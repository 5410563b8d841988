"""Friction as a configuration of Isaac Lab: it executes, and PhysX's friction is the held one."""

import re
import sys
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import pytest

from frictionid.data.calibration import Calibration
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.nearest import along_velocity, break_away, nearest
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


@pytest.fixture
def isaaclab(monkeypatch):
    package, actuators = ModuleType("isaaclab"), ModuleType("isaaclab.actuators")
    vars(actuators).update(
        ImplicitActuatorCfg=ImplicitActuatorCfg, DelayedPDActuatorCfg=DelayedPDActuatorCfg
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
    wanted = along_velocity(nearest(own), np.stack([w, w], axis=-1))
    for j, joint in enumerate(("hip.a", "knee")):
        assert [bool(re.fullmatch(e, joint)) for e in cfg.joint_names_expr].count(True) == 1
        np.testing.assert_allclose(physx(cfg, joint, w), wanted[:, j], atol=1e-12)
    static = np.array(list(cfg.friction.values()))
    level = np.array(list(cfg.dynamic_friction.values()))
    np.testing.assert_allclose(static, np.maximum(break_away(own.friction), level))
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
