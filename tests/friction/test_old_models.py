"""Model files of older versions: every law is read, and gives the torques that it gave then.

`old_models.json` holds a document of each law with the torque, the break-away level and the memory
that the version which wrote it computed 0.01 s, or a sample, after the memory's start.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from frictionid.comparison.registry import LAWS
from frictionid.friction import Inputs
from frictionid.friction.model_files import read_model

STORED = json.loads(Path(__file__).with_name("old_models.json").read_text(encoding="utf-8"))
X = Inputs(**{name: np.array(value) for name, value in STORED["inputs"].items()})
MODELS = {entry["model"]["law"]["kind"]: entry for entry in STORED["laws"]}


def test_every_law_has_an_old_file():
    assert set(MODELS) == set(LAWS)


@pytest.mark.parametrize("entry", MODELS.values(), ids=MODELS)
def test_old_files_give_the_torques_that_they_gave(entry):
    friction = read_model(entry["model"], LAWS, "old.json")
    law, theta = friction.law, friction.theta
    dt = np.full((1,), law.sample_time or 0.01)
    memory = law.advance(theta, X._replace(w=X.w[::-1]), law.start(theta, X), dt)
    memory = tuple(np.broadcast_to(value, X.w.shape) for value in memory)
    same = {"rtol": 1e-12, "atol": 1e-15}
    np.testing.assert_allclose(np.reshape(memory, (-1, 3, 2)), _array(entry["memory"]), **same)
    np.testing.assert_allclose(law.torque(theta, X, memory), entry["torque"], **same)
    limit = law.limit(theta, X, memory) + 0.0 * X.w
    np.testing.assert_allclose(limit, entry["limit"], **same)


def _array(values):
    return np.reshape(values, (-1, 3, 2))


def test_old_files_keep_sensor_corrections_under_the_name_rig():
    with_rig = [entry["model"] for entry in MODELS.values() if "rig" in entry["model"]]
    assert with_rig
    for model in with_rig:
        calibration = read_model(model, LAWS, "old.json").calibration
        np.testing.assert_array_equal(calibration.gain, [1.0, 0.97])
        np.testing.assert_array_equal(calibration.offset, [0.01, -0.01])
