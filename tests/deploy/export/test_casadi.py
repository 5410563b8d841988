"""Friction as functions of CasADi: derivatives, and an optimal-control problem."""

import numpy as np
import pytest
from targets import written
from test_programs import LAWS, exported_by

from frictionid.deploy.export.formats.casadi import casadi_functions
from frictionid.friction import at_rest


@pytest.mark.parametrize("name", ["stribeck", "quadratic", "spline", "mlp"])
def test_derivatives_agree_with_differences(name):
    own = exported_by(LAWS[name], 6)
    slope = casadi_functions(own)["torque"].jacobian()
    law, theta, step = own.friction.law, own.friction.theta, 1e-6
    for w in np.random.default_rng(7).uniform(-4.0, 4.0, (20, 2)):
        high, low = (law.torque(theta, at_rest(w + side * step), ()) for side in (1, -1))
        expected = np.diag((high - low) / (2 * step))
        np.testing.assert_allclose(slope(w, 0).full(), expected, rtol=1e-5, atol=1e-6)


def test_files_say_units_signs_and_range(tmp_path):
    own = exported_by(LAWS["lugre"], 8, ("hip", "knee"))
    paths = written(own, "casadi", tmp_path)
    assert set(paths) == {".casadi", "_advance.casadi", "_start.casadi", ".txt"}
    text = paths[".txt"].read_text()
    for fact in (*own.facts, "friction_advance", "hip [rad, rad/s, N m]"):
        assert fact in text
