"""Motion so fast for its rate of samples that the smoother follows its noise."""

import numpy as np
import pandas as pd
import pytest

import frictionid as fid
from frictionid.fitting.shooting.data_checks import angle_noise
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.mechanics import pendulum

NOISE = 1e-3


@pytest.mark.parametrize("rate", [0.5, 1.0, 2.5, 4.0], ids="{} Hz".format)
def test_noise_does_not_vanish_in_fast_motion(rate):
    """At 60 samples a second; from 2.5 Hz on the smoother takes off nothing."""
    time, rng = np.arange(600) / 60.0, np.random.default_rng(0)
    swing = 3.0 * np.sin(2 * np.pi * rate * time) + 1.5 * np.sin(0.62 * np.pi * rate * time)
    angle = swing + rng.normal(scale=NOISE, size=time.shape)
    table = pd.DataFrame({"t": time, "q": angle, "u": np.sin(time)})
    data = fid.Dataset.from_frames({"r": table}, pendulum(), time="t", angle="q", torque="u")
    (noise,) = angle_noise(intervals_of(data))
    motion = 3.0 * (2 * np.pi * rate / 60.0) ** 3 / np.sqrt(20.0)  # third differences at most
    assert 0.3 * NOISE < noise < 1.5 * NOISE + motion
