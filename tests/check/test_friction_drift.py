"""Friction that changes from recording to recording is named, by its size; constant one is not."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.driven_pendulum import simulated

from frictionid.check import check
from frictionid.simulate import Camera, Multisine, Run

CAMERA = Camera(360, 60.0, 5e-4)


def recordings(levels):
    """One recording of 6 s with each Coulomb level [N m]."""
    out = []
    for k, level in enumerate(levels):
        runs = (Run(f"r{k}", (0.2 * k,), torques=(Multisine(1.2, (0.4 + 0.05 * k, 0.9, 1.6)),)),)
        out.append(simulated(level, 0.001, CAMERA, runs, length=0.4, seed=k))
    first = out[0]
    return replace(first, recordings=tuple(data.recordings[0] for data in out))


@pytest.mark.parametrize("rise", [0.4, -0.4, 0.0])
def test_friction_that_grows_or_falls_is_named_by_how_much(rise):
    middle = (np.arange(6) + 0.5) / 6 - 0.5
    levels = 0.25 * (1.0 + rise * middle)
    verdict = check(recordings(levels))
    named = [f for f in verdict.findings if f.kind == "friction_drift"]
    assert len(named) == (rise != 0.0)
    for f in named:
        assert f.joint == 1 and abs(f.numbers["change"] - rise) < 0.15 * abs(rise)
        assert ("grows" if rise > 0 else "falls") in f.text and verdict.level == "doubtful"
