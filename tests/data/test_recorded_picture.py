"""A data set shows itself: what its table and its picture mark is what was planted."""

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.recorded_picture import losses_of, quiet_spans
from frictionid.data.signals import Signal


@pytest.fixture
def data():
    """A swing of 2 s, at rest to 4 s, with a gap from 1 to 1.5 s and two samples missing."""
    t = np.arange(400) * 0.01
    keep = np.ones(400, dtype=bool)
    keep[[20, 60, *range(101, 150)]] = False
    q = np.where(t < 2.0, np.sin(np.pi * t) ** 2, 0.0)
    runs = {"<a>$b": {"time": t[keep], "angle": q[keep], "torque": q[keep]}}
    return fid.Dataset.from_arrays(runs, fid.mechanisms.pendulum(mass=1.0, length=0.3))


def test_what_is_missing_and_at_rest_is_found(data):
    (recording,) = data.recordings
    gaps, dropped = losses_of(recording.angle.time)
    assert_allclose(gaps, [[1.0, 1.5]])
    assert_allclose(dropped, [0.19, 0.59])
    ((start, stop),) = quiet_spans(recording.angle, data.scales.slow)
    assert start == pytest.approx(2.0, abs=0.15) and stop == pytest.approx(3.99)


def test_a_table_and_a_picture_show_it(data):
    text = data._repr_html_()
    assert "<td>&lt;a&gt;$b</td><td>3.99</td><td>349</td><td>100</td><td>2</td><td>1</td>" in text
    assert isinstance(data.plot(), Figure) and len(data.plot("<a>$b").axes) == 2
    with assert_refused("no recording 'c'"):
        data.plot("c")


def test_without_motors_there_is_no_row_of_torques():
    t = np.linspace(0.0, 3.0, 301)
    rig = fid.mechanisms.pendulum(mass=1.0, length=0.3)
    data = fid.Dataset.from_arrays({"decay": {"time": t, "angle": np.cos(5 * t)}}, rig)
    assert len(data.plot().axes) == 1
    still = Signal(t, np.zeros((301, 1)))
    assert_allclose(quiet_spans(still, data.scales.slow), [[0.0, 3.0]])
