"""Friction as the actuator configuration of Isaac Lab, whose joints PhysX simulates.

PhysX holds a joint while its load stays below the static friction effort; a moving joint has the
dynamic effort, at most the static one, and viscous friction [PhysX2025]. These are efforts since
PhysX 5.6; before, friction was a coefficient without unit, a share of the force in the joint: no
friction torque can be written so.
"""

from __future__ import annotations

import re

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.native import delay_of
from frictionid.deploy.export.nearest import break_away, differs, lost_by, nearest

_CODE = '''"""{name}: friction of {joints} for the actuators of Isaac Lab.

{facts}

friction, dynamic_friction [N m or N] and viscous_friction [N m s/rad or N s/m] are efforts, as in
Isaac Lab from 2.2 with Isaac Sim 5.0 (PhysX 5.6); earlier versions take `friction` as a coefficient
without unit: do not use these numbers there. PhysX needs friction >= dynamic_friction.
{gains}
"""

from isaaclab.actuators import {kind}

{before}ACTUATORS = {{
    {name!r}: {kind}(
        joint_names_expr={patterns!r},
{fields}
{after}    ),
}}
'''
_STEPS = """DELAY = {!r}  # [s], of the command
PHYSICS_STEP = 0.005  # [s]: set it to that of your simulation, SimulationCfg.dt
STEPS = DELAY / PHYSICS_STEP

"""
_DELAYS = """        min_delay=int(STEPS),
        max_delay=-int(-STEPS // 1),
"""
held = nearest


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `ACTUATORS`, for `ArticulationCfg.actuators`."""
    friction, joints = nearest(model), [re.escape(name) for name in model.joints]
    level, viscous = friction.theta.T
    values: dict[str, Array | None] = {"stiffness": None, "damping": None}
    drive, gains = model.drive, "Stiffness, damping and limits are those of the USD file."
    if drive is not None:
        values |= {"stiffness": drive.kp, "damping": drive.kv, "effort_limit": drive.limit}
        gains = "Stiffness, damping and limits are those of the identified servo."
        viscous = viscous + drive.back_emf
    values |= {
        "friction": np.maximum(break_away(model.friction), level),
        "dynamic_friction": level,
        "viscous_friction": viscous,
    }
    if model.rotor is not None:
        values["armature"] = np.array([model.rotor])
    fields = [f"        {name}={_by_joint(joints, row)}," for name, row in values.items()]
    delay = delay_of(model)
    kind = "DelayedPDActuatorCfg" if delay > 0 else "ImplicitActuatorCfg"
    before, after = (_STEPS.format(delay), _DELAYS) if delay > 0 else ("", "")
    code = _CODE.format(
        name=settings.name,
        joints=", ".join(model.joints),
        facts="\n".join(model.facts),
        gains=gains,
        kind=kind,
        patterns=joints,
        fields="\n".join(fields),
        before=before,
        after=after,
    )
    # PhysX holds the break-away level by itself
    lost = lost_by(model, friction, "PhysX", "static, dynamic and viscous effort")
    lost = [sentence for sentence in lost if " breaks away at " not in sentence]
    if delay < 0:
        lost.append("Isaac Lab delays commands, it cannot advance them: the model's delay is left")
    other = friction if differs(model, friction) else None
    return Written({".py": code.encode()}, tuple(lost), other)


def _by_joint(joints: list[str], row: Array | None) -> str:
    """A value of each joint as code, None where it stays as it is; infinite ones are left out."""
    if row is None:
        return "None"
    pairs = zip(joints, map(float, row), strict=True)
    return repr({name: value for name, value in pairs if np.isfinite(value)} or None)
