"""Settings of a simulated rig: mechanism, true friction, drive, camera and recordings.

Friction may vary from recording to recording,

    friction of recording i = scatter_i * warmth_i * (wear_i * level(w) sgn(w) + viscous w)

`scatter` differs for each joint and recording, `warmth` follows the temperature, and `wear` raises
the levels from some recording on.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from frictionid.config import Count, NotNegative, Positive, validated
from frictionid.data.signals import Array
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism, as_mechanism

from .integrate import TrueSystem
from .torques import AnyCommand, Controller, Fourier
from .true_friction import Curve, FilmLag, LoadFriction, LuGre, Stribeck, TrueFriction, level_of

AnyFriction = Annotated[Stribeck | FilmLag | LuGre | LoadFriction, Field(discriminator="kind")]


@validated
class Camera:
    """Measurement of the angles: number of samples, rate [Hz], noise (standard deviation) [rad].

    angle_noise : one for all joints, or one for each [rad, or m]
    resolution : [rad], step of an encoder; 0: none
    """

    samples: Annotated[int, Field(ge=2)]
    rate: Positive = 60.0
    angle_noise: NotNegative | tuple[NotNegative, ...] = 0.0
    resolution: NotNegative = 0.0


@validated
class Drive:
    """Drive that holds each logged command until the next one.

        torque(t) = gain command(t - delay)

    rate : commands per second [Hz]; delay : [s]
    torque_noise : standard deviation of what is logged, relative to each joint's mean square
    """

    rate: Positive = 60.0
    delay: NotNegative = 0.0
    gain: Positive = 1.0
    torque_noise: NotNegative = 0.0


@dataclass(frozen=True)
class Run:
    """One recording: name, initial state, and a command for each motor (none: free decay).

    references : of a rig with a controller, one for each joint, in place of state and commands
    """

    name: str
    start_angle: tuple[float, ...] = ()
    start_velocity: tuple[float, ...] = ()
    torques: tuple[AnyCommand, ...] = ()
    references: tuple[Fourier, ...] = ()


@validated
class Rig:
    """All settings of a simulated data set; `rig.toml` has the same names.

    Parameters
    ----------
    name : str
    mechanism : Mechanism, or a [mechanism] table, which becomes one
        The nominal one; what it does not give has the default, see `nominal_mechanism`.
    friction : Stribeck, FilmLag, LuGre or LoadFriction
    camera : Camera
    recordings : tuple of Run
    true_parameters : dict
        True parameters that differ from the nominal ones.
    drive : Drive
    variation : Variation, or None
        How friction varies from recording to recording: scatter, temperature, wear.
    controller : Controller, or None
        Position controller, which makes the torques from references; its model is the nominal one.
    true_mechanism : Mechanism, or a [mechanism] table, or None
        The true machine, where it differs by more than parameters (another URDF).
    seed : int
    substeps : int
        Steps of the integration between two frames.
    description, licence, citation : str

    Raises
    ------
    InputError
        Where numbers of joints or motors disagree, or a name is unknown or used twice.
    """

    name: str
    mechanism: Any
    friction: AnyFriction
    camera: Camera
    recordings: tuple[Run, ...]
    true_parameters: dict[str, float] = field(default_factory=dict)
    drive: Drive = Drive()
    controller: Controller | None = None
    variation: "Variation | None" = None
    true_mechanism: Any = None
    seed: Annotated[int, Field(ge=0)] = 0
    substeps: Count = 32
    description: str = ""
    licence: str = ""
    citation: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "mechanism", as_mechanism(self.mechanism))
        mechanism = nominal_mechanism(self)
        if self.friction.curve.n != mechanism.n:
            raise InputError(
                f"friction has numbers for {self.friction.curve.n} joints, "
                f"the {mechanism.kind} has {mechanism.n}"
            )
        if self.true_mechanism is not None:
            object.__setattr__(self, "true_mechanism", as_mechanism(self.true_mechanism))
            _check_same(mechanism, self.true_mechanism)
        (self.true_mechanism or mechanism).nominal(self.true_parameters)
        if self.controller is not None:
            _check_controller(self, self.controller, mechanism.n)
        if self.variation is not None:
            _check_variation(self, self.variation)
        if np.size(self.camera.angle_noise) not in (1, mechanism.n):
            raise InputError(
                f"camera: angle_noise has {np.size(self.camera.angle_noise)} numbers for "
                f"{mechanism.n} joints; give one, or one for each"
            )
        if not self.recordings:
            raise InputError("a rig needs at least one recording")
        seen: set[str] = set()
        for run in self.recordings:
            if run.name in seen:
                raise InputError(f"two recordings are called {run.name!r}; rename one")
            seen.add(run.name)
            _check_run(run, mechanism, tracked=self.controller is not None)


def nominal_mechanism(rig: Rig) -> Mechanism:
    """Mechanism of the rig, complete: the machine is what the rig says."""
    mechanism: Mechanism = rig.mechanism
    return mechanism.with_defaults()


def true_system(rig: Rig, seed: int | None = None) -> TrueSystem:
    """Mechanism with its true parameters and true friction, that of each recording if it varies."""
    true: Mechanism | None = rig.true_mechanism
    mechanism = nominal_mechanism(rig) if true is None else true.with_defaults()
    parameters = mechanism.nominal(rig.true_parameters)
    p: Array = mechanism.base(parameters)
    friction: Any = rig.friction
    if rig.variation is not None:
        names = [run.name for run in rig.recordings]
        friction = varied(friction, rig.variation, names, rig.seed if seed is None else seed)
    return TrueSystem(mechanism, p, friction, parameters)


def noise_free(rig: Rig) -> Rig:
    """The rig with a noise-free camera: the same motions, exact angles."""
    camera = replace(rig.camera, angle_noise=0.0, resolution=0.0)
    return replace(rig, name=f"{rig.name}_noise_free", camera=camera)


def _check_variation(rig: Rig, variation: "Variation") -> None:
    if not isinstance(rig.friction, Stribeck):
        raise InputError(
            f"variation: friction of kind {rig.friction.kind!r} cannot vary between recordings; "
            'take "stribeck"'
        )
    for name, wanted in (("wear", rig.friction.curve.n), ("temperature", len(rig.recordings))):
        values = getattr(variation, name)
        if values and len(values) != wanted:
            raise InputError(
                f"variation: {name} has {len(values)} numbers; it needs {wanted}, or none"
            )


def _check_same(nominal: Mechanism, true: Mechanism) -> None:
    if (true.n, true.driven) != (nominal.n, nominal.driven):
        raise InputError(
            f"true_mechanism has {true.n} joints with motors {list(true.driven)}, mechanism "
            f"{nominal.n} with {list(nominal.driven)}; they must have the same ones"
        )


def _check_controller(rig: Rig, controller: Controller, n: int) -> None:
    for name, gains in (("kp", controller.kp), ("kd", controller.kd)):
        if len(gains) != n:
            raise InputError(f"controller: {name} needs one number for each of {n} joints")
    if not all(rig.mechanism.driven):
        raise InputError("controller: every joint needs a motor; give the others' torques instead")
    if rig.camera.rate != rig.drive.rate:
        raise InputError(
            f"controller: camera.rate = {rig.camera.rate:g} Hz and drive.rate = "
            f"{rig.drive.rate:g} Hz must be equal: it samples the angles with its torques"
        )


def _check_run(run: Run, mechanism: Mechanism, *, tracked: bool) -> None:
    where = f"recording {run.name!r}"
    plain = run.name.replace("_", "").replace("-", "")
    if not (plain.isascii() and plain.isalnum()):
        raise InputError(f"{where}: a name has letters, digits, - and _ only: it names a file")
    if tracked != bool(run.references):
        raise InputError(f"{where}: references, one for each joint, and a [controller] go together")
    if tracked:
        if len(run.references) != mechanism.n:
            raise InputError(f"{where}: {len(run.references)} references for {mechanism.n} joints")
        if run.torques or run.start_angle or run.start_velocity:
            raise InputError(
                f"{where}: torques, start_angle and start_velocity follow from its references; "
                "leave them out"
            )
        return
    for label, state in (("start_angle", run.start_angle), ("start_velocity", run.start_velocity)):
        if len(state) != mechanism.n and (state or label == "start_angle"):
            raise InputError(
                f"{where}: {label} = {list(state)} needs one number for each of "
                f"{mechanism.n} joints"
            )
    motors = sum(mechanism.driven)
    if len(run.torques) not in (0, motors):
        raise InputError(
            f"{where}: {len(run.torques)} torques for {motors} motors; give one for each, "
            "or none for a free decay"
        )


def generator(seed: int, recording: str, what: str) -> np.random.Generator:
    """Random numbers for one thing of a recording, independent of all others."""
    return np.random.default_rng([seed, zlib.crc32(f"{recording} {what}".encode())])


_LEVELS = ("coulomb_positive", "coulomb_negative", "peak_positive", "peak_negative")


@validated
class Variation:
    """Variation of friction between recordings.

    Parameters
    ----------
    scatter : float
        Relative standard deviation of each joint's friction between recordings.
    temperature : tuple of float [deg C]
        One for each recording; logged beside the angles. (): none.
    per_kelvin : float
        Relative change of all friction with each kelvin above the first recording's temperature.
    wear : tuple of float
        Relative change of each joint's levels, reached step by step by the last recording.
    worn_from : int
        First recording with wear, from 0; where `sudden`, all of it begins there.
    sudden : bool
    """

    scatter: Annotated[float, Field(ge=0, lt=0.3)] = 0.0
    temperature: tuple[float, ...] = ()
    per_kelvin: float = 0.0
    wear: tuple[float, ...] = ()
    worn_from: Annotated[int, Field(ge=0)] = 0
    sudden: bool = False

    def factors(self, names: Sequence[str], joints: int, seed: int) -> tuple[Array, Array]:
        """Factors (R, n) of all friction, and (R, n) of the levels alone, of named recordings."""
        count = len(names)
        draws = [generator(seed, name, "friction").standard_normal(joints) for name in names]
        scatter = 1.0 + self.scatter * np.stack(draws)
        warm = np.array(self.temperature or (0.0,) * count)
        warmth = 1.0 + self.per_kelvin * (warm - warm[0])
        since = np.arange(count) - self.worn_from
        last = max(1, count - 1 - self.worn_from)
        share = (since >= 0) * (1.0 if self.sudden else np.clip(since / last, 0.0, 1.0))
        wear = 1.0 + share[:, None] * np.array(self.wear or (0.0,) * joints)
        return np.maximum(scatter * warmth[:, None], 0.0), wear


@dataclass(frozen=True)
class RecordingFriction(TrueFriction):
    """Memory-free friction with a curve of its own in each recording.

    The memory of a joint is the number of its recording: the integrator picks recordings, and their
    curves with them.
    """

    curve: Curve
    curves: tuple[Curve, ...]

    @cached_property
    def _arrays(self) -> tuple[Array, ...]:
        """Each field of the curves, (R, n)."""
        columns = ([getattr(c, field.name) for c in self.curves] for field in fields(Curve))
        return tuple(map(np.array, columns))

    def start(self, w: Array) -> Array:
        return np.broadcast_to(np.arange(len(self.curves), dtype=float)[:, None], w.shape)

    def torque(self, w: Array, z: Array, mode: Array) -> Array:
        recording = z[..., 0].astype(int)
        numbers = [values[recording] for values in self._arrays]
        return mode * level_of(numbers, w, mode) + numbers[2] * w

    def table(self) -> dict[str, Any]:
        return Stribeck(self.curve).table()


def varied(
    friction: Any, variation: Variation, names: Sequence[str], seed: int
) -> RecordingFriction:
    """Friction of each recording.

    >>> from frictionid.simulate.true_friction import Curve, Stribeck
    >>> tf = Stribeck(Curve((0.1,), (0.1,), (0.0,)))
    >>> worn = varied(tf, Variation(wear=(0.2,), worn_from=1, sudden=True), ("a", "b"), 0)
    >>> [round(curve.coulomb_positive[0], 3) for curve in worn.curves]
    [0.1, 0.12]
    """
    every, levels = variation.factors(names, friction.curve.n, seed)
    curves = []
    for factors, worn in zip(every, levels, strict=True):
        factor = {name: factors * worn for name in _LEVELS} | {"viscous": factors}
        new = {name: f * getattr(friction.curve, name) for name, f in factor.items()}
        numbers = {name: tuple(values.tolist()) for name, values in new.items()}
        curves.append(replace(friction.curve, **numbers))
    return RecordingFriction(friction.curve, tuple(curves))
