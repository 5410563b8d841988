"""A mechanism with its parameters, as the physics step needs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.mechanics.mechanism import Mechanism, Terms
from frictionid.mechanics.mechanism_table import mechanism_of, parameters_of
from frictionid.mechanics.unit_inertia import unit_inertia


@dataclass(frozen=True)
class Plant:
    """A mechanism with physical parameters and the base parameters p that follow from them.

    `parameters` are arrays of one batch shape (...), often one entry per recording or row; p has
    shape (..., nb). An index into a plant picks from the batch.

    >>> from frictionid.mechanics import pendulum
    >>> Plant.from_parameters(pendulum(), {"mass": np.array([0.5, 1.0])})[1].p
    array([1.  , 9.81])
    """

    mechanism: Mechanism
    parameters: Mapping[str, Array]
    p: Array

    @staticmethod
    def from_parameters(mechanism: Mechanism, parameters: Mapping[str, Any]) -> Plant:
        """Plant of physical parameters, missing ones at their defaults; SI units."""
        values = {**mechanism.defaults, **parameters}
        xp = namespace(*values.values())
        # not asarray on tensors, which would cut off their gradient
        arrays = xp.broadcast_arrays(
            *(
                v if hasattr(v, "detach") else xp.asarray(v, dtype=xp.float64)
                for v in values.values()
            )
        )
        full = dict(zip(values, arrays, strict=True))
        return Plant(mechanism, full, mechanism.base(full))

    def __getitem__(self, index: Any) -> Plant:
        return Plant(
            self.mechanism, {k: v[index] for k, v in self.parameters.items()}, self.p[index]
        )

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.mechanism.n

    def terms(self, q: Array, w: Array) -> Terms:
        """Terms of the equations of motion, see `Terms`."""
        return self.mechanism.terms(self.p, q, w)

    def dynamics(self, q: Array, w: Array) -> tuple[Array, Array]:
        """M (..., n, n) and h (..., n)."""
        return self.mechanism.dynamics(self.p, q, w)

    def load(self, q: Array, w: Array, u: Array) -> Array:
        """Bearing force in friction-free motion, shape (..., n) [N]."""
        return self.mechanism.load(self.parameters, q, w, u)


def plant_of(dataset: Dataset, parameters: Mapping[str, float] | None = None) -> Plant:
    """Plant of a data set with one batch entry for each recording, shape (R,).

    `parameters` replace those of the table (such as a published model's inertias); parameters of a
    recording (such as an exchangeable mass) take precedence.

    Raises
    ------
    InputError
        For parameters that a machine cannot have (see `parameters_of`), columns that are
        not one per joint.
    """
    table: Mapping[str, Any] = dataset.mechanism
    mechanism = mechanism_of(table)
    _check_columns(dataset, mechanism)
    nominal = {**table, "parameters": {**table.get("parameters", {}), **(parameters or {})}}
    each = [parameters_of(nominal, recording.parameters) for recording in dataset.recordings]
    return Plant.from_parameters(
        mechanism, {k: np.array([e[k] for e in each]) for k in mechanism.defaults}
    )


def _check_columns(dataset: Dataset, mechanism: Mechanism) -> None:
    """Refuse recordings of other joints than the mechanism's."""
    kind, n = mechanism.kind, mechanism.n
    for recording in dataset.recordings:
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
    >>> both = Signal(np.array([0.0, 1.0]), np.array([[0.2, 0.1], [0.0, 0.3]]))
    >>> machine = Dataset("rig", {"kind": "acrobot"}, (Recording("a", both, both),))
    >>> torque_without_motor(machine)
    {0: "torque 1 is up to 0.2 N m (recording 'a'), but joint 1 of acrobot has no motor"}
    """
    description = mechanism_of(dataset.mechanism)
    out = {}
    for j in np.flatnonzero(~np.array(description.driven)).tolist():
        tops = [float(np.abs(r.torque.value[:, j]).max()) for r in dataset.recordings]
        if max(tops) > 0:
            name = dataset.recordings[int(np.argmax(tops))].name
            out[j] = (
                f"torque {j + 1} is up to {max(tops):.3g} {description.torque_units[0]} "
                f"(recording {name!r}), but joint {j + 1} of {description.kind} has no motor"
            )
    return out


NO_MOTOR_REMEDY = (
    'leave its column empty (""), or declare the motor (driven, or another kind, in [mechanism])'
)


def refuse_torque_without_motor(dataset: Dataset) -> None:
    """Raise InputError where a joint without motor has a torque: no fit could use it."""
    for sentence in torque_without_motor(dataset).values():
        raise InputError(f"data set {dataset.name!r}: {sentence}; {NO_MOTOR_REMEDY}")


def unit_inertia_plant(dataset: Dataset) -> Plant:
    """Plant of unit inertias, see `unit_inertia`, with one batch entry for each recording."""
    nominal = mechanism_of(dataset.mechanism)
    mechanism = unit_inertia(nominal.position_units)
    return Plant.from_parameters(mechanism, {"inertia": np.ones(len(dataset.recordings))})
