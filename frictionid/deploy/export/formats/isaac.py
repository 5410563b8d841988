"""Friction as the actuator configuration of Isaac Lab, whose joints PhysX simulates.

PhysX holds a joint while its load stays below the static friction effort; a moving joint has the
dynamic effort, at most the static one, and viscous friction [PhysX2025]. These are efforts since
PhysX 5.6; before, friction was a coefficient without unit, a share of the force in the joint: no
friction torque can be written so.
"""

import re
from collections.abc import Mapping

import numpy as np

from frictionid.arrays import Array

from ..exported import ExportedFriction, ExportSettings, Written
from ..expressions import rendered
from ..nearest import armature, break_away, kept_inertias, lost_by, nearest, whose_gains

held = nearest


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `ACTUATORS`, for `ArticulationCfg.actuators`."""
    friction, drive, delay = nearest(model), model.drive, model.delay
    level, viscous = friction.theta.T
    values: dict[str, Array | None] = {"stiffness": None, "damping": None}
    if drive is not None:
        values |= {"stiffness": drive.kp, "damping": drive.kv, "effort_limit": drive.limit}
    values |= {
        "friction": np.maximum(break_away(model.friction), level),
        "dynamic_friction": level,
        "viscous_friction": viscous + model.back_emf,
    }
    values["armature"], carried = armature(model)
    # PhysX holds the break-away level by itself
    lost = lost_by(model, friction, "PhysX", "static, dynamic and viscous effort")
    lost = [sentence for sentence in lost if " breaks away at " not in sentence]
    other = friction if lost else None
    kind, stall = "ImplicitActuatorCfg", np.zeros(friction.n)
    motors = [model.envelope(j) for j in range(friction.n)]
    if all(motors):
        kind = "DCMotorCfg"
        peak, stall, no_load = np.array([(m.peak, m.stall, m.no_load) for m in motors if m]).T
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
    groups = {
        name: _fields(model, values, stall, joints)
        for name, joints in _alike(settings.name, model, stall).items()
    }
    context = {"kind": kind, "groups": groups, "delay": delay}
    lost += kept_inertias(model, "Isaac Lab", carried)
    code = rendered("isaac.py.j2", model, settings, context)
    return Written({".py": code}, tuple(lost), other, whose_gains(model))


def _alike(name: str, model: ExportedFriction, stall: Array) -> dict[str, Array]:
    """Joints by the name of their configuration: DCMotor has one saturation effort for all."""
    groups = [np.flatnonzero(stall == effort) for effort in np.unique(stall)]
    if len(groups) == 1:
        return {name: groups[0]}
    return {f"{name}_{model.joints[joints[0]]}": joints for joints in groups}


def _fields(
    model: ExportedFriction, values: Mapping[str, Array | None], stall: Array, joints: Array
) -> dict[str, str]:
    """Fields of a configuration as code, by joint; None where a value stays as it is.

    Infinite ones are left out.
    """
    patterns = [re.escape(model.joints[j]) for j in joints]
    code = {"joint_names_expr": repr(patterns)}
    for field, row in values.items():
        pairs = zip(patterns, () if row is None else row[joints].tolist(), strict=False)
        code[field] = repr({name: value for name, value in pairs if np.isfinite(value)} or None)
    if "velocity_limit" in values:
        code["saturation_effort"] = repr(float(stall[joints[0]]))
    return code
