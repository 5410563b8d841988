"""Settings of shooting."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from frictionid.config import Count, Positive, validated
from frictionid.data.recordings import Dataset
from frictionid.data.signals import holds
from frictionid.errors import InputError
from frictionid.friction import Law

from ..parameter_block import ParameterBlock
from ..parameters import (
    BacklashBlock,
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    InertiaBlock,
    OffsetBlock,
    TargetDelayBlock,
)

WINDOWS = (5 / 60, 10 / 60, 20 / 60)
_RATE = 30.0  # [Hz]


@validated
class Settings:
    """How friction is refined by shooting.

    windows : lengths [s] of the windows, one stage after the other (5, 10 and 20 samples at 60 Hz);
        left as they are, they have no fewer samples than at 30 Hz where these are farther apart
    growing : whether shorter windows lead to the last ones; where a fit begins with a calibration
        of the same recordings, none do
    iterations : at most so many in the last stage; the others, which only lead there, have 4
    tolerance : a stage ends when no parameter moves by more than this share of its standard error
    huber : residuals beyond so many standard deviations count less
    fine : [s], shortest substeps, where a joint comes near rest
    significance : a block of sensors (delay, gain, bias, offset) whose deviation from an ideal
        sensor has a larger p-value is left out, and the fit repeated without it; 1 keeps all. By
        default a deviation stays that is larger than 2^(1/2)
        standard errors: there a model with it is expected to predict better [Akaike1974]
    """

    windows: Annotated[tuple[Positive, ...], Field(min_length=1)] = WINDOWS
    growing: bool = True
    iterations: Count = 40
    tolerance: Positive = 0.05
    huber: Positive = 2.5
    fine: Positive = 0.0007
    significance: Positive = 0.157

    def __post_init__(self) -> None:
        if list(self.windows) != sorted(self.windows):
            raise InputError(f"windows = {list(self.windows)} must grow: short ones converge first")

    def at(self, sample_time: float) -> "Settings":
        """The settings for samples so far apart [s]: windows that were not given follow them.

        >>> [round(60 * w) for w in Settings().at(1 / 60).windows], Settings().at(1.0).windows
        ([5, 10, 20], (2.5, 5.0, 10.0))
        """
        if self.windows != WINDOWS or _RATE * sample_time <= 1.0:
            return self
        return replace(self, windows=tuple(w * _RATE * sample_time for w in WINDOWS))


# A torque sampled by a drive acts later than it is logged, or is held from one sample to the next:
# both look like viscous friction where the delay is not free, as a controller does that gets its
# targets late. A wrong inertia and a bias look like friction, too.
DEFAULT_BLOCKS: tuple[ParameterBlock, ...] = (
    FrictionBlock(),
    InertiaBlock(offered=True),
    DelayBlock(offered=True),
    TargetDelayBlock(offered=True),
    BacklashBlock(offered=True),
    BiasBlock(offered=True),
    OffsetBlock(offered=True),
)


def torque_is_sampled(dataset: Dataset) -> bool:
    """Whether a recording has samples of a motor's torque, which do not follow from its servo."""
    return any(r.servo is None and np.any(r.torque.value) for r in dataset.recordings)


def is_driven(dataset: Dataset) -> bool:
    """Whether a motor acts in a recording: a torque, or a servo that is connected."""
    pairs = [(r.servo, r.angle.time) for r in dataset.recordings]
    connected = any(servo and np.any(servo.connected(time)) for servo, time in pairs)
    return connected or bool(dataset.actuated.any())


def applicable(
    blocks: Sequence[ParameterBlock], dataset: Dataset, law: Law | None = None
) -> tuple[ParameterBlock, ...]:
    """The blocks without those that are offered and mean nothing here.

    A delay is that of sampled torques, or of held targets; backlash is between a joint and the
    encoder of its servo; there is a bias where a motor drives, an offset of angles where none does
    (where one does, it is free if it would show), neither beside levels of each direction. Beside a
    network, which would take up what these show, only delays are offered.
    """
    sampled, servos = torque_is_sampled(dataset), dataset.servos
    # servos alone drive, by targets that are held from one sample to the next
    held = bool(servos) and all(holds(s.goal) for s in servos) and not sampled
    means = {"delay": sampled, "target_delay": held, "backlash": held, "bias": sampled or held}
    means["offset"] = not is_driven(dataset)
    if law is not None and any(name.endswith("_negative") for name in law.names):
        means |= {"bias": False, "offset": False}  # levels of each direction are the same
    if law is not None and law.is_network:
        means |= dict.fromkeys(("inertia", "backlash", "bias", "offset"), False)
    return tuple(b for b in blocks if not b.offered or means.get(b.name, True))
