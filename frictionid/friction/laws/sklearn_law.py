"""Friction by regressors of scikit-learn that see more than the velocity: not for files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.smooth_sign import smooth_sign


@dataclass(frozen=True, eq=False)
class Predicted(Law):
    """What one of the `models` predicts from `inputs`; theta holds its number.

    models : fitted regressors of features (B, 2 + others), see `features`
    inputs : "w", and "q", "u" of the joint
    width : of the smooth sign [rad/s]
    """

    models: tuple[Any, ...]
    inputs: tuple[str, ...] = ("w",)
    width: float = 0.02
    names: ClassVar[tuple[str, ...]] = ("model",)
    units: ClassVar[tuple[str, ...]] = ("1",)
    bounds: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, float("inf")),)
    shape = ""
    kind = ""
    cannot_be_saved = "regressors of more than the velocity are no curve: use them in Python"

    def __repr__(self) -> str:
        return f"Predicted({len(self.models)} models of {', '.join(self.inputs)})"

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        which = np.asarray(theta[..., 0] + 0.0 * x.w).astype(int)
        parts = features(x, self.inputs, self.width)
        table = np.stack([np.broadcast_to(part, which.shape) for part in parts], axis=-1)
        out = np.empty(which.shape)
        for i in np.unique(which):
            out[which == i] = self.models[i].predict(table[which == i])
        return out

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        side = np.where(x.w > 0, 1.0, -1.0)
        beyond = self.torque(theta, x._replace(w=3.0 * self.width * side), memory)
        return np.maximum(side * beyond, 0.0)


def features(x: Inputs, inputs: Sequence[str], width: float) -> list[Array]:
    """What regressors see, each (...): smooth sign and asinh of w, on which friction bends alike.

    Other inputs as they are.
    """
    own = [smooth_sign(x.w, width), np.arcsinh(x.w)]
    return own + [getattr(x, name) for name in inputs if name != "w"]
