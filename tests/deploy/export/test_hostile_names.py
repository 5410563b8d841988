"""Names of joints and data sets are text: none of them becomes code."""

import numpy as np
import pytest
import yaml
from structured_text_runner import StructuredText
from targets import compiled, written
from test_programs import LAWS, friction_by

from frictionid.deploy.export.exported import exported

HOSTILE = 'a"""\nplanted = 1\n#\\ */ planted /* *) planted (* ??/ {planted} %'


@pytest.fixture
def own():

    friction = friction_by(LAWS["stribeck"], np.random.default_rng(15))
    friction = friction.noted({"dataset": HOSTILE})
    return exported(friction, (HOSTILE, "knee"), (2.0, 3.0))


def test_python_runs_nothing_of_a_name(own, tmp_path):
    module: dict = {}
    exec(written(own, "python", tmp_path)[".py"].read_text(), module)
    assert "planted" not in module
    assert "planted" in module["__doc__"]


def test_c_and_structured_text_are_read_as_before(own, tmp_path):
    """Compiled and parsed, they say what they say of plain names."""
    friction = friction_by(LAWS["stribeck"], np.random.default_rng(15))
    plain, torques = exported(friction, ("hip", "knee"), (2.0, 3.0)), []
    for name, one in (("own", own), ("plain", plain)):
        (tmp_path / name).mkdir()
        assert hasattr(compiled(one, tmp_path / name), "friction_torque")
        block = StructuredText(written(one, "st", tmp_path / name)[".st"].read_text())
        block.call(w={(1,): 1.0, (2,): 1.0})
        torques.append(block.variables["Tf"])
    assert torques[0] == torques[1]
    assert all(torque > 0.0 for torque in torques[0].values())


def test_yaml_and_latex_have_it_on_one_line(own, tmp_path):
    document = yaml.safe_load(written(own, "yaml", tmp_path)[".yaml"].read_text())
    assert "planted" in document["joints"][0]["name"] and set(document) == {
        *("format", "name", "joints")
    }
    lines = written(own, "latex", tmp_path)[".tex"].read_text().splitlines()
    assert not [line for line in lines if line.startswith("planted")]
