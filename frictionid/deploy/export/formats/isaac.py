"""Friction as the actuator configuration of Isaac Lab, whose joints PhysX simulates.

PhysX holds a joint while its load stays below the static friction effort; a moving joint has the
dynamic effort, at most the static one, and viscous friction [PhysX2025]. These are efforts since
PhysX 5.6; before, friction was a coefficient without unit, a share of the force in the joint: no
friction torque can be written so.
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from frictionid.arrays import Array

from ..exported import ExportedFriction, ExportSettings, Written
from ..expressions import rendered
from ..nearest import break_away, lost_by, nearest

held = nearest


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `ACTUATORS`, for `ArticulationCfg.actuators`."""
    friction, drive, delay = nearest(model), model.drive, model.delay
    level, viscous = friction.theta.T
    values: dict[str, Array | None] = {"stiffness": None, "damping": None}
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
    # PhysX holds the break-away level by itself
    lost = lost_by(model, friction, "PhysX", "static, dynamic and viscous effort")
    lost = [sentence for sentence in lost if " breaks away at " not in sentence]
    other = friction if lost else None
    kind, groups = "ImplicitActuatorCfg", _alike(settings.name, model, np.zeros(friction.n))
    motors = [model.envelope(j) for j in range(friction.n)]
    envelopes = [motor for motor in motors if motor is not None]
    if len(envelopes) == len(motors):
        peak, stall, no_load = np.array([(m.peak, m.stall, m.no_load) for m in envelopes]).T
        kind, groups = "DCMotorCfg", _alike(settings.name, model, stall)
        values |= {"effort_limit": peak, "velocity_limit": no_load}
        if delay > 0:
            lost.append(
                f"DCMotor does not delay commands: the model's {1e3 * delay:.3g} ms are left"
            )
            delay = 0.0
    elif delay > 0:
        kind = "DelayedPDActuatorCfg"
    if delay < 0:
        lost.append("Isaac Lab delays commands, it cannot advance them: the model's delay is left")
    configured = {name: _fields(model, values, list(joints)) for name, joints in groups.items()}
    context = {"name": settings.name, "kind": kind, "groups": configured, "delay": delay}
    code = rendered("isaac.py.j2", model, context)
    return Written({".py": code}, tuple(lost), other)


def _alike(name: str, model: ExportedFriction, stall: Array) -> dict[str, Sequence[int]]:
    """Joints by the name of their configuration: DCMotor has one saturation effort for all."""
    efforts = np.unique(stall)
    if len(efforts) == 1:
        return {name: range(len(stall))}
    groups = [np.flatnonzero(stall == effort).tolist() for effort in efforts]
    return {f"{name}_{model.joints[joints[0]]}": joints for joints in groups}


def _fields(
    model: ExportedFriction, values: Mapping[str, Array | None], joints: Sequence[int]
) -> dict[str, str]:
    """Fields of a configuration as code."""
    patterns, motor = [re.escape(model.joints[j]) for j in joints], model.envelope(joints[0])
    code = {"joint_names_expr": repr(patterns)}
    for name, row in values.items():
        code[name] = _by_joint(patterns, None if row is None else row[joints])
    if "velocity_limit" in values and motor is not None:
        code["saturation_effort"] = repr(float(motor.stall))
    return code


def _by_joint(joints: list[str], row: Array | None) -> str:
    """A value of each joint as code, None where it stays as it is; infinite ones are left out."""
    if row is None:
        return "None"
    pairs = zip(joints, map(float, row), strict=True)
    return repr({name: value for name, value in pairs if np.isfinite(value)} or None)
