"""Friction as ONNX and TorchScript: what goes in, and what the files say of themselves."""

import subprocess
import sys

import numpy as np
import onnxruntime
import pytest
import torch
from targets import loaded, written
from test_programs import LAWS, exported_by, friction_by

from frictionid.deploy.export.exported import exported
from frictionid.friction import Inputs
from frictionid.friction import laws as known


@pytest.mark.parametrize("law", [known.WindowMLP(samples=3, hidden=(4,)), LAWS["lugre"]])
def test_torchscript_takes_a_history_and_gives_the_torque_at_its_end(law, tmp_path):
    rng = np.random.default_rng(9)
    own = exported(friction_by(law, rng), speeds=(2.0, 3.0))
    history, dt = 2.0 * rng.standard_normal((5, 6, 2)), 1 / 60
    module = loaded(written(own, "torchscript", tmp_path)[".pt"])
    zero, theta, memory = np.zeros((5, 2)), own.friction.theta, ()
    for k in range(6):
        x = Inputs(zero, history[:, k], zero, zero)
        memory = (
            own.friction.law.advance(theta, x, memory, np.array([dt]))
            if k
            else own.friction.law.start(theta, x)
        )
    found = module(torch.tensor(history), 0.0 if law.sample_time else dt)
    np.testing.assert_allclose(found, own.friction.law.torque(theta, x, memory), atol=1e-9)


def test_torchscript_is_read_without_this_package(tmp_path):
    own = exported(friction_by(known.MLP((3,)), np.random.default_rng(10)), speeds=(2.0, 3.0))
    path = written(own, "torchscript", tmp_path, precision="float")[".pt"]
    script = (
        "import sys, warnings; warnings.simplefilter('ignore'); import torch; "
        "module = torch.jit.load(sys.argv[1]); print(module(torch.ones(1, 2)).dtype); "
        "print(module.facts); assert 'frictionid' not in sys.modules"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("torch.float32")
    for fact in own.facts:
        assert fact in done.stdout


def test_an_onnx_model_says_units_signs_and_range(tmp_path):
    own = exported_by(LAWS["lugre"], 8, ("hip", "knee"))
    session = onnxruntime.InferenceSession(str(written(own, "onnx", tmp_path)[".onnx"]))
    said = session.get_modelmeta().custom_metadata_map
    assert said["joints"] == "hip, knee"
    for fact in own.facts:
        assert fact in said["friction"]
    shapes = {x.name: x.shape for x in session.get_inputs()}
    assert shapes == {"w": ["batch", 2], "memory": ["batch", 1, 2], "dt": [1]}
