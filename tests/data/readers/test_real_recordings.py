"""The real double pendulum's recordings: they are the described files, in the described units."""

import numpy as np
import pytest

from frictionid.data.readers.dataset import load_dataset

pytestmark = pytest.mark.real

DATA = {"dfki_c1": 7, "dfki_c1_swingup": 4}


@pytest.fixture(scope="module", params=DATA)
def dataset(request, real_data):
    """Each of the data sets, its tables named as by --data."""
    folder = request.config.rootpath / "data" / request.param
    return load_dataset(folder, data=real_data / "dfki_double_pendulum")


def test_time_is_in_seconds(dataset):
    """The controller ran at 500 Hz, with jitter to 9 ms."""
    for recording in dataset.recordings:
        steps = np.diff(recording.angle.time)
        assert 1.5e-3 < np.median(steps) < 2.5e-3
        assert steps.max() < 9e-3


def test_angles_are_in_radians_from_hanging_at_rest(dataset):
    """Every run starts hanging; the encoders resolve 3.8e-4 rad, whole turns do not occur."""
    for recording in dataset.recordings:
        angle = recording.angle.value
        assert np.abs(angle[0]).max() < 0.05
        assert np.abs(angle).max() < np.pi
        assert np.diff(np.unique(angle[:, 0])).min() == pytest.approx(3.815e-4, rel=0.01)


def test_torques_are_in_newton_metres(dataset):
    """The drives peak below 4 N m and resolve 5.9e-3 N m; no joint reports none at all."""
    for recording in dataset.recordings:
        torque = recording.torque.value
        assert recording.torque.hold == "linear"
        assert np.abs(torque).max() < 4.0
        assert np.all(np.ptp(torque, axis=0) > 0)
        assert np.diff(np.unique(torque[:, 0])).min() == pytest.approx(5.86e-3, rel=0.01)


def test_swing_ups_are_cut_to_their_motion_and_the_others_are_whole(dataset):
    spans = [recording.angle.time[-1] - recording.angle.time[0] for recording in dataset.recordings]
    if dataset.name == "dfki_c1_swingup":
        assert all(3.98 < span <= 4.0 for span in spans)
        assert all(recording.angle.value[-1, 0] > 2.3 for recording in dataset.recordings)
    else:
        np.testing.assert_allclose(spans, [10.0] * 6 + [6.0], atol=0.01)
