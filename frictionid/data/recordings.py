"""Recordings and data sets, checked when they are made."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, get_args

import numpy as np

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism, as_mechanism

from .base_motion import check_base_motion
from .frames import FrameColumns, Names, Numbers, Units, check_columns, columns_of_arrays
from .joint_scales import JointScales, joint_scales
from .readers.column_toml import Gears, TorqueAt
from .readers.table_recording import Recorded
from .servo import Servo
from .signals import TORQUE_HOLD, Signal, check_clocks, check_signal, column_count


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """Noise-free motion of a simulation.

    Attributes
    ----------
    angle : Signal, n columns [rad]
    velocity : Signal, n columns [rad/s]
    """

    angle: Signal
    velocity: Signal


@dataclass(frozen=True, eq=False)
class Recording:
    """One uninterrupted measurement of a mechanism with n joints.

    A prismatic joint has [m], [m/s] and [N] in place of [rad], [rad/s] and [N m].

    Attributes
    ----------
    name : str
    angle : Signal, n columns [rad]
        At least two samples.
    torque : Signal, n columns [N m]
        One column per joint, zero where there is no motor. Its clock may differ from the angles'
        clock, but both count from the same instant. It is held between its samples unless its
        `hold` says otherwise.
    velocity : Signal, n columns [rad/s], or None
        Measured velocity, where there is one.
    parameters : those of the mechanism that differ in this recording, such as an exchangeable mass
    covariates : other measured quantities, in the unit of the file (temperature, voltage)
    truth : the noise-free motion, of simulated recordings
    servo : controller and motors that make the torque, where known; `torque` follows from motion
    base_motion, base_wrench : Signal or None
        Of a floating base: 9 columns, see `with_base_motion`; forces and moments on it [N],
        [N m] beside gravity, at its origin in its frame, where known.

    Raises
    ------
    InputError
        Where times do not increase, a value is not finite, or columns and joints disagree.

    Examples
    --------
    >>> time = np.arange(3.0)
    >>> Recording("rest", Signal(time, np.zeros((3, 2))), Signal(time, np.zeros((3, 2))))
    Recording('rest': 2 joints, 3 samples, 2 s)
    """

    name: str
    angle: Signal
    torque: Signal
    velocity: Signal | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    covariates: Mapping[str, Signal] = field(default_factory=dict)
    truth: TrueMotion | None = None
    servo: Servo | None = None
    base_motion: Signal | None = None
    base_wrench: Signal | None = None

    def __post_init__(self) -> None:
        where = f"recording {self.name!r}"
        if self.torque.hold is None:
            object.__setattr__(self, "torque", self.torque._replace(hold=TORQUE_HOLD))
        for label, signal in self._motions():
            check_signal(f"{where}, {label}", signal)
            if column_count(signal) != column_count(self.angle):
                raise InputError(
                    f"{where}: {label} has {column_count(signal)} columns and angle has "
                    f"{column_count(self.angle)}; give one column per joint"
                )
        for name, signal in self.covariates.items():
            check_signal(f"{where}, covariate {name!r}", signal)
        if len(self.angle.time) < 2:
            raise InputError(f"{where}: angle needs at least 2 samples, it has 1")
        check_clocks(where, self.angle, self.torque)
        if self.base_motion is not None:
            check_base_motion(where, self.angle, self.base_motion)
        for name, value in self.parameters.items():
            if not math.isfinite(value):
                raise InputError(f"{where}: parameter {name!r} must be finite, not {value}")

    def __repr__(self) -> str:
        samples, joints = np.shape(self.angle.value)
        span = self.angle.duration
        return f"Recording({self.name!r}: {joints} joints, {samples} samples, {span:g} s)"

    def _motions(self) -> Iterator[tuple[str, Signal]]:
        """Signals with one column per joint, with their names in errors."""
        yield from (("angle", self.angle), ("torque", self.torque))
        if self.velocity is not None:
            yield "velocity", self.velocity
        if self.truth is not None:
            yield from (("true angle", self.truth.angle), ("true velocity", self.truth.velocity))
        if self.servo is not None:
            yield from (("goal", self.servo.goal), ("enabled", self.servo.enabled))


@dataclass(frozen=True, eq=False)
class Dataset:
    """Recordings of one mechanism, and their origin.

    Attributes
    ----------
    name : str
    mechanism : the nominal one; a [mechanism] table (kind, parameters and options) becomes one
    recordings : at least one, with different names and equally many joints
    hashes : SHA-256 of each file that was read, under its name
    origin : description, origin, licence and citation
    truth : the [truth] table, of simulated recordings
    columns : what those of its frames were, so that further frames are read alike
    gears : between the motors that columns were of and the joints
    torque_at : "motor", "link" or "command": what the torques are, see `from_frames`
    """

    name: str
    mechanism: Mechanism
    recordings: tuple[Recording, ...]
    hashes: Mapping[str, str] = field(default_factory=dict)
    origin: Mapping[str, str] = field(default_factory=dict)
    truth: Mapping[str, object] | None = None
    columns: FrameColumns | None = None
    gears: Gears | None = None
    torque_at: str = "motor"

    def __post_init__(self) -> None:
        if self.torque_at not in get_args(TorqueAt):
            raise InputError(
                f"data set {self.name!r}: torque_at = {self.torque_at!r}; "
                f"{nearest(self.torque_at, get_args(TorqueAt))}"
            )
        object.__setattr__(self, "mechanism", as_mechanism(self.mechanism))
        if not self.recordings:
            raise InputError(f"data set {self.name!r} needs at least one recording")
        for name in (self.name, *(r.name for r in self.recordings)):
            if not name.isprintable():
                raise InputError(
                    f"{name!r} names a data set or recording and has characters that cannot be "
                    "shown: rename it"
                )
        seen: set[str] = set()
        joints = column_count(self.recordings[0].angle)
        for recording in self.recordings:
            if recording.name in seen:
                raise InputError(
                    f"data set {self.name!r}: two recordings are called {recording.name!r}; "
                    "rename one, or let the patterns match one of them"
                )
            seen.add(recording.name)
            if column_count(recording.angle) != joints:
                raise InputError(
                    f"data set {self.name!r}: recording {recording.name!r} has "
                    f"{column_count(recording.angle)} joints, the first one has {joints}"
                )

    @cached_property
    def scales(self) -> JointScales:
        """Size and speeds of each joint by its measured positions, see `joint_scales`."""
        return joint_scales(self.mechanism.position_units, [r.angle for r in self.recordings])

    @property
    def actuated(self) -> Array:
        """Whether each joint (n,) has a torque, somewhere not zero."""
        return np.any([np.any(r.torque.value, axis=0) for r in self.recordings], axis=0)

    @property
    def servos(self) -> tuple[Servo, ...]:
        """Servos of the recordings that have one."""
        return tuple(r.servo for r in self.recordings if r.servo is not None)

    def __repr__(self) -> str:
        recordings = self.recordings
        joints = column_count(recordings[0].angle)
        span = sum(r.angle.duration for r in recordings)
        return (
            f"Dataset({self.name!r}: {len(recordings)} recording{'s' * (len(recordings) > 1)}, "
            f"{joints} joint{'s' * (joints > 1)}, {span:g} s)"
        )

    def _repr_html_(self) -> str:
        from .recorded_picture import dataset_html  # which knows this class

        return dataset_html(self)

    def plot(self, *names: str) -> Any:
        """Angles and torques over time of recordings by their names, or of the first three.

        A Matplotlib figure. Gaps are red, dropped samples red ticks at the top, stretches at rest
        grey.
        """
        from frictionid.pictures import drawn

        from .recorded_picture import recorded_figure

        chosen = [self[name] for name in names] or self.recordings[:3]
        return drawn(lambda: recorded_figure(self, chosen))

    def __getitem__(self, name: str) -> Recording:
        """The recording of a name."""
        named = {recording.name: recording for recording in self.recordings}
        if name not in named:
            hint = nearest(name, named)
            raise InputError(f"data set {self.name!r} has no recording {name!r}; {hint}")
        return named[name]

    @classmethod
    def from_frames(
        cls,
        frames: Any,
        mechanism: Any,
        *,
        angle: Names,
        torque: Names = None,
        time: str | Mapping[str, str] | None = None,
        velocity: Names = None,
        units: Units = None,
        signs: Mapping[str, Numbers] | None = None,
        motor: Mapping[str, Any] | None = None,
        torque_at: str = "motor",
        actuator: Mapping[str, Any] | None = None,
        base: Mapping[str, Any] | None = None,
        hold: str | None = None,
        sigma: Numbers | Mapping[str, Numbers] | None = None,
        parameters: Mapping[str, Mapping[str, float]] | None = None,
        covariates: Mapping[str, str] | None = None,
        missing: str = "refuse",
        split: str | None = None,
        name: str = "data",
    ) -> "Dataset":
        """Data set of pandas DataFrames, one for each recording; the frames stay as they are.

        Whatever a dataset.toml can say of the columns of its tables is an argument here.

        Parameters
        ----------
        frames : mapping of str to DataFrame, or one DataFrame
            By the names of the recordings.
        mechanism : Mechanism
            Such as `frictionid.mechanisms.pendulum(mass=0.4, length=0.25)`.
        angle, velocity : str or list of str
            Columns, one for each joint.
        torque : str, list of str or None, or None
            Columns; None for a joint without motor, or where there is none at all.
        time : str, or mapping of "angle" and "torque" to str, where these have clocks of their own
            None: the index of the frames. Moments and durations count in seconds.
        units : str, list of str, or mapping of "time", "angle", "velocity", "torque" to these
            A single one is that of the angles ("deg", "mm"), and per second of the velocities; a
            list has one for each joint. Default: s, rad, rad/s, N m.
        signs : mapping of "angle", "torque" to 1 or -1, or one for each joint
        motor : mapping of "kt" [N m/A], "gear" ... to a number, or one for each joint
            Where the columns of `torque` hold currents, in units of "A" or "mA", or columns are of
            the motors: the keys of [motor] in a dataset.toml.
        torque_at : "motor", "link" or "command"
            The motors', those of sensors at the links (which show no friction), or asked for ones.
        actuator : mapping of "target", "output", "P" ... to columns and numbers
            Where torque follows from a controller: the keys of [actuator] in a dataset.toml
        base : mapping of "angular_velocity", "specific_force" ... to columns, and numbers
            Sensors on a floating base: the keys of [base] in a dataset.toml
        hold : "previous" or "linear"
            What the torque does between two samples; see `Signal`.
        sigma : float, one for each joint, or mapping of "angle", "velocity", "torque" to these
            Standard deviation of the noise, in the unit of the columns; without a name the angles'.
        parameters : mapping of str to mapping of str to float
            Parameters of the mechanism that differ in some recordings.
        covariates : mapping of str to str
            Columns of other quantities, such as a temperature, by their names.
        missing : "refuse" or "drop"
            What happens with rows without angles.
        split : str, optional
            Column at whose changes another recording begins; of the time, where it starts again.
        name : str
            Name of the data set.

        Raises
        ------
        InputError
            Where a column is missing, holds no numbers, or its time does not increase.

        Examples
        --------
        >>> import pandas as pd
        >>> frame = pd.DataFrame({"t": [0.0, 0.1, 0.2], "q": [0.0, 5.0, 9.0], "u": [1.0, 1.0, 0.0]})
        >>> rig = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 0.3}}
        >>> Dataset.from_frames({"run1": frame}, rig, time="t", angle="q", torque="u", units="deg")
        Dataset('data': 1 recording, 1 joint, 0.2 s)
        """
        columns = FrameColumns(time, angle, torque, velocity, units, signs or {}, motor, hold)
        columns = replace(columns, covariates=covariates or {}, missing=missing, split=split)
        columns = replace(columns, torque_at=torque_at, actuator=actuator, sigma=sigma, base=base)
        data = _of_reads(name, mechanism, columns.read_all(frames), parameters or {})
        return replace(data, columns=columns, gears=columns.gears, torque_at=torque_at)

    @classmethod
    def from_arrays(
        cls,
        arrays: Mapping[str, Any],
        mechanism: Any,
        *,
        units: Units = None,
        torque_at: str = "motor",
        hold: str | None = None,
        sigma: Numbers | Mapping[str, Numbers] | None = None,
        parameters: Mapping[str, Mapping[str, float]] | None = None,
        name: str = "data",
    ) -> "Dataset":
        """Data set of arrays, for each recording a mapping with "time", "angle" and "torque".

        "velocity" may stand beside, and "torque_time" where the torque has a clock of its own. Time
        has shape (T,), all else (T, n) or, of one joint, (T,); a torque has one column for each
        joint, of zeros where there is no motor, and is missing where there is none at all. For the
        rest see `from_frames`.

        Raises
        ------
        InputError
            Where an array is missing, lengths differ, or values are no finite numbers.

        Examples
        --------
        >>> time = np.linspace(0.0, 1.0, 11)
        >>> rig = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 0.3}}
        >>> Dataset.from_arrays({"decay": {"time": time, "angle": np.cos(5.0 * time)}}, rig)
        Dataset('data': 1 recording, 1 joint, 1 s)
        """
        reads: dict[str, Any] = {}
        for key, parts in arrays.items():
            frame, columns = columns_of_arrays(parts, str(key))
            columns = replace(columns, units=units, hold=hold, sigma=sigma)
            reads |= columns.read_all({key: frame})
        return replace(_of_reads(name, mechanism, reads, parameters or {}), torque_at=torque_at)

    def with_frames(self, frames: Any, name: str | None = None) -> "Dataset":
        """Data set of further frames of this rig, their columns read as those of this data set.

        Raises
        ------
        InputError
            Where this data set is not of frames, and as from `from_frames`.
        """
        if self.columns is None:
            raise InputError(
                f"data set {self.name!r} was not read from frames: use Dataset.from_frames"
            )
        data = _of_reads(name or self.name, self.mechanism, self.columns.read_all(frames), {})
        return replace(data, columns=self.columns, gears=self.gears, torque_at=self.torque_at)


def _of_reads(
    name: str,
    mechanism: Any,
    reads: Mapping[str, tuple[Recorded, str]],
    parameters: Mapping[str, Mapping[str, float]],
) -> Dataset:
    """Data set of signals by the names of the recordings."""
    machine = as_mechanism(mechanism)
    for key, values in parameters.items():
        if key not in reads:
            raise InputError(f"parameters: there is no recording {key!r}; {nearest(key, reads)}")
        try:
            machine.check_values(values)
        except InputError as error:
            raise InputError(f"recording {key!r}: {error}") from None
    recordings = tuple(
        Recording(key, parameters=dict(parameters.get(key, {})), **signals._asdict())
        for key, (signals, _) in reads.items()
    )
    data = Dataset(name, machine, recordings, {key: sha for key, (_, sha) in reads.items()})
    where = f"data set {name!r}: recording {data.recordings[0].name!r}"
    check_columns(column_count(data.recordings[0].angle), machine, where)
    return data
