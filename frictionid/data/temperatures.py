"""Temperatures of recordings: the covariates `temperature`, or `temperature_JOINT`, in degC."""

from collections.abc import Sequence

import numpy as np

from .recordings import Recording
from .signals import Array, sample

TEMPERATURE = "temperature"


def temperature_at(recording: Recording, time: Array, joints: Sequence[str]) -> Array | None:
    """Temperature (K, n) [degC] of each joint at times (K,) [s]; None unless all have one.

    A joint has the covariate `temperature_NAME` with its name, else `temperature_2` with its
    number from 1, else `temperature` of the whole machine.

    >>> from frictionid.data.signals import Signal
    >>> angle, warm = (Signal(np.array([0.0, 1.0]), np.array([[20.0], [30.0]])),) * 2
    >>> run = Recording("a", angle, angle, covariates={"temperature": warm})
    >>> temperature_at(run, np.array([0.5]), ["hip", "knee"])
    array([[25., 25.]])
    """
    columns = []
    for number, joint in enumerate(joints, 1):
        names = f"{TEMPERATURE}_{joint}", f"{TEMPERATURE}_{number}", TEMPERATURE
        covariates = [recording.covariates[name] for name in names if name in recording.covariates]
        if not covariates:
            return None
        columns.append(sample(covariates[0], time)[:, 0])
    return np.stack(columns, axis=-1)
