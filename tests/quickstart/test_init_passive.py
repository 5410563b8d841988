"""frictionid init: tables without a torque are of machines that no motor drives."""

import numpy as np
import pandas as pd
from fixtures.lab_tables import INIT
from fixtures.true_curves import plain_friction

from frictionid.data.readers.dataset import load_dataset
from frictionid.simulate import Camera, Rig, Run, simulate


def test_a_table_without_torque_is_of_a_passive_pendulum(run, tmp_path):
    (tmp_path / "drop").mkdir()
    time = np.arange(200) / 100.0
    frame = pd.DataFrame({"t": time, "q": np.sin(5 * time), "w": 5 * np.cos(5 * time)})
    frame.to_csv(tmp_path / "drop/run.csv", index=False)
    code, out, _ = run(tmp_path, "init", "drop", *INIT.split())
    assert code == 0 and "passive motion" in out
    data = load_dataset(tmp_path / "drop")
    assert data.mechanism.driven == (False,) and not data.recordings[0].torque.value.any()


def test_angles_of_a_passive_chain_from_upright_become_those_of_its_joints(run, tmp_path):
    """Against the vertical, beside a column that never changes, of a cart that stands still."""
    links = {"m1": 0.1, "m2": 0.14, "l1": 0.17, "r1": 0.11, "r2": 0.12, "I1": 2e-3, "I2": 3e-3}
    machine = {"kind": "double_pendulum", "driven": [False, False], "parameters": links}
    friction, camera = plain_friction([1e-3, 1e-3], [1e-4, 1e-4]), Camera(600, 60.0, 1e-4)
    runs = (Run("long", (1.2, -0.4)),)
    (true,) = simulate(Rig("p", machine, friction, camera, runs, substeps=8)).recordings
    theta = np.pi + np.cumsum(true.angle.value, axis=1)
    columns = {"t": true.angle.time, "theta1": theta[:, 0], "theta2": theta[:, 1], "cart": 0.0}
    (tmp_path / "chain").mkdir()
    pd.DataFrame(columns).to_csv(tmp_path / "chain/run.csv", index=False)
    values = [word for name, value in links.items() for word in ("--set", f"{name}={value}")]
    code, out, _ = run(tmp_path, "init", "chain", "--mechanism", "double_pendulum", *values)
    assert code == 0 and "passive motion" in out and "add +180 degrees to angle 1" in out
    read = load_dataset(tmp_path / "chain")
    assert read.mechanism.driven == (False, False)
    turns = (read.recordings[0].angle.value - true.angle.value) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-6)
