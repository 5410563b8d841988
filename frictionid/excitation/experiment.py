"""The experiment that signals are designed for: machine, limits, prior friction, drive, camera.

Signals are points of the unit cube: multisines and chirps with their start angles. Each motor has,
in this order, family, amplitude, and a frequency, a phase and a weight of each of its sines; a
chirp reads the first two frequencies and the first phase. Start angles come last.
"""

import math
from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.config import Count, Positive, nearest, parse_toml, read_toml, validated
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import Mechanism, Plant
from frictionid.simulate.dataset_folder import ROBOT_FILES

_LIMITS = "torque=0.14,velocity=[10,20],angle=3.1"
_PRIOR = "coulomb=[0.1,0.05],viscous=0.001"
_SHARE = 0.05  # of the largest torque limit, which is friction by default
_RESTING = 0.01  # of the velocity limit: slower motion is what a smoother makes of a reversal
_SINES = 5
_PER_MOTOR = 2 + 3 * _SINES
_START = 0.95  # of the angle limit: the largest start angle
# Largest and smallest amplitude over the torque limit; above 1 the signal is clipped.
_OVERDRIVEN, _WEAKEST = 3.0, 0.02
DECIMALS = 6  # of a command [N m]


class Limits(NamedTuple):
    """Largest magnitudes: torque (n,) [N m], zero without a motor; velocity, angle (n,), SI."""

    torque: Array
    velocity: Array
    angle: Array


# Values by their names: a mapping, or the text of an option.
Named = Mapping[str, Any] | str


def limits_of(values: Named, mechanism: Mechanism) -> Limits:
    """Limits by their names, one number for all or a list; an angle without one has no limit.

    Torques have one number for each motor, velocities and angles one for each joint.

    Raises
    ------
    InputError
        For an unknown name, a missing one, or anything that is no positive number.

    Examples
    --------
    >>> from frictionid.mechanics import acrobot
    >>> limits_of("torque=0.14, velocity=[10, 20]", acrobot())
    Limits(torque=array([0.  , 0.14]), velocity=array([10., 20.]), angle=array([inf, inf]))
    """
    table = table_of("--limits", values, Limits._fields, _LIMITS)
    for name in ("torque", "velocity"):
        if name not in table:
            raise InputError(f"--limits {values!r} lacks {name}: e.g. {_LIMITS}")
    driven = np.flatnonzero(mechanism.driven)
    if not driven.size:
        raise InputError(
            f"[mechanism] {mechanism.kind} has no motor: there is no torque to suggest"
        )

    def numbers(name: str, count: int, what: str) -> Array:
        return numbers_of("--limits", name, table.get(name, math.inf), (count, what))

    torque, n = np.zeros(mechanism.n), mechanism.n
    torque[driven] = numbers("torque", driven.size, "motors")
    return Limits(torque, numbers("velocity", n, "joints"), numbers("angle", n, "joints"))


def table_of(option: str, values: Named, names: tuple[str, ...], example: str) -> Mapping[str, Any]:
    """Values by name of an option "name=value,name=[value,value]", or of a mapping."""
    table = values
    if not isinstance(table, Mapping):
        try:
            table = parse_toml(f"x = {{{values}}}", option)["x"]
        except InputError:
            raise InputError(
                f"{option} {values!r} cannot be read: give name=number or name=[number,number] "
                f"with commas, e.g. {example}"
            ) from None
    for name in table:
        if name not in names:
            raise InputError(f"{option}: {name!r} is unknown; {nearest(name, names)}")
    return table


def numbers_of(option: str, name: str, value: Any, count: tuple[int, str]) -> Array:
    """One positive number for each of the joints or motors, from one number or a list."""
    numbers = [value] if np.ndim(value) == 0 else list(value)
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, Real) or not float(number) > 0:
            raise InputError(f"{option}: {name} = {number!r} must be positive")
    if len(numbers) not in (1, count[0]):
        raise InputError(
            f"{option}: {name} has {len(numbers)} numbers for {count[0]} {count[1]}; "
            "give one, or one for each"
        )
    return np.full(count[0], numbers, dtype=float)


def prior_friction_of(values: Named, limits: Limits) -> Friction:
    """Coulomb and viscous friction by their names; default: 5 % of the largest torque limit.

    That share is each joint's Coulomb friction, and its viscous friction at the velocity limit.

    Examples
    --------
    >>> limits = Limits(np.array([0.0, 0.2]), np.array([10.0, 20.0]), np.array([np.inf, np.inf]))
    >>> print(prior_friction_of("viscous=0.002", limits))
    CoulombViscous(width=0.02, shape='tanh', symmetric=True)
      joint 1  coulomb 0.01 N m, viscous 0.002 N m s/rad
      joint 2  coulomb 0.01 N m, viscous 0.002 N m s/rad
    """
    law, joints = CoulombViscous(), len(limits.torque)
    level = _SHARE * float(limits.torque.max())
    columns = {"coulomb": np.full(joints, level), "viscous": level / limits.velocity}
    for name, value in table_of("--friction", values, law.names, _PRIOR).items():
        columns[name] = numbers_of("--friction", name, value, (joints, "joints"))
    theta = np.stack([columns[name] for name in law.names], axis=-1)
    if not (np.isfinite(theta) & (theta > 0)).all():
        coulomb, viscous = theta.T.tolist()
        raise InputError(
            f"--friction: Coulomb {coulomb} and viscous {viscous} must be finite and positive"
        )
    return Friction(law, theta)


@validated
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

    Examples
    --------
    >>> from frictionid.mechanics import pendulum
    >>> limits = limits_of("torque=0.5,velocity=9,angle=2", pendulum())
    >>> plant = Plant.from_parameters(pendulum(), {})
    >>> e = Experiment(plant, prior_friction_of("", limits), limits, length=1.0)
    >>> x = np.random.default_rng(0).uniform(size=(3, e.size))
    >>> e.torque_of(x).shape, bool(abs(e.torque_of(x)).max() <= 0.5), e.start_of(x).shape
    ((61, 3, 1), True, (3, 1))
    """

    plant: Plant
    friction: Friction
    limits: Limits
    length: Positive = 5.0
    recordings: Count = 4
    drive_rate: Positive = 60.0
    camera_rate: Positive = 60.0
    angle_noise: Positive | tuple[Positive, ...] = math.radians(0.1)
    band: tuple[float, float] = (0.2, 4.0)
    start: tuple[float, ...] | None = None
    friction_scales: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
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
        if self.start is not None and len(self.start) != self.plant.n:
            raise InputError(f"start has {len(self.start)} angles for {self.plant.n} joints")
        for j, angle in enumerate(self.start or ()):
            if not abs(angle) < self.limits.angle[j]:
                limit = f"its limit {self.limits.angle[j]:g}"
                raise InputError(f"start angle {angle:g} of joint {j + 1} is not within {limit}")

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

    @property
    def motors(self) -> Array:
        """Joints that have a motor."""
        return np.flatnonzero(self.plant.mechanism.driven)

    @property
    def size(self) -> int:
        """Number of coordinates of a signal."""
        return _PER_MOTOR * len(self.motors) + self.plant.n

    def sines(self, count: int) -> Array:
        """Plain sines (N, size) of frequencies all over the band, from zero angles.

        All motors in phase, at their limit.
        """
        signal = np.full((count, _PER_MOTOR), 0.5)
        signal[:, 0] = 0.75  # a chirp
        signal[:, 2 : 2 + _SINES] = np.linspace(0.0, 1.0, count)[:, None]
        signal[:, 2 + _SINES] = 0.0
        angles = np.full((count, self.plant.n), 0.5)
        return np.hstack([signal] * len(self.motors) + [angles])

    def torque_of(self, x: Array) -> Array:
        """Commands (K + 1, N, n) [N m] of signals x (N, size); the last one is zero."""
        limit = self.limits.torque
        out = np.zeros((len(self.commands), len(x), self.plant.n))
        for i, joint in enumerate(self.motors):
            signal = x[:, i * _PER_MOTOR : (i + 1) * _PER_MOTOR]
            out[:, :, joint] = limit[joint] * self._shape(signal)
        out[-1] = 0.0
        most = np.floor(limit * 10**DECIMALS) / 10**DECIMALS
        return np.clip(np.round(out, DECIMALS), -most, most)

    def start_of(self, x: Array) -> Array:
        """Start angles (N, n); joints start at rest."""
        n, limit = self.plant.n, self.limits.angle
        if self.start is not None:
            return np.full((len(x), n), self.start, dtype=float)
        # without a limit a revolute joint may start at any angle, a carriage at zero
        revolute = np.array([unit == "rad" for unit in self.plant.mechanism.position_units])
        free = np.where(revolute, math.pi, 0.0)
        limit = np.where(np.isfinite(limit), _START * limit, free)
        largest = np.where(revolute, np.minimum(limit, free), limit)
        return np.round(largest * (2 * x[:, -n:] - 1), 3)

    def family_of(self, x: Array) -> list[list[str]]:
        """Family of each motor's signal, "multisine" or "chirp", for each x."""
        chirps = x[:, : -self.plant.n : _PER_MOTOR] >= 0.5
        return np.where(chirps, "chirp", "multisine").tolist()

    def _shape(self, x: Array) -> Array:
        """Commands as shares of the torque limit, (K + 1, N)."""
        time = self.commands
        # half of the signals exceed the limit, and are clipped there
        low, high = 2 * x[:, 1], 2 * x[:, 1] - 1
        gain = np.where(low < 1, _OVERDRIVEN ** (1 - low), _WEAKEST ** np.maximum(high, 0.0))
        f, phase, weight = np.split(x[:, 2:], 3, axis=1)
        lowest, highest = self.band
        f, phase = lowest * (highest / lowest) ** f, 2 * np.pi * phase
        angle = 2 * np.pi * time[:, None, None] * f + phase
        sines = (weight**2 * np.sin(angle)).sum(-1)
        growth = (f[:, 1] - f[:, 0]) / time[-1]
        turns = (f[:, 0] + 0.5 * growth * time[:, None]) * time[:, None]
        chirp = np.sin(2 * np.pi * turns + phase[:, 0])
        wave = np.where(x[:, 0] >= 0.5, chirp, sines)
        return np.clip(gain * wave / np.maximum(np.abs(wave).max(axis=0), 1e-12), -1.0, 1.0)


def load_mechanism(path: Path) -> dict[str, Any]:
    """The [mechanism] table of a TOML file, or of the dataset.toml of a folder.

    The file of a robot counts from the folder of the TOML file.
    """
    file = path / "dataset.toml" if path.is_dir() else path
    document = read_toml(file, "name a file with a [mechanism] table")
    table = document.get("mechanism")
    if not isinstance(table, dict):
        raise InputError(f'{file} has no [mechanism] table; add one, e.g. kind = "acrobot"')
    robots = {key: str(file.parent / str(table[key])) for key in ROBOT_FILES if key in table}
    return {**table, **robots}
