"""Friction as functions of CasADi: derivatives, and an optimal-control problem."""

import casadi
import numpy as np
import pytest
from targets import written
from test_programs import LAWS, exported_by

from frictionid.deploy.export.exported import exported
from frictionid.deploy.export.formats.casadi import casadi_functions
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import CoulombViscous


@pytest.mark.parametrize("name", ["stribeck", "quadratic", "spline", "mlp"])
def test_derivatives_agree_with_differences(name):
    own = exported_by(LAWS[name], 6)
    slope = casadi_functions(own).torque.jacobian()
    law, theta, step = own.friction.law, own.friction.theta, 1e-6
    for w in np.random.default_rng(7).uniform(-4.0, 4.0, (20, 2)):
        high, low = (law.torque(theta, at_rest(w + side * step), ()) for side in (1, -1))
        expected = np.diag((high - low) / (2 * step))
        np.testing.assert_allclose(slope(w, 0).full(), expected, rtol=1e-5, atol=1e-6)


def test_braking_by_friction_alone_is_found_by_optimal_control():
    """The least torque that brings a sliding mass to rest in a second is none: friction does it.

    J dw/dt = u - Tf, and Tf is Coulomb's 0.1 N m: from 1 rad/s to rest takes 1 s with J = 0.1.
    """
    own = exported(Friction(CoulombViscous(), np.array([[0.1, 0.0]])))
    torque = casadi_functions(own).torque
    problem, steps = casadi.Opti(), 50
    w, u = problem.variable(1, steps + 1), problem.variable(1, steps)
    for k in range(steps):
        problem.subject_to(w[k + 1] == w[k] + (u[k] - torque(w[k + 1])) / 0.1 / steps)
    problem.subject_to(w[0] == 1.0)
    problem.subject_to(w[steps] == 0.05)
    problem.minimize(casadi.sumsqr(u))
    problem.set_initial(w, np.linspace(1.0, 0.05, steps + 1))
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    found = problem.solve()
    assert float(found.value(casadi.sumsqr(u))) / steps < 0.01**2
    np.testing.assert_allclose(found.value(w)[:40], 1.0 - np.arange(40) / steps, atol=0.05)


def test_files_say_units_signs_and_range(tmp_path):
    own = exported_by(LAWS["lugre"], 8, ("hip", "knee"))
    paths = written(own, "casadi", tmp_path)
    assert set(paths) == {".casadi", "_advance.casadi", "_start.casadi", ".txt"}
    text = paths[".txt"].read_text()
    for fact in (*own.facts, "friction_advance", "hip [rad, rad/s, N m]"):
        assert fact in text
