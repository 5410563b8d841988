"""The experiment that signals are designed for: machine, prior friction, limits, drive, camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.config import read_toml
from frictionid.errors import InputError
from frictionid.excitation.limits import Limits
from frictionid.friction import Friction
from frictionid.mechanics import Plant

_RESTING = 0.01  # of the velocity limit: slower motion is what a smoother makes of a reversal


@dataclass(frozen=True)
class Experiment:
    """Everything of an experiment but the torque signal.

    Parameters
    ----------
    plant : Plant, its base parameters p of shape (nb,)
    friction : Friction, the prior, theta (n, 2)
    limits : Limits
    length : float [s], of each recording
    recordings : int
    drive_rate, camera_rate : float [Hz]
    angle_noise : standard deviation [rad], or [m]: one, or one for each joint
    band : lowest and highest frequency of the torque [Hz]
    start : start angles (n,) of each recording, at rest; None to search them as well
    friction_scales : factors of the prior friction for all of which the signal shall be good
    """

    plant: Plant
    friction: Friction
    limits: Limits
    length: float = 5.0
    recordings: int = 4
    drive_rate: float = 60.0
    camera_rate: float = 60.0
    angle_noise: float | tuple[float, ...] = math.radians(0.1)
    band: tuple[float, float] = (0.2, 4.0)
    start: tuple[float, ...] | None = None
    friction_scales: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        for name in ("length", "drive_rate", "camera_rate", "angle_noise"):
            for value in np.ravel(getattr(self, name)):
                if not (math.isfinite(value) and value > 0):
                    raise InputError(f"{name.replace('_', ' ')} = {value:g} must be positive")
        if self.recordings < 1:
            raise InputError(f"recordings = {self.recordings} must be at least 1")
        if self.length * self.camera_rate < 20:
            raise InputError(
                f"length = {self.length:g} s has {self.length * self.camera_rate:.0f} images; at "
                "least 20 are needed: make it longer"
            )
        low, high = self.band
        if not 0 < low < high <= self.drive_rate / 4:
            raise InputError(
                f"frequencies {low:g},{high:g} Hz must be positive, increasing and at most a "
                f"quarter of the drive rate of {self.drive_rate:g} Hz"
            )
        _check_start(self.start, self.limits, self.plant.n)

    @property
    def noise(self) -> Array:
        """Standard deviations (n,) of the joints' angles [rad], or [m]."""
        return np.broadcast_to(np.asarray(self.angle_noise, dtype=float), (self.plant.n,))

    @property
    def velocity_threshold(self) -> Array:
        """Speeds (n,) [rad/s] below which a joint counts as at rest: 1 % of its limit."""
        return _RESTING * self.limits.velocity

    @property
    def images(self) -> Array:
        """Times of the camera (T + 1,) [s]."""
        return np.arange(round(self.length * self.camera_rate) + 1) / self.camera_rate

    @property
    def commands(self) -> Array:
        """Times of the drive's commands (K + 1,) [s], the last one where the signal ends."""
        return np.arange(round(self.length * self.drive_rate) + 1) / self.drive_rate


def _check_start(start: tuple[float, ...] | None, limits: Limits, joints: int) -> None:
    if start is None:
        return
    if len(start) != joints:
        raise InputError(f"start has {len(start)} angles for {joints} joints")
    for j, (angle, most) in enumerate(zip(start, limits.angle, strict=True), start=1):
        if not abs(angle) < most:
            raise InputError(f"start angle {angle:g} of joint {j} is not within its limit {most:g}")


def load_mechanism(path: Path) -> dict[str, Any]:
    """The [mechanism] table of a TOML file, or of the dataset.toml of a folder.

    The file of a robot counts from the folder of the TOML file.

    Raises
    ------
    InputError
        Where the file cannot be read or has no such table.
    """
    file = path / "dataset.toml" if path.is_dir() else path
    document = read_toml(file, "name a file with a [mechanism] table")
    table = document.get("mechanism")
    if not isinstance(table, dict):
        raise InputError(f'{file} has no [mechanism] table; add one, e.g. kind = "acrobot"')
    robots = {key: str(file.parent / str(table[key])) for key in ("urdf", "mjcf") if key in table}
    return {**table, **robots}
