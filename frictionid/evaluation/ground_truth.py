"""The true friction of simulated recordings, from the [truth] table of their data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration
from frictionid.data.recordings import Dataset
from frictionid.data.sample_faults import LARGEST
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.laws import FilmLag, LuGre, Stribeck

# The law of each kind of truth, and what its table has besides the steady-state curve. Stribeck
# velocities and what follows stand in the order of the law's parameters.
MODELS: Mapping[str, tuple[Any, tuple[str, ...]]] = {
    "stribeck": (Stribeck(symmetric=False), ()),
    "film_lag": (FilmLag(symmetric=False), ("lag",)),
    "lugre": (LuGre(symmetric=False), ("bristle_stiffness", "bristle_damping", "damping_velocity")),
}


def steady_state(truth: Mapping[str, Any], width: float = 1e-6) -> Friction:
    """True steady-state friction: the curve that every kind of truth follows at constant speed.

    Raises
    ------
    InputError
        Where the table does not hold one finite number for each parameter and joint.
    """
    law = Stribeck(width=width, symmetric=False)
    theta = _columns(truth, law.names, np.size(truth.get(law.names[0], ())))
    return Friction(law, theta, provenance={"source": "truth"})


def _columns(truth: Mapping[str, Any], names: Sequence[str], joints: int) -> Array:
    """Numbers of the table, shape (joints, names)."""
    missing = [name for name in names if name not in truth]
    if missing:
        raise InputError(f"[truth] lacks {', '.join(missing)}")
    for name in names:
        if np.shape(truth[name]) != (joints,) or not _numbers(truth[name]):
            raise InputError(f"[truth] {name} = {truth[name]!r} must be one number for each joint")
    columns = np.array([truth[name] for name in names], dtype=float)
    return columns.reshape(len(names), joints).T


def _numbers(values: Any) -> bool:
    if not isinstance(values, list | tuple) or not values:
        return False
    plain = {type(value) for value in values} <= {int, float}
    return plain and all(abs(value) < LARGEST for value in values)


def true_friction(truth: Mapping[str, Any]) -> Friction | None:
    """True friction as a model that can be scored; None for a kind that is none of our laws.

    Raises
    ------
    InputError
        Where the table does not hold one finite number for each parameter and joint.
    """
    if truth.get("kind") not in MODELS:
        return None
    law, own = MODELS[truth["kind"]]
    curve = steady_state(truth, law.width)
    columns = _columns(truth, own, curve.n)
    if isinstance(law, LuGre):
        if not (columns > 0)[:, [0, 2]].all():
            raise InputError("[truth] bristle_stiffness and damping_velocity must be positive")
        # bristles have a stiffness here, in the law a bend at the mean break-away level
        columns[..., 0] = curve.theta[..., :4].sum(-1) / 2 / columns[..., 0]
    return replace(curve, law=law, theta=np.concatenate([curve.theta, columns], axis=-1))


def true_calibration(dataset: Dataset) -> Calibration | None:
    """True base parameters, gain and delay of simulated data; None where the nominal are true."""
    table: Any = (dataset.truth or {}).get("rig")
    if not isinstance(table, Mapping):
        return None
    mechanism, parameters = dataset.mechanism, table.get("parameters") or {}
    gain, delay = float(table.get("torque_gain", 1.0)), float(table.get("torque_delay", 0.0))
    if not parameters and gain == 1.0 and delay == 0.0:
        return None
    ideal = Calibration.ideal(mechanism.n, mechanism.base(mechanism.nominal(parameters)))
    return replace(ideal, gain=gain * ideal.gain, delay=np.array(delay))
