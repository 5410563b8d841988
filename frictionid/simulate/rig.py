"""The simulated rig: a mechanism, its true friction, a drive, a camera and what is recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

from pydantic import Field

from frictionid.data.signals import Array
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism, mechanism_of, parameters_of
from frictionid.simulate.modes import TrueSystem
from frictionid.simulate.torques import AnyCommand
from frictionid.simulate.true_friction import FilmLag, LuGre, Stribeck

AnyFriction = Annotated[Stribeck | FilmLag | LuGre, Field(discriminator="kind")]


@dataclass(frozen=True)
class Camera:
    """What measures the angles: number of samples, `rate` [Hz], deviation of the noise [rad]."""

    samples: int
    rate: float = 60.0
    angle_noise: float = 0.0

    def __post_init__(self) -> None:
        if self.samples < 2:
            raise InputError(f"samples must be at least 2, not {self.samples}")
        _check("rate", self.rate, self.rate > 0)
        _check("angle_noise", self.angle_noise, self.angle_noise >= 0)


@dataclass(frozen=True)
class Drive:
    """What applies the torque, and holds each command until the next one.

    At time t the mechanism feels `gain` times the torque that the log shows for t - `delay`; the
    log has `rate` commands per second.
    """

    rate: float = 60.0
    delay: float = 0.0
    gain: float = 1.0

    def __post_init__(self) -> None:
        _check("rate", self.rate, self.rate > 0)
        _check("delay", self.delay, self.delay >= 0)
        _check("gain", self.gain, self.gain > 0)


@dataclass(frozen=True)
class Run:
    """One recording: its name, the start state, and a command for each motor (none: free decay)."""

    name: str
    start_angle: tuple[float, ...]
    start_velocity: tuple[float, ...] = ()
    torques: tuple[AnyCommand, ...] = ()


@dataclass(frozen=True)
class Rig:
    """All settings of a simulated data set; `rig.toml` has the same names.

    Parameters
    ----------
    name : str
    mechanism : dict
        The [mechanism] table that the users of the data are told.
    friction : Stribeck, FilmLag or LuGre
    camera : Camera
    recordings : tuple of Run
    true_parameters : dict
        Parameters of the real mechanism that differ from the told ones.
    drive : Drive
    seed : int
    substeps : int
        Steps of the integration between two images.
    description, licence, citation : str

    Raises
    ------
    InputError
        Where numbers of joints or motors disagree, or a name is unknown or used twice.
    """

    name: str
    mechanism: dict[str, Any]
    friction: AnyFriction
    camera: Camera
    recordings: tuple[Run, ...]
    true_parameters: dict[str, float] = field(default_factory=dict)
    drive: Drive = field(default_factory=Drive)
    seed: int = 0
    substeps: int = 32
    description: str = ""
    licence: str = ""
    citation: str = ""

    def __post_init__(self) -> None:
        mechanism = nominal_mechanism(self)
        parameters_of(self.mechanism, self.true_parameters)
        _check("substeps", self.substeps, self.substeps >= 1)
        _check("seed", self.seed, self.seed >= 0)
        if self.friction.curve.n != mechanism.n:
            raise InputError(
                f"friction has numbers for {self.friction.curve.n} joints, "
                f"the {self.mechanism['kind']} has {mechanism.n}"
            )
        if not self.recordings:
            raise InputError("a rig needs at least one recording")
        seen: set[str] = set()
        for run in self.recordings:
            if run.name in seen:
                raise InputError(f"two recordings are called {run.name!r}; rename one")
            seen.add(run.name)
            _check_run(run, mechanism)


def nominal_mechanism(rig: Rig) -> Mechanism:
    """Mechanism of the rig, for the true as well as for the told parameters."""
    return mechanism_of(rig.mechanism)


def true_system(rig: Rig) -> TrueSystem:
    """What moves: mechanism with its true parameters, and true friction."""
    mechanism = nominal_mechanism(rig)
    p: Array = mechanism.base(parameters_of(rig.mechanism, rig.true_parameters))
    return TrueSystem(mechanism, p, rig.friction)


def noise_free(rig: Rig) -> Rig:
    """The rig with a perfect camera: the same motions, every angle exact."""
    return replace(rig, name=f"{rig.name}_noise_free", camera=replace(rig.camera, angle_noise=0.0))


def _check_run(run: Run, mechanism: Mechanism) -> None:
    where = f"recording {run.name!r}"
    plain = run.name.replace("_", "").replace("-", "")
    if not (plain.isascii() and plain.isalnum()):
        raise InputError(f"{where}: a name has letters, digits, - and _ only: it names a file")
    for label, state in (("start_angle", run.start_angle), ("start_velocity", run.start_velocity)):
        if len(state) != mechanism.n and (state or label == "start_angle"):
            raise InputError(
                f"{where}: {label} = {list(state)} needs one number for each of "
                f"{mechanism.n} joints"
            )
    motors = sum(mechanism.description.driven)
    if len(run.torques) not in (0, motors):
        raise InputError(
            f"{where}: {len(run.torques)} torques for {motors} motors; give one for each, "
            "or none for a free decay"
        )


def _check(name: str, value: float, holds: bool) -> None:
    if not (holds and math.isfinite(value)):
        raise InputError(f"{name} = {value:g} is out of range")
