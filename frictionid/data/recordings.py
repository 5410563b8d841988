"""Recordings and data sets, checked when they are made."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, get_args

import numpy as np

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism, as_mechanism

from .frames import (
    Keys,
    Names,
    Noise,
    Numbers,
    Times,
    Units,
    by_name,
    columns_of_arrays,
    read_frames,
    toml_of_columns,
)
from .joint_scales import JointScales, joint_scales
from .readers.column_toml import Gears, TorqueAt
from .readers.dataset_toml import DatasetToml
from .recording import Recording
from .recording import TrueMotion as TrueMotion
from .servo import Servo
from .signals import column_count


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
    columns: DatasetToml | None = None
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
        for name in (self.name, *self.names):
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
    def names(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(r.name for r in self.recordings)

    @property
    def seconds(self) -> float:
        """Length of all recordings [s]."""
        return sum(r.angle.duration for r in self.recordings)

    @property
    def driven_joints(self) -> list[int]:
        """Joints (from 0) with a motor."""
        return [j for j, motor in enumerate(self.mechanism.driven) if motor]

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
        return (
            f"Dataset({self.name!r}: {len(recordings)} recording{'s' * (len(recordings) > 1)}, "
            f"{joints} joint{'s' * (joints > 1)}, {self.seconds:g} s)"
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
        time: Times = None,
        velocity: Names = None,
        units: Units = None,
        signs: Mapping[str, Numbers] | None = None,
        motor: Keys = None,
        torque_at: str = "motor",
        actuator: Keys = None,
        base: Keys = None,
        hold: str | None = None,
        sigma: Noise = None,
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
        toml = toml_of_columns(
            time=time,
            angle=angle,
            torque=torque,
            velocity=velocity,
            units=units,
            signs=signs,
            motor=motor,
            torque_at=torque_at,
            actuator=actuator,
            base=base,
            hold=hold,
            sigma=sigma,
            covariates=covariates,
            missing=missing,
            split=split,
        )
        data = _of_frames(name, mechanism, [(toml, frames)], parameters or {})
        return replace(data, columns=toml, gears=toml.gears, torque_at=torque_at)

    @classmethod
    def from_arrays(
        cls,
        arrays: Mapping[str, Any],
        mechanism: Any,
        *,
        units: Units = None,
        torque_at: str = "motor",
        hold: str | None = None,
        sigma: Noise = None,
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
        parts = []
        for key, signals in by_name(arrays, "arrays of recordings").items():
            frame, columns = columns_of_arrays(signals, str(key))
            toml = toml_of_columns(**columns, units=units, hold=hold, sigma=sigma)
            parts.append((toml, {key: frame}))
        return replace(_of_frames(name, mechanism, parts, parameters or {}), torque_at=torque_at)

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
        data = _of_frames(name or self.name, self.mechanism, [(self.columns, frames)], {})
        return replace(data, columns=self.columns, gears=self.gears, torque_at=self.torque_at)


def _of_frames(
    name: str,
    mechanism: Any,
    parts: Iterable[tuple[DatasetToml, Any]],
    parameters: Mapping[str, Mapping[str, float]],
) -> Dataset:
    """Data set of frames, each with what its columns are."""
    machine, reads = as_mechanism(mechanism), dict[str, tuple[Recording, str]]()
    for key, values in by_name(parameters, "parameters").items():
        try:
            machine.check_values(values)
        except InputError as error:
            raise InputError(f"recording {key!r}: {error}") from None
    for toml, frames in parts:
        reads |= read_frames(toml, frames, parameters)
    for key in parameters:
        if key not in reads:
            raise InputError(f"parameters: there is no recording {key!r}; {nearest(key, reads)}")
    recordings = tuple(recording for recording, _ in reads.values())
    data = Dataset(name, machine, recordings, {key: sha for key, (_, sha) in reads.items()})
    count, n = column_count(recordings[0].angle), machine.n
    if count != n:
        raise InputError(
            f"data set {name!r}: recording {recordings[0].name!r} has {count} "
            f"column{'s' * (count > 1)} of angles, but {machine.kind} has {n} joint{'s' * (n > 1)};"
            " give one column per joint, or another mechanism"
        )
    return data
