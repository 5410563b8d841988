"""Mechanics against the study, the makers of the real machine, special cases and Newton."""

import numpy as np
import pytest
from fixtures.random_machines import assert_close, physical, states

from frictionid.mechanics import acrobot, double_pendulum

# ---------------------------------------------------------------- special cases


def moments_of_inertia(v):
    """J1 about the shaft (link 1 about its own centre) and J2, written by hand."""
    if "J2" in v:
        return v["J_shaft"] + v["J_clamp"] + v["J_bush"] + v["J_link1"], v["J2"]
    shaft = 0.5 * v["M_shaft"] * v["R_shaft"] ** 2
    rings = sum(
        0.5 * v[f"M_{k}"] * (v[f"R_{k}"] ** 2 + v[f"r_{k}"] ** 2) for k in ("clamp", "bush")
    )
    plates = [v[m] * (v[f"H{i}"] ** 2 + v[f"W{i}"] ** 2) / 12 for m, i in (("m1", 1), ("m3", 2))]
    return shaft + rings + plates[0], plates[1]


# ---------------------------------------------------------------- published figures and formulas


@pytest.mark.parametrize("inertias", ["printed", "shapes"])
def test_the_printed_energy_differs_in_the_inertia_of_link_2_alone(inertias):
    rng = np.random.default_rng(20)
    absolute, relative = acrobot(inertias), acrobot(inertias, "relative")
    v = physical(absolute, rng)
    J2 = moments_of_inertia(v)[1]
    q, w = states(absolute, rng)
    a = absolute.terms(absolute.base(v), q, w)
    r = relative.terms(relative.base(v), q, w)
    assert_close(
        a.M - r.M, np.broadcast_to(J2 * np.array([[1.0, 1.0], [1.0, 0.0]]), a.M.shape), 1e-10
    )
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
    rng = np.random.default_rng(21)
    m = double_pendulum()
    v = physical(m, rng, (200,))
    m1, m2, l1, r1, r2, I1, I2, Ir, gr, g = v.values()
    q, w = states(m, rng)
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


# ---------------------------------------------------------------- bearing forces
