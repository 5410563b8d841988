"""A friction as it is exported: its numbers, the speeds where they hold, and its programs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

from frictionid.api.machines import Machine, Nearest
from frictionid.arrays import Array
from frictionid.config import validated
from frictionid.data.envelope import Envelope
from frictionid.data.plants import Calibration, calibrated_dataset
from frictionid.data.recordings import Dataset
from frictionid.data.servo import PositionControl, position_control
from frictionid.errors import InputError, printable
from frictionid.evaluation import Protocol, prepare, prepared_for
from frictionid.evaluation.prepared import HORIZONS_OF_ARMS, Prepared, is_arm, with_calibration
from frictionid.friction import Friction, Inputs, Law, at_rest
from frictionid.friction.law import refuse_temperature
from frictionid.mechanics import Mechanism
from frictionid.programs.program import Program
from frictionid.programs.trace import traced

from ..compensation import CompensationLaw, bare, continued, listed

INPUTS = ("q", "w", "u", "load")  # as in `Inputs`
_HORIZON = 1.0  # [s], over which it is replayed what a target loses


class Programs(NamedTuple):
    """What a friction computes, as programs of scalars.

    torque : inputs of `inputs` and memory; output Tf, an entry for each joint
    advance : the same inputs and dt; outputs memory_1, memory_2 ..., an entry for each joint
    start : inputs of `inputs`; outputs as of `advance`
    inputs : which of q, w, u and load friction depends on
    memory : number of memory entries of each joint, 0 for static laws
    """

    torque: Program
    advance: Program
    start: Program
    inputs: tuple[str, ...]
    memory: int


@dataclass(frozen=True)
class ExportedFriction:
    """Friction (n, P) of one set of parameters, continued by a straight line beyond known speeds.

    Attributes
    ----------
    friction : Friction, theta (n, P)
        Its law is `LinearOutside` the model's law where speeds are known.
    joints : names of the parts with friction
    speeds : greatest speed of each part in the data [rad/s or m/s]; () where they are not known
    data : data set whose motion shows what a target loses, where it is at hand
    mechanism : with friction's joints, where it is known; drive : position control of its motors
    nearest : Coulomb and viscous friction nearest to it, where a card knows it in place of data
    """

    friction: Friction
    joints: tuple[str, ...]
    speeds: tuple[float, ...] = ()
    data: Dataset | None = None
    mechanism: Mechanism | None = None
    drive: PositionControl | None = None
    nearest: Nearest | None = None

    @property
    def driven(self) -> Mapping[str, int]:
        """Names of the joints that motors drive, and their places."""
        motors = (True,) * len(self.joints) if self.mechanism is None else self.mechanism.motors
        pairs = enumerate(zip(self.joints, motors, strict=False))
        return {name: j for j, (name, motor) in pairs if motor}

    def parameters(self, j: int) -> list[tuple[str, str, float]]:
        """Name, unit and value of the parameters that a joint has."""
        law, friction = self.law, self.friction
        values = map(float, friction.theta[j])
        rows = list(zip(law.names, friction.units_at(j), values, strict=True))
        return [rows[i] for i in np.flatnonzero(law.has_parameters(friction.n)[j])]

    def envelope(self, j: int) -> Envelope | None:
        """Torque-speed envelope of a joint's motor: a servo's, or that of a measured torque."""
        if self.drive is not None:
            return self.drive.envelope(j)
        reached = self.friction.provenance.envelopes
        return next((e.envelope for e in reached if e.joint == j + 1), None)

    @property
    def law(self) -> Law:
        """The model's law, without its continuation."""
        return bare(self.friction.law)

    @property
    def calibration(self) -> Calibration:
        """What the fit corrects of machine and sensors; nothing where it has no calibration."""
        return self.friction.calibration or Calibration.ideal(self.friction.n)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of the position of each part: "rad" or "m"."""
        return self.friction.position_units or ("rad",) * self.friction.n

    @property
    def torque_units(self) -> tuple[str, ...]:
        """Unit of the friction of each part: "N m" or "N"."""
        return tuple("N m" if unit == "rad" else "N" for unit in self.units)

    @property
    def back_emf(self) -> Array:
        """Damping (n,) [N m s/rad] of the joints by the back-EMF of their servos' motors."""
        damping, driven = np.zeros(self.friction.n), list(self.driven.values())
        if self.drive is not None:
            damping[driven] = self.drive.back_emf[driven]
        return damping

    @property
    def delay(self) -> float:
        """Delay [s] of the motors' commands: of a servo's targets, else of the torque."""
        return float((self.drive or self.calibration).delay)

    @property
    def backlash(self) -> float | Array:
        """Backlash of each joint's encoder [rad or m], of servos."""
        if self.calibration.backlash is not None:
            return self.calibration.backlash
        servo = None if self.data is None else self.data.recordings[0].servo
        return 0.0 if servo is None else servo.backlash

    @property
    def horizon(self) -> float:
        """Time [s] over which it is replayed what a target loses.

        1 s, of arms, which drift off without their controller, 0.2 s; less in short recordings.
        """
        if self.data is None:
            return _HORIZON
        longest = max(r.angle.duration for r in self.data.recordings)
        return min(
            HORIZONS_OF_ARMS[-1] if is_arm(self.data) else _HORIZON, float(f"{longest / 2:.1g}")
        )

    @cached_property
    def prepared(self) -> Prepared | None:
        """The data as this friction sees them, with its parameters and its calibration."""
        if self.data is None:
            return None
        prepared = prepare(self.data, Protocol(horizons=(self.horizon,)))
        return with_calibration(prepared_for(prepared, self.friction), self.friction.calibration)

    def with_theta(self, theta: Array) -> "ExportedFriction":
        """Friction with other parameters (n, P), on the same data."""
        other = replace(self, friction=replace(self.friction, theta=theta))
        if "prepared" in vars(self):
            vars(other)["prepared"] = self.prepared  # its calibration is the same
        return other

    @property
    def facts(self) -> tuple[str, ...]:
        """Lines on units, signs, range and origin, for the head of a file."""
        source = self.friction.provenance
        units = zip(self.joints, self.units, self.torque_units, strict=True)
        head: tuple[str, ...] = (
            f"Friction law: {self.law}",
            "Tf opposes positive velocity: M(q) dw/dt = h(q, w) + B u - Tf.",
        )
        if isinstance(self.law, CompensationLaw):
            torque = "u is the motor torque: the reference's, or that of the last cycle."
            head = (*self.law.facts, *[torque] * follows(self.friction, "u"))
        lines = [
            *head,
            "SI units: " + ", ".join(f"{name} [{x}, {x}/s, {force}]" for name, x, force in units),
            f"Measured up to |w| = {listed(self.speeds)}; beyond, friction is a straight line."
            if self.speeds
            else "The measured speeds are not known: friction is the law's at all speeds.",
        ]
        if source.dataset:
            lines.append(f"Fitted to {source.dataset}, seed {source.seed}.")
        hashes = source.data
        lines += [f"  {name} {digest}" for name, digest in list(hashes.items())[:3]]
        if len(hashes) > 3:
            further = len(hashes) - 3
            lines.append(f"  and {further} file{'s' * (further > 1)} more")
        return tuple(" ".join(printable(line).split("\n")) for line in lines)

    @cached_property
    def programs(self) -> Programs:
        """The friction as programs.

        Raises
        ------
        InputError
            For laws that compute in other ways, such as a network of torch.
        """
        law, theta, n = self.friction.law, self.friction.theta, self.friction.n
        count = len(law.start(theta, at_rest(np.zeros(n))))
        entries = [f"memory_{i + 1}" for i in range(count)]
        sizes = dict.fromkeys(INPUTS, n)

        def torque(x: Mapping[str, Array]) -> Mapping[str, Array]:
            return {"Tf": law.torque(theta, inputs_of(x), tuple(x[m] for m in entries))}

        def advance(x: Mapping[str, Array]) -> Mapping[str, Array]:
            memory = law.advance(theta, inputs_of(x), tuple(x[m] for m in entries), x["dt"])
            return dict(zip(entries, memory, strict=True))

        def start(x: Mapping[str, Array]) -> Mapping[str, Array]:
            return dict(zip(entries, law.start(theta, inputs_of(x)), strict=True))

        with_memory = sizes | dict.fromkeys(entries, n)
        try:
            programs = (
                traced(torque, with_memory),
                traced(advance, with_memory | {"dt": 1}),
                traced(start, sizes),
            )
        except (NotImplementedError, TypeError, ValueError) as error:
            raise InputError(
                f"{type(law).__name__}: its torque cannot be written as code ({error}); "
                "export it to onnx or torchscript, or as a table"
            ) from None
        used = {name.rpartition("_")[0] for program in programs for name in program.read()}
        unused = {f"{x}_{j + 1}" for x in INPUTS if x not in used for j in range(n)}
        torque_, advance_, start_ = (
            program.with_inputs([name for name in program.inputs if name not in unused])
            for program in programs
        )
        return Programs(torque_, advance_, start_, tuple(x for x in INPUTS if x in used), count)


def exported(
    friction: Friction,
    joints: Sequence[str] = (),
    speeds: Sequence[float] = (),
    data: Dataset | None = None,
    card: Machine | None = None,
) -> ExportedFriction:
    """Friction to be exported, from a model.

    Parameters
    ----------
    friction : Friction, theta (n, P)
    joints : names of the parts with friction; those of the model where they are missing
    speeds : where known [rad/s or m/s]; by default those of the model's provenance
    data : data set, optional
    card : of a machine, in place of a data set

    Raises
    ------
    InputError
        For models without friction torques, and for several sets of parameters at once.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> tf = exported(Friction(CoulombViscous(), np.array([[0.1, 0.02]])), speeds=(10.0,))
    >>> tf.programs.inputs, round(tf.programs.torque.run({"w_1": 20.0})["Tf"][0], 6)
    (('w',), 0.5)
    """
    if friction.mechanism:
        raise InputError(
            "a model without physics has no friction torque to export: fit one that has"
        )
    refuse_temperature(friction.law, "an export")
    if friction.theta.ndim != 2:
        raise InputError(
            f"a model with parameters of shape {friction.theta.shape} holds several frictions: "
            "export one of them, friction[0]"
        )
    if not np.isfinite(friction.theta).all():
        raise InputError("a model whose parameters are not finite cannot be exported: fit again")
    measured = tuple(float(v) for v in speeds) or friction.provenance.speeds
    names = tuple(joints) or friction.joints
    for entries, what in ((measured, "speeds"), (names, "names")):
        if entries and len(entries) != friction.n:
            raise InputError(
                f"{len(entries)} {what} for {friction.n} parts with friction: give one each"
            )
    reach = tuple(max(v, 1e-9) for v in measured)  # of a joint that does not move
    law = friction.law
    if measured and (speeds or not isinstance(law, CompensationLaw)):  # which goes on by itself
        law = continued(law, reach)
    # names stand in comments of code: on one line, whatever a file said
    names = tuple(" ".join(printable(name).split()) for name in names)
    friction = replace(friction, law=law)
    if data is not None:
        return ExportedFriction(friction, names, measured, data, *_driven(friction, data))
    parts = () if card is None else (card.mechanism, card.drive, card.nearest)
    return ExportedFriction(friction, names, measured, None, *parts)


def _driven(friction: Friction, data: Dataset) -> tuple[Mechanism, PositionControl | None]:
    """Mechanism of the data, and position control of its first recording as it is calibrated."""
    if friction.calibration is not None:
        data = calibrated_dataset(data, friction.calibration)
    servo, motor = data.recordings[0].servo, friction.parameters
    if servo is not None and "kt" in motor:
        servo = servo.with_motor(motor["kt"], motor["R"])
    return data.mechanism, None if servo is None else position_control(servo, data.mechanism.n)


def follows(friction: Friction, name: str) -> bool:
    """Whether the torque depends on an input: "q", "u" or "load".

    >>> from frictionid.friction.laws import MotorLoad
    >>> friction = Friction(MotorLoad(), np.array([[0.1, 0.02, 0.3]]))
    >>> [follows(friction, name) for name in ("q", "u", "load")]
    [False, True, False]
    """
    law, theta = friction.law, friction.theta
    w = np.ones((2, friction.n))
    x = Inputs(w, w, w, w)._replace(**{name: w * [[1.0], [2.5]]})
    memory = law.start(theta, x)
    values = (law.torque(theta, x, memory), law.limit(theta, x, memory))
    return any(np.ptp(np.broadcast_to(v, w.shape), axis=0).any() for v in values)


def inputs_of(arrays: Mapping[str, Array]) -> Inputs:
    """Inputs of a law from arrays by name."""
    return Inputs(*(arrays[x] for x in INPUTS))


@validated
class ExportSettings:
    """What a user may choose.

    name : prefix of functions and types in code, and name of what is exported
    precision : of the numbers in code, "double" or "float"
    into : file whose joints are given friction, of formats that describe a mechanism
    joints : their names in it, in the model's order, where they are not those of the data set
    randomise : number of samples of the parameters, in a file beside the others; 0 for none
    seed : of the samples
    stem : name of the files without their endings, for those that name each other
    folder : of the files, for those that name others
    """

    name: str = "friction"
    precision: Literal["double", "float"] = "double"
    into: Path | None = None
    joints: tuple[str, ...] = ()
    randomise: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    seed: int = 0
    stem: str = "friction"
    folder: Path = Path()

    def __post_init__(self) -> None:
        if not (self.name.isidentifier() and self.name.isascii()):
            raise InputError(
                f"name = {self.name!r} must be a name in code, of letters, digits and _"
            )


class Written(NamedTuple):
    """Files of an export.

    files : contents by the ending of their names, the first is the one that the user names
    lost : sentences on what the target cannot hold; none where it computes the same
    held : the friction that the target computes, where it is another one
    notes : sentences on what was changed, and on what else to know
    """

    files: Mapping[str, bytes]
    lost: tuple[str, ...] = ()
    held: Friction | None = None
    notes: tuple[str, ...] = ()
