"""What the sides of a comparison are given, as a file from one process to another.

Only NumPy is imported here: what a side imports besides is part of its own time.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np


class Task(NamedTuple):
    """R recordings of a mechanism with two joints, T samples each, and the K windows of each.

    time : (T,) [s], evenly spaced
    angle : (R, T, 2) [rad], as measured
    torque : (R, T, 2) [N m], held from one sample to the next
    start : (R, K, 4) [rad], [rad/s]: smoothed angles and velocities where the windows begin
    length : samples from a window's begin to the next one's; both belong to it, T = K length + 1
    mjcf : the mechanism as MuJoCo text
    """

    time: np.ndarray
    angle: np.ndarray
    torque: np.ndarray
    start: np.ndarray
    length: int
    mjcf: str

    @property
    def count(self) -> int:
        """Number of windows of all recordings."""
        return self.start.shape[0] * self.start.shape[1]

    def windows(self, values: np.ndarray) -> np.ndarray:
        """Samples (R, T, 2) by window, shape (R K, length + 1, 2)."""
        R, K, _ = self.start.shape
        index = np.arange(K)[:, None] * self.length + np.arange(self.length + 1)
        return values[:, index].reshape(R * K, self.length + 1, 2)


def save(task: Task, file: Path) -> None:
    """Write a task."""
    np.savez(file, **task._asdict())


def load(file: Path) -> Task:
    """Task of a file that `save` wrote."""
    with np.load(file) as stored:
        values = {name: stored[name] for name in Task._fields}
    return Task(**{**values, "length": int(values["length"]), "mjcf": str(values["mjcf"])})
