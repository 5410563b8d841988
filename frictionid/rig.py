"""What a fit found about the machine and its sensors, beside friction.

A recorded torque u and angle q belong to the true ones by

u_true(t) = gain u(t - delay) + bias,    q_true = q - offset.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.mechanics import Plant, mechanism_of, parameters_of, plant_of
from frictionid.recordings import Dataset, Recording
from frictionid.signals import Signal


@dataclass(frozen=True)
class Rig:
    """Base parameters of the machine, and what its sensors do; leading axes are batches.

    base (..., nb), or None where the data set's hold; gain (..., n); delay (...) [s], positive
    where the torque acts later than it was logged; bias (..., n) [N m]; offset (..., n) [rad].

    >>> rig = Rig.ideal(2)
    >>> rig.gain, float(rig.delay)
    (array([1., 1.]), 0.0)
    """

    base: Array | None
    gain: Array
    delay: Array
    bias: Array
    offset: Array

    @staticmethod
    def ideal(n: int, base: Array | None = None) -> Rig:
        """Rig of n joints without any fault."""
        return Rig(base, np.ones(n), np.zeros(()), np.zeros(n), np.zeros(n))

    def __getitem__(self, index: Any) -> Rig:
        """Rig at an index into the batch axes."""
        base = None if self.base is None else self.base[index]
        return Rig(base, *(x[index] for x in (self.gain, self.delay, self.bias, self.offset)))


def stacked(rigs: list[Rig]) -> Rig:
    """One rig with a new leading batch axis."""
    parts = {name: np.stack([getattr(r, name) for r in rigs]) for name in _SENSORS}
    bases = [r.base for r in rigs]
    known = [base for base in bases if base is not None]
    return Rig(np.stack(known) if len(known) == len(bases) else None, **parts)


_SENSORS = ("gain", "delay", "bias", "offset")


def plant_under(dataset: Dataset, rig: Rig) -> Plant:
    """Plant of a data set, one entry for each recording, with the rig's base parameters.

    What a recording changes (an exchangeable mass) adds to them what it adds to the table's.

    Raises
    ------
    InputError
        Where the rig is that of another mechanism.
    """
    plant = plant_of(dataset)
    if rig.base is None:
        return plant
    table: Any = dataset.mechanism
    usual = mechanism_of(table).base(parameters_of(table, {}))
    if np.shape(rig.base)[-1] != len(usual):
        names = ", ".join(plant.mechanism.base_names)
        raise InputError(
            f"data set {dataset.name!r}: the model's rig has {np.shape(rig.base)[-1]} base "
            f"parameters, this mechanism has {len(usual)} ({names})"
        )
    return replace(plant, p=plant.p + (rig.base - usual))


def corrected(dataset: Dataset, rig: Rig) -> Dataset:
    """The data set as ideal sensors would have recorded it."""
    driven = np.array(mechanism_of(dataset.mechanism).description.driven, dtype=float)
    recordings = tuple(_corrected(r, rig, driven) for r in dataset.recordings)
    return replace(dataset, recordings=recordings)


def _corrected(recording: Recording, rig: Rig, driven: Array) -> Recording:
    angle, torque = recording.angle, recording.torque
    felt = (rig.gain * torque.value + rig.bias) * driven
    return replace(
        recording,
        angle=angle._replace(value=angle.value - rig.offset),
        torque=Signal(torque.time + rig.delay, felt, torque.hold, torque.sigma),
    )
