"""Mechanics against the study, the makers of the real machine, special cases and Newton."""

import numpy as np
from fixtures.random_machines import (
    assert_close,
    assert_same_terms,
    drawn,
    moments_of_inertia,
)

from frictionid.mechanics import acrobot, double_pendulum, pendulum

# ---------------------------------------------------------------- special cases


def test_acrobot_is_a_double_pendulum_driven_at_the_elbow():
    a, d = acrobot(), double_pendulum((False, True))
    v, q, w, _ = drawn(a, 19)
    m1, m2, m3, m4, L1, L2, L3, L4 = (v[k] for k in "m1 m2 m3 m4 L1 L2 L3 L4".split())
    J1, J2 = moments_of_inertia(v)
    same = {
        "m1": m1 + m2,
        "r1": (m1 * L1 + m2 * L2) / (m1 + m2),
        "I1": J1 + m1 * L1**2 + m2 * L2**2,
        "l1": L2,
        "m2": m3 + m4,
        "r2": (m3 * L3 + m4 * L4) / (m3 + m4),
        "I2": J2 + m3 * L3**2 + m4 * L4**2,
        "Ir": v["rotor"],
        "gr": v["gear"],
        "g": v["g"],
    }
    assert_same_terms(a.terms(a.base(v), q, w), d.terms(d.base(same), q, w))


# ---------------------------------------------------------------- published figures and formulas


def test_double_pendulum_has_the_matrices_of_its_makers():
    """M and G as the makers of the real one print them, both joints driven [Wiebe2024]."""
    m = double_pendulum()
    v, q, w, _ = drawn(m, 21)
    m1, m2, l1, r1, r2, I1, I2, Ir, gr, g = v.values()
    (q1, q2), (w1, w2) = q.T, w.T
    M11 = I1 + I2 + m2 * l1**2 + 2 * m2 * l1 * r2 * np.cos(q2) + gr**2 * Ir + Ir
    M12 = I2 + m2 * l1 * r2 * np.cos(q2) - gr * Ir
    M22 = I2 + gr**2 * Ir
    G1 = -m1 * g * r1 * np.sin(q1) - m2 * g * (l1 * np.sin(q1) + r2 * np.sin(q1 + q2))
    G2 = -m2 * g * r2 * np.sin(q1 + q2)
    C = m2 * l1 * r2 * np.sin(q2) * np.stack([2 * w1 * w2 + w2**2, -(w1**2)])
    t = m.terms(m.base(v), q, w)
    assert_close(t.M, np.stack([M11, M12, M12, M22], -1).reshape(-1, 2, 2))
    assert_close(t.h, np.stack([G1, G2], -1) + C.T)


def test_pendulum_has_its_textbook_equation():
    m = pendulum()
    v, q, w, _ = drawn(m, 22)
    t = m.terms(m.base(v), q, w)
    I = v["mass"] * v["length"] ** 2 + v["inertia"] + v["gear"] ** 2 * v["rotor"]  # noqa: E741
    assert_close(t.M[:, 0, 0], I)
    assert_close(t.h[:, 0], -v["mass"] * v["g"] * v["length"] * np.sin(q[:, 0]))
