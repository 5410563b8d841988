"""Columns of motors become those of the joints that they turn."""

import numpy as np
from fixtures.dataset_files import assert_same, described, load_single, motion
from numpy.testing import assert_allclose

COUPLING = np.array([[30.0, 0.0], [20.0, -20.0]])
OFFSET = np.array([0.3, -0.1])


def test_columns_of_coupled_motors_become_those_of_the_joints(tmp_path):
    """Angles C (q - offset), torques with the same power: C' of them are those of the joints."""
    columns = motion()
    q, u = (np.stack([columns[f"{name}{j}"] for j in (1, 2)], axis=1) for name in ("q", "w"))
    driven = dict(zip(("p1", "p2"), COUPLING @ (q - OFFSET).T, strict=True))
    driven |= dict(zip(("i1", "i2"), np.linalg.solve(COUPLING.T, u.T), strict=True))
    motor = {"coupling": COUPLING.tolist(), "offset": OFFSET.tolist()}
    motor |= {"angle": "motor", "torque": "motor"}
    document = described(columns__angle=["p1", "p2"], columns__torque=["i1", "i2"], motor=motor)
    document["sigma"] = {"angle": 0.1}
    recording = load_single(tmp_path, document, a_csv=columns | driven)
    assert_allclose(recording.angle.value, q, atol=1e-12)
    assert_allclose(recording.torque.value, u, atol=1e-12)
    back = np.linalg.inv(COUPLING)
    assert_allclose(recording.angle.sigma, 0.1 * np.linalg.norm(back, axis=1))


def test_a_negative_gear_turns_angle_and_torque(tmp_path):
    columns = motion()
    driven = {"p1": 2.0 * columns["q1"], "p2": -5.0 * columns["q2"], "i2": columns["u2"] / -5.0}
    motor = {"gear": [2.0, -5.0], "angle": "motor", "torque": "motor"}
    document = described(columns__angle=["p1", "p2"], columns__torque=["", "i2"], motor=motor)
    recording = load_single(tmp_path, document, a_csv=columns | driven)
    assert_same(recording, load_single(tmp_path, described(), a_csv=columns), atol=1e-12)
