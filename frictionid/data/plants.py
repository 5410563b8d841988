"""Plants of data sets: the mechanism with the parameters of each recording."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.mechanics import Plant, unit_inertia

from .recordings import Dataset, Recording
from .signals import sample


def plant_of(dataset: Dataset, parameters: Mapping[str, float] | None = None) -> Plant:
    """Plant of a data set with one batch entry for each recording, shape (R,).

    `parameters` replace those of the mechanism (such as a published model's inertias); parameters
    of a recording (such as an exchangeable mass) take precedence.

    Raises
    ------
    InputError
        For parameters that a machine cannot have (see `Mechanism.nominal`), columns that are
        not one per joint.
    """
    mechanism = dataset.mechanism
    _check_columns(dataset)
    # most recordings have the same parameters: these are completed and checked once
    parameter_sets = [tuple(sorted(r.parameters.items())) for r in dataset.recordings]
    different = {pairs: k for k, pairs in enumerate(dict.fromkeys(parameter_sets))}
    each = [mechanism.nominal({**(parameters or {}), **dict(pairs)}) for pairs in different]
    at = np.array([different[pairs] for pairs in parameter_sets])
    plant = Plant.from_parameters(
        mechanism, {k: np.array([e[k] for e in each])[at] for k in mechanism.defaults}
    )
    return replace(plant, slow=tuple(dataset.scales.slow.tolist()))


_UNKNOWN = (
    "the mechanism's base moves (floating = true), and nothing says how: name the columns of its "
    "IMU or pose in [base]; where it stands still or is held, leave floating out"
)
_UNUSED = "[base] says how the base moves: say floating = true in [mechanism], or delete [base]"


def on_recorded_base(plant: Plant, recording: Recording, time: Array) -> Plant:
    """The plant with the motion of its base at times (S,) of a recording, one entry for each."""
    motion = recording.base_motion
    return plant if motion is None else plant.on_base(sample(motion, time))


def _check_columns(dataset: Dataset) -> None:
    """Refuse recordings of other joints than the mechanism's."""
    mechanism = dataset.mechanism
    kind, n = mechanism.kind, mechanism.n
    for recording in dataset.recordings:
        if mechanism.floating != (recording.base_motion is not None):
            where = f"data set {dataset.name!r}, recording {recording.name!r}"
            raise InputError(f"{where}: {_UNKNOWN if mechanism.floating else _UNUSED}")
        for quantity, signal in (("angle", recording.angle), ("torque", recording.torque)):
            columns = np.shape(signal.value)[1]
            if columns != n:
                raise InputError(
                    f"data set {dataset.name!r}, recording {recording.name!r}: {columns} columns "
                    f"of {quantity}, but {kind} has {n} joint{'s' if n > 1 else ''}; give one "
                    "column per joint, or another kind in [mechanism]"
                )


def torque_without_motor(dataset: Dataset) -> dict[int, str]:
    """Joints (from 0) without motor that have a torque, each with a sentence; none is right.

    >>> from frictionid.data.recordings import Recording
    >>> from frictionid.data.signals import Signal
    >>> from frictionid.mechanics import acrobot
    >>> both = Signal(np.array([0.0, 1.0]), np.array([[0.2, 0.1], [0.0, 0.3]]))
    >>> machine = Dataset("rig", acrobot(), (Recording("a", both, both),))
    >>> torque_without_motor(machine)
    {0: "torque 1 is up to 0.2 N m (recording 'a'), but joint 1 of acrobot has no motor"}
    """
    mechanism = dataset.mechanism
    out = {}
    for j in np.flatnonzero(~np.array(mechanism.driven)).tolist():
        tops = [float(np.abs(r.torque.value[:, j]).max()) for r in dataset.recordings]
        if max(tops) > 0:
            name = dataset.recordings[int(np.argmax(tops))].name
            out[j] = (
                f"torque {j + 1} is up to {max(tops):.3g} {mechanism.torque_units[j]} "
                f"(recording {name!r}), but joint {j + 1} of {mechanism.kind} has no motor"
            )
    return out


NO_MOTOR_REMEDY = (
    'leave its column empty (""), or declare the motor (driven, or another kind, in [mechanism])'
)


LINK_TORQUE = (
    'the torques are of sensors at the links, behind motors and gears (torque.at = "link"): their '
    "friction, and the inertia of rotors, is not in what is measured, so that no fit can find it"
)
LINK_TORQUE_REMEDY = (
    'give the torques or currents of the motors; or say torque.at = "motor" if these are'
)


def refuse_torques(dataset: Dataset) -> None:
    """Raise InputError for torques that no fit of friction can use.

    Torques of joints without motor, and those that sensors at the links measure.
    """
    for sentence in torque_without_motor(dataset).values():
        raise InputError(f"data set {dataset.name!r}: {sentence}; {NO_MOTOR_REMEDY}")
    if dataset.torque_at == "link" and dataset.actuated.any():
        raise InputError(f"data set {dataset.name!r}: {LINK_TORQUE}; {LINK_TORQUE_REMEDY}")


def unit_inertia_plant(dataset: Dataset) -> Plant:
    """Plant of unit inertias, see `unit_inertia`, with one batch entry for each recording."""
    mechanism = unit_inertia(dataset.mechanism.position_units)
    plant = Plant.from_parameters(mechanism, {"inertia": np.ones(len(dataset.recordings))})
    return replace(plant, slow=tuple(dataset.scales.slow.tolist()))
