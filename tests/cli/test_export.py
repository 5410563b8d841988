"""frictionid export: what is written, what is said, and what is refused."""

import json
from functools import partial

import numpy as np
import pytest
from fixtures.refusals import assert_one_line

import frictionid as fid
from frictionid.friction.model_files import save_model


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.json"
    theta = np.array([[0.1, 0.05, 0.5, 0.02]] * 2)
    friction = fid.Friction(fid.Stribeck(), theta, provenance={"speeds": [5.0, 5.0]})
    save_model(friction, path)
    return path


URDF = """<robot name="r">
  <joint name="a" type="revolute"><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"/>
</robot>
"""


@pytest.fixture
def call(run, tmp_path):
    return partial(run, tmp_path, "export")


def test_joints_are_named_and_losses_are_said(call, model, tmp_path):
    (tmp_path / "r.urdf").write_text(URDF)
    code, out, _ = call(
        *(model, "--to", "urdf", "--out", "out.urdf", "--into", "r.urdf", "--joints", "a, b")
    )
    assert code == 0 and "no Stribeck" in out and "--dataset" in out
    assert (tmp_path / "out.urdf").read_text().count("<dynamics") == 2


def test_models_without_a_covariance_are_not_randomised(call, model, tmp_path):
    outcome = call(model, "--to", "isaac", "--out", "a.py", "--randomise", 5)
    assert_one_line(outcome, "no covariance")
    assert not (tmp_path / "a.py").exists()


def test_json_has_the_cost(call, model):
    code, out, _ = call(model, "--to", "isaac", "--out", "a.py", "--json")
    found = json.loads(out)
    assert code == 0 and found["cost"] is None
    assert len(found["lost"]) > 0 and len(found["written"]) == 1
