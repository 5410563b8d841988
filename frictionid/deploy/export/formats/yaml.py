"""Friction as a table for feed-forward: torques over velocities in YAML, with the parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.errors import needs
from frictionid.friction import Friction
from frictionid.friction.laws import Table
from frictionid.friction.wrapped import LinearOutside

with needs("export"):
    import yaml

FORMAT = "frictionid table 1"
_SLOWEST, _COUNT, _UNKNOWN = 3e-3, 26, 10.0  # [rad/s], speeds, greatest speed where unknown
_SETTLE = 20.0  # [s], in which slow bristles bend
_NOT_HELD = {"q": "the angle", "u": "the motor torque", "load": "the bearing load"}


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """A table for each joint, of steady sliding in both directions."""
    speeds, friction = _speeds(own), own.friction
    levels = _levels(own, speeds)
    joints = [_joint(own, j, speeds, levels[..., j]) for j in range(len(own.joints))]
    document = {"format": FORMAT, "name": settings.name, "joints": joints}
    about = "\n".join(f"# {line}" for line in own.facts)
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=100)
    content = f"{about}\n# Between the velocities Tf is straight, beyond the last two, too.\n{text}"
    theta = np.concatenate([levels[1], levels[0]], axis=0).T
    table = Table(tuple(speeds.tolist()))
    law = LinearOutside(table, own.speeds) if own.speeds else table
    held = replace(friction, law=law, theta=np.maximum(theta, 0.0))
    note = "interpolate torque over velocity, joint by joint; add it to the motor torque"
    return Written({".yaml": content.encode()}, _lost(own, speeds, held), held, (note,))


def _speeds(own: ExportedFriction) -> Array:
    """Speeds (V,) [rad/s], dense near zero; the last per cent of each joint's is in them."""
    known = np.array(own.speeds or (_UNKNOWN,))
    spread = np.geomspace(_SLOWEST, known.max(), _COUNT)
    return np.unique(np.concatenate([spread[:-1], 0.99 * known, known]))


def _levels(own: ExportedFriction, speeds: Array) -> Array:
    """Levels (2, V, n) of steady sliding, of negative velocities first."""
    curve = own.friction.curve(np.concatenate([-speeds, speeds]), _SETTLE)
    return np.stack([-curve[: len(speeds)], curve[len(speeds) :]])


def _joint(own: ExportedFriction, j: int, speeds: Array, levels: Array) -> dict[str, Any]:
    """The table of a joint up to its own greatest speed, and its parameters in words."""
    friction, unit = own.friction, own.units[j]
    torque = "N m" if unit == "rad" else "N"
    within = speeds <= (own.speeds[j] if own.speeds else speeds[-1]) * (1.0 + 1e-12)
    down, up = levels[0][within], levels[1][within]
    w = speeds[within]
    both = np.concatenate([-w[::-1], w]), np.concatenate([-down[::-1], up])
    velocities, torques = ([float(f"{v:.6g}") for v in values] for values in both)
    joint: dict[str, Any] = {"name": own.joints[j]}
    joint |= {"velocity_unit": f"{unit}/s", "torque_unit": torque}
    joint |= {"break_away": [float(f"{-down[0]:.6g}"), float(f"{up[0]:.6g}")]}
    joint |= {"velocity": velocities, "torque": torques}
    if own.law.is_network:
        return joint
    has = own.law.has_parameters(friction.n)[j]
    named = zip(own.law.names, friction.units_at(j), friction.theta[j], has, strict=True)
    words = {name: {"value": float(value), "unit": u} for name, u, value, mine in named if mine}
    return {**joint, "parameters": words}


def _lost(own: ExportedFriction, speeds: Array, held: Friction) -> tuple[str, ...]:
    dense = np.geomspace(speeds[0], speeds[-1], 500)
    dense = np.concatenate([-dense, dense])
    off = np.abs(held.curve(dense) - own.friction.curve(dense, _SETTLE)).max()
    lost = [f"between its velocities the table is straight: at most {off:.2g} off steady sliding"]
    if own.friction.law.has_memory:
        lost.append("a table has no memory: it holds steady sliding at each velocity")
    if missing := [_NOT_HELD[x] for x in own.programs.inputs if x in _NOT_HELD]:
        lost.append(f"a table of velocities holds friction at zero of {' and '.join(missing)}")
    return tuple(lost)
