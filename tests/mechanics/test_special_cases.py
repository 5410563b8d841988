"""Mechanics against the study, the makers of the real machine, special cases and Newton."""

import numpy as np
import pytest
from fixtures.random_machines import (
    MECHANISMS,
    assert_close,
    assert_same_terms,
    drawn,
    moments_of_inertia,
    physical,
)

from frictionid.mechanics import acrobot, double_pendulum, pendulum

# ---------------------------------------------------------------- special cases


@pytest.mark.parametrize("inertias", ["printed", "shapes"])
def test_acrobot_is_a_double_pendulum_driven_at_the_elbow(inertias):
    a, d = acrobot(inertias), double_pendulum((False, True))
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


@pytest.mark.parametrize("inertias", ["printed", "shapes"])
def test_the_printed_energy_differs_in_the_inertia_of_link_2_alone(inertias):
    absolute, relative = acrobot(inertias), acrobot(inertias, "relative")
    v, q, w, _ = drawn(absolute, 20)
    J2 = moments_of_inertia(v)[1]
    a = absolute.terms(absolute.base(v), q, w)
    r = relative.terms(relative.base(v), q, w)
    assert_close(a.M - r.M, np.multiply.outer(J2, [[1.0, 1.0], [1.0, 0.0]]), 1e-10)
    assert_close(a.energy - r.energy, 0.5 * J2 * ((w.sum(-1)) ** 2 - w[:, 1] ** 2), 1e-10)
    assert_close(a.h, r.h)
    assert_close(a.dLdq, r.dLdq)


@pytest.mark.parametrize(
    ("part", "of_formula", "printed", "places"),
    [
        ("shaft", 6.900e-5, 6.91e-5, 8),
        ("clamp", 2.236e-5, 2.24e-5, 8),
        ("bush", 3.848e-5, 3.81e-5, 8),
        ("link1", 3.727e-4, 3.73e-4, 7),
        ("link2", 3.485e-4, 3.39e-4, 7),
    ],
)
def test_shape_formulas_give_the_figures_of_the_study(part, of_formula, printed, places):
    """Of a machine that has only this part; a plate at the joint, so that only its J counts."""
    m = acrobot("shapes")
    name = {"link1": "m1", "link2": "m3"}.get(part, f"M_{part}")
    masses = [k for k in m.defaults if k.startswith(("m", "M_"))]
    only = dict.fromkeys(masses, 0.0) | {name: m.defaults[name], "L1": 0.0, "L2": 0.0, "L3": 0.0}
    assert m.base(only)[0] == pytest.approx(of_formula, abs=0.5 * 10.0**-places)
    named = {"link2": "J2"}.get(part, f"J_{part}")
    assert acrobot().defaults[named] == printed


def test_a_small_rotor_behind_the_gear_adds_a_sixth_to_the_second_joint():
    """2e-6 kg m^2 behind 18:1 adds about 16 % to M22 and, turning with link 1, less elsewhere."""
    m = acrobot()
    bare, geared = m.base({}), m.base({"rotor": 2e-6})
    added = dict(zip(m.base_names, geared - bare, strict=True))
    assert added["inertia_22"] == pytest.approx(2e-6 * 18**2)
    assert added["inertia_12"] == pytest.approx(-2e-6 * 18)
    assert added["inertia_11"] == pytest.approx(2e-6)
    assert added["inertia_22"] / bare[2] == pytest.approx(0.16, abs=0.01)


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


# ---------------------------------------------------------------- bearing forces


@pytest.mark.parametrize("name", MECHANISMS)
def test_bearings_of_a_hanging_machine_carry_its_weight(name):
    mechanism = MECHANISMS[name]
    v = physical(mechanism, np.random.default_rng(28))
    zero = np.zeros(mechanism.n)
    load = mechanism.load(v, zero, zero, zero)
    beyond = {
        "acrobot": (("m1", "m2", "m3", "m4"), ("m3", "m4")),
        "double_pendulum": (("m1", "m2"), ("m2",)),
        "pendulum": (("mass",),),
    }[mechanism.kind]
    assert_close(load, np.array([v["g"] * sum(v[k] for k in names) for names in beyond]))


def test_bearing_force_of_a_swinging_pendulum_by_newton():
    """Along the rod m (g cos q + l w^2), across it m (l dw/dt + g sin q)."""
    m = pendulum()
    v, q, w, u = drawn(m, 29)
    t = m.terms(m.base(v), q, w)
    a = ((t.h + u) / t.M[..., 0])[:, 0]
    along = v["g"] * np.cos(q[:, 0]) + v["length"] * w[:, 0] ** 2
    across = v["length"] * a + v["g"] * np.sin(q[:, 0])
    assert_close(m.load(v, q, w, u)[:, 0], v["mass"] * np.hypot(along, across))
