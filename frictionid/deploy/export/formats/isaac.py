"""Friction as the actuator configuration of Isaac Lab, whose joints PhysX simulates.

PhysX holds a joint while its load stays below the static friction effort; a moving joint has the
dynamic effort, at most the static one, and viscous friction [PhysX2025]. These are efforts since
PhysX 5.6; before, friction was a coefficient without unit, a share of the force in the joint: no
friction torque can be written so.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.nearest import break_away, differs, lost_by, nearest

_HEAD = '''"""{name}: friction of {joints} for the actuators of Isaac Lab.

{facts}

friction, dynamic_friction [N m or N] and viscous_friction [N m s/rad or N s/m] are efforts, as in
Isaac Lab from 2.2 with Isaac Sim 5.0 (PhysX 5.6); earlier versions take `friction` as a coefficient
without unit: do not use these numbers there. PhysX needs friction >= dynamic_friction.
Stiffness, damping and limits are those of the USD file.
"""

'''
held = nearest


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `ACTUATORS`, for `ArticulationCfg.actuators`."""
    friction = nearest(own)
    level, viscous = friction.theta.T
    static = np.maximum(break_away(own.friction), level)
    fields: dict[str, Mapping[str, float]] = {
        "friction": _by_joint(own, static),
        "dynamic_friction": _by_joint(own, level),
        "viscous_friction": _by_joint(own, viscous),
    }
    rotor = own.friction.parameters.get("rotor")
    if rotor is not None and len(own.joints) == 1:
        fields["armature"] = _by_joint(own, np.array([rotor]))
    calibration = own.friction.calibration
    delay = 0.0 if calibration is None else float(calibration.delay)
    kind = "DelayedPDActuatorCfg" if delay > 0 else "ImplicitActuatorCfg"
    lines = [f"from isaaclab.actuators import {kind}", ""]
    if delay > 0:
        lines += [
            f"DELAY = {delay!r}  # [s], of the command",
            "PHYSICS_STEP = 0.005  # [s]: set it to that of your simulation, SimulationCfg.dt",
            "STEPS = DELAY / PHYSICS_STEP",
            "",
        ]
    lines += [
        "ACTUATORS = {",
        f"    {settings.name!r}: {kind}(",
        f"        joint_names_expr={[re.escape(name) for name in own.joints]!r},",
        "        stiffness=None,",
        "        damping=None,",
        *(f"        {name}={dict(values)!r}," for name, values in fields.items()),
    ]
    if delay > 0:
        lines += ["        min_delay=int(STEPS),", "        max_delay=-int(-STEPS // 1),"]
    lines += ["    ),", "}", ""]
    facts = "\n".join(own.facts)
    head = _HEAD.format(name=settings.name, joints=", ".join(own.joints), facts=facts)
    lost = _lost(own, lost_by(own, friction, "PhysX", "static, dynamic and viscous effort"))
    other = friction if differs(own, friction) else None
    return Written({".py": (head + "\n".join(lines)).encode()}, tuple(lost), other)


def _lost(own: ExportedFriction, sentences: list[str]) -> list[str]:
    """The sentences, without those on break-away, which PhysX holds by itself."""
    kept = [s for s in sentences if " breaks away at " not in s]
    calibration = own.friction.calibration
    if calibration is not None and calibration.delay < 0:
        kept.append("Isaac Lab delays commands, it cannot advance them: the model's delay is left")
    return kept


def _by_joint(own: ExportedFriction, values: np.ndarray) -> dict[str, float]:
    names = (re.escape(name) for name in own.joints)
    return {name: float(v) for name, v in zip(names, values, strict=True)}
