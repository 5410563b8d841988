"""Training and test recordings of a sensitivity study."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal, taken

EVERY = 3  # the last of three recordings is held out
TRAINING = 0.7  # share of a recording's time, where there are fewer than three


def training_and_test(dataset: Dataset) -> tuple[Dataset, Dataset]:
    """Every third recording is held out; of fewer than three the last 30 % of each one's time.

    >>> from frictionid import load_dataset
    >>> train, test = training_and_test(load_dataset("acrobot_clean"))
    >>> len(train.recordings), len(test.recordings)
    (17, 8)
    """
    recordings = dataset.recordings
    if len(recordings) >= EVERY:
        held = np.arange(len(recordings)) % EVERY == EVERY - 1
        train = tuple(r for r, out in zip(recordings, held, strict=True) if not out)
        test = tuple(r for r, out in zip(recordings, held, strict=True) if out)
    else:
        train, test = zip(*map(_parts, recordings), strict=True)
    return replace(dataset, recordings=train), replace(dataset, recordings=test)


def _parts(recording: Recording) -> tuple[Recording, Recording]:
    """The recording before and after a moment; the torque keeps its samples."""
    begin, end = recording.angle.time[[0, -1]]
    moment = begin + TRAINING * (end - begin)

    def part(late: bool) -> Recording:
        def own(signal: Signal) -> Signal:
            return taken(signal, (signal.time >= moment) == late)

        velocity = recording.velocity and own(recording.velocity)
        return replace(recording, angle=own(recording.angle), velocity=velocity)

    return part(False), part(True)
