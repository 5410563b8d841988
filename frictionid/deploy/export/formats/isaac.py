"""Friction as the actuator configuration of Isaac Lab, whose joints PhysX simulates.

PhysX holds a joint while its load stays below the static friction effort; a moving joint has the
dynamic effort, at most the static one, and viscous friction [PhysX2025]. These are efforts since
PhysX 5.6; before, friction was a coefficient without unit, a share of the force in the joint: no
friction torque can be written so.
"""

import re

import numpy as np

from frictionid.arrays import Array

from ..exported import ExportedFriction, ExportSettings, Written
from ..expressions import rendered
from ..native import delay_of
from ..nearest import break_away, differs, lost_by, nearest
from .python import LANGUAGE

held = nearest


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `ACTUATORS`, for `ArticulationCfg.actuators`."""
    friction, joints = nearest(model), [re.escape(name) for name in model.joints]
    level, viscous = friction.theta.T
    values: dict[str, Array | None] = {"stiffness": None, "damping": None}
    drive = model.drive
    if drive is not None:
        values |= {"stiffness": drive.kp, "damping": drive.kv, "effort_limit": drive.limit}
        viscous = viscous + drive.back_emf
    values |= {
        "friction": np.maximum(break_away(model.friction), level),
        "dynamic_friction": level,
        "viscous_friction": viscous,
    }
    if model.rotor is not None:
        values["armature"] = np.array([model.rotor])
    delay = delay_of(model)
    context = {
        "name": settings.name,
        "kind": "DelayedPDActuatorCfg" if delay > 0 else "ImplicitActuatorCfg",
        "patterns": joints,
        "values": {name: _by_joint(joints, row) for name, row in values.items()},
        "delay": delay,
    }
    code = rendered("isaac.py.j2", model, LANGUAGE, context)
    # PhysX holds the break-away level by itself
    lost = lost_by(model, friction, "PhysX", "static, dynamic and viscous effort")
    lost = [sentence for sentence in lost if " breaks away at " not in sentence]
    if delay < 0:
        lost.append("Isaac Lab delays commands, it cannot advance them: the model's delay is left")
    other = friction if differs(model, friction) else None
    return Written({".py": code}, tuple(lost), other)


def _by_joint(joints: list[str], row: Array | None) -> str:
    """A value of each joint as code, None where it stays as it is; infinite ones are left out."""
    if row is None:
        return "None"
    pairs = zip(joints, map(float, row), strict=True)
    return repr({name: value for name, value in pairs if np.isfinite(value)} or None)
