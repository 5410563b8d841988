"""Friction as a table for feed-forward: torques over velocities in YAML, with the parameters."""

from dataclasses import replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import needs
from frictionid.friction import Friction
from frictionid.friction.laws import Table
from frictionid.friction.wrapped import LinearOutside

from ..exported import ExportedFriction, ExportSettings, Written
from ..nearest import TABLE_USE, lost_in_table

with needs("export"):
    import yaml

FORMAT = "frictionid table 1"
_SLOWEST, _COUNT, _UNKNOWN = 3e-3, 26, 10.0  # [rad/s], speeds, greatest speed where unknown
_SETTLE = 20.0  # [s], in which slow bristles bend


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A table for each joint, of steady sliding in both directions."""
    speeds, friction = _speeds(model), model.friction
    # (2, V, n), of negative velocities first
    curve = friction.curve(np.concatenate([-speeds, speeds]), _SETTLE)
    levels = np.stack([-curve[: len(speeds)], curve[len(speeds) :]])
    joints = [_joint(model, j, speeds, levels[..., j]) for j in range(friction.n)]
    document = {"format": FORMAT, "name": settings.name, "joints": joints}
    about = "\n".join(f"# {line}" for line in model.facts)
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=100)
    content = f"{about}\n# Between the velocities Tf is straight, beyond the last two, too.\n{text}"
    theta = np.concatenate([levels[1], levels[0]], axis=0).T
    table = Table(tuple(speeds.tolist()))
    law = LinearOutside(table, model.speeds) if model.speeds else table
    held = replace(friction, law=law, theta=np.maximum(theta, 0.0))
    return Written({".yaml": content.encode()}, _lost(model, speeds, held), held, (TABLE_USE,))


def _speeds(model: ExportedFriction) -> Array:
    """Speeds (V,) [rad/s], dense near zero; the last per cent of each joint's is in them."""
    greatest = np.array(model.speeds or (_UNKNOWN,))
    spread = np.geomspace(_SLOWEST, greatest.max(), _COUNT)
    return np.unique(np.concatenate([spread[:-1], 0.99 * greatest, greatest]))


def _joint(model: ExportedFriction, j: int, speeds: Array, levels: Array) -> dict[str, Any]:
    """The table of a joint up to its greatest speed, and its parameters in words."""
    within = speeds <= (model.speeds[j] if model.speeds else speeds[-1]) * (1.0 + 1e-12)
    w, (down, up) = speeds[within], levels[:, within]
    columns = {
        "break_away": (-down[0], up[0]),
        "velocity": (*-w[::-1], *w),
        "torque": (*-down[::-1], *up),
    }
    joint: dict[str, Any] = {
        "name": model.joints[j],
        "velocity_unit": f"{model.units[j]}/s",
        "torque_unit": model.torque_units[j],
        **{name: [float(f"{v:.6g}") for v in values] for name, values in columns.items()},
    }
    if model.law.is_network:
        return joint
    joint["parameters"] = {
        name: {"value": value, "unit": unit} for name, unit, value in model.parameters(j)
    }
    return joint


def _lost(model: ExportedFriction, speeds: Array, held: Friction) -> tuple[str, ...]:
    dense = np.geomspace(speeds[0], speeds[-1], 500)
    dense = np.concatenate([-dense, dense])
    off = np.abs(held.curve(dense) - model.friction.curve(dense, _SETTLE)).max()
    return lost_in_table(model, float(off))
