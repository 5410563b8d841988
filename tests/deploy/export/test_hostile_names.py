"""Names of joints and data sets are text: none of them becomes code."""

import numpy as np
import pytest
import yaml
from structured_text_runner import StructuredText
from targets import compiled, written
from test_programs import LAWS, friction_by

from frictionid.deploy.export.exported import exported
from frictionid.friction import at_rest

HOSTILE = 'a"""\nplanted = 1\n#\\ */ planted /* *) planted (* ??/ {planted} %'


@pytest.fixture
def own():
    friction = friction_by(LAWS["coulomb_viscous"], np.random.default_rng(15))
    friction = friction.noted({"dataset": HOSTILE})
    return exported(friction, (HOSTILE, "knee"), (2.0, 3.0))


def test_python_runs_nothing_of_a_name(own, tmp_path):
    module: dict = {}
    exec(written(own, "python", tmp_path)[".py"].read_text(), module)
    assert "planted" not in module
    assert "planted" in module["__doc__"]


def test_c_and_structured_text_are_read_as_before(own, tmp_path):
    """Compiled and parsed, they compute what the model computes."""
    assert hasattr(compiled(own, tmp_path), "friction_torque")
    block = StructuredText(written(own, "st", tmp_path)[".st"].read_text())
    block.call(w={(1,): 1.0, (2,): 1.0})
    torque = own.friction.law.torque(own.friction.theta, at_rest(np.ones(2)), ())
    np.testing.assert_allclose([*block.variables["Tf"].values()], torque, rtol=1e-9)


def test_yaml_and_latex_have_it_on_one_line(own, tmp_path):
    document = yaml.safe_load(written(own, "yaml", tmp_path)[".yaml"].read_text())
    assert "planted" in document["joints"][0]["name"] and set(document) == {
        *("format", "name", "joints")
    }
    lines = written(own, "latex", tmp_path)[".tex"].read_text().splitlines()
    assert not [line for line in lines if line.startswith("planted")]
