"""Friction as a Python module that needs nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from test_programs import GROUPS, LAWS, N, friction_by

from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.friction import Inputs


@pytest.mark.parametrize("name", ["stribeck", "lugre", "film_lag", "library", "lstm"])
def test_the_module_computes_what_the_model_computes(name):
    rng = np.random.default_rng(4)
    own = exported(friction_by(LAWS[name], rng), speeds=(2.0, 3.0))
    module: dict = {}
    exec(writer_of("python")(own, ExportSettings()).files[".py"], module)
    law, theta, used = own.friction.law, own.friction.theta, own.programs.inputs
    memory = []
    for k in range(50):
        x = Inputs(*(3.0 * rng.standard_normal((4, N))))
        given = [v.tolist() for g, v in zip(GROUPS, x[:4], strict=True) if g in used]
        if k == 0 and law.has_memory:
            memory, state = module["start"](*given), law.start(theta, x)
        elif law.has_memory:
            memory = module["advance"](*given, memory, 0.01)
            state = law.advance(theta, x, state, np.array([0.01]))
        else:
            state = ()
        found = module["torque"](*given, *([memory] if law.has_memory else []))
        np.testing.assert_allclose(found, law.torque(theta, x, state), rtol=1e-12, atol=1e-12)
