"""Laws as programs of scalars: every law's program computes what the law computes."""

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose

from frictionid.deploy.export.exported import exported
from frictionid.friction import Friction, Inputs, at_rest
from frictionid.friction import laws as known
from frictionid.friction.wrapped import LinearOutside

LAWS = {
    "coulomb_viscous": known.CoulombViscous(),
    "stribeck": known.Stribeck(),
    "stribeck_arctan": known.Stribeck(shape="arctan", width=0.1),
    "stribeck_asymmetric": known.Stribeck(symmetric=False),
    "quadratic": known.Quadratic(),
    "lugre": known.LuGre(),
    "lugre_asymmetric": known.LuGre(symmetric=False),
    "dahl": known.Dahl(),
    "film_lag": known.FilmLag(),
    "spline": known.Spline(),
    "spline_asymmetric": known.Spline(degree=3, symmetric=False),
    "table": known.Table(),
    "ripple": known.Ripple(harmonics=(1, 3)),
    "library": known.Library(harmonics=(1,), load=True, direction=True, other=True),
    "load_dependent": known.LoadDependent(),
    "load_dependent_stribeck": known.LoadDependent(stribeck=True),
    "motor_load": known.MotorLoad(),
    "gear_load": known.GearLoad(0.3),
    "per_joint": known.PerJoint(("stribeck", "lugre")),
    "sum": known.Sum(),
    "play": known.Play(),
    "none": known.NoFriction(),
    "mlp": known.MLP((4,)),
    "window_mlp": known.WindowMLP(samples=3, hidden=(4,)),
    "window_mlp_presliding": known.WindowMLP(samples=3, hidden=(4,), presliding=0.01),
    "lstm": known.LSTM(cells=2, hidden=(4,)),
    "ensemble": known.Ensemble(known.MLP((4,)), 3),
}
N = 2
GROUPS = ("q", "w", "u", "load")


def friction_by(law, rng):
    theta = np.array([law.initial[0]] * N)
    if not law.is_network:
        theta = np.abs(theta + rng.uniform(0.02, 0.1, theta.shape))
    return Friction(law, theta)


def exported_by(law, seed, joints=()):
    """The export of a friction by a law, measured up to 2 and 3 rad/s."""
    return exported(friction_by(law, default_rng(seed)), joints, (2.0, 3.0))


def inputs_of(program, x, memory, dt=0.0):
    entries = {f"memory_{i + 1}_{j + 1}": e[j] for i, e in enumerate(memory) for j in range(N)}
    entries |= {f"{g}_{j + 1}": v[j] for g, v in zip(GROUPS, x[:4], strict=True) for j in range(N)}
    return {name: float(({"dt_1": dt} | entries)[name]) for name in program.inputs}


@pytest.mark.parametrize("name", LAWS)
def test_a_program_computes_what_its_law_computes(name):
    """Along a random motion with its memory, within and beyond the measured speeds."""
    rng = default_rng(1)
    own = exported(friction_by(LAWS[name], rng), speeds=(2.0, 3.0))
    law, theta, programs = own.friction.law, own.friction.theta, own.programs
    x = Inputs(*(3.0 * rng.standard_normal((40, 4, N))).swapaxes(0, 1)[:, 0])
    memory = law.start(theta, x)
    begun = programs.start.run(inputs_of(programs.start, x, ()))
    assert len(begun) == len(memory)
    for entry, value in zip(begun.values(), memory, strict=True):
        assert_allclose(entry, value, rtol=1e-12, atol=1e-12)
    for k in range(40):
        x = Inputs(*(3.0 * rng.standard_normal((4, N))))
        found = programs.torque.run(inputs_of(programs.torque, x, memory))["Tf"]
        assert_allclose(found, law.torque(theta, x, memory), rtol=1e-12, atol=1e-12)
        after = programs.advance.run(inputs_of(programs.advance, x, memory, 0.01 + 0.001 * k))
        memory = law.advance(theta, x, memory, np.array([0.01 + 0.001 * k]))
        for entry, value in zip(after.values(), memory, strict=True):
            assert_allclose(entry, value, rtol=1e-12, atol=1e-12)


def test_programs_read_only_what_friction_depends_on():
    rng = default_rng(2)
    read = {name: exported(friction_by(LAWS[name], rng)).programs.inputs for name in LAWS}
    assert read["stribeck"] == read["mlp"] == read["lugre"] == ("w",)
    assert read["ripple"] == ("q", "w")
    assert read["load_dependent"] == ("w", "load")
    assert read["none"] == ()


@pytest.mark.parametrize("name", [n for n, law in LAWS.items() if not law.has_memory])
def test_beyond_the_measured_speeds_friction_goes_on_straight_and_never_falls(name):
    rng = default_rng(3)
    friction = friction_by(LAWS[name], rng)
    law = LinearOutside(friction.law, (2.0, 3.0))
    top = np.array(law.speeds)
    shares = np.array([-9.0, -5.0, -1.0, 0.5, 1.0, 5.0, 9.0])
    x = at_rest(shares[:, None] * top)
    x = x._replace(load=x.load + 2.0, u=x.u + 1.0, q=x.q + 0.3)
    Tf = law.torque(friction.theta, x, ())
    assert_allclose(Tf[6] - Tf[5], Tf[5] - Tf[4], atol=1e-12)
    assert_allclose(Tf[0] - Tf[1], Tf[1] - Tf[2], atol=1e-12)
    assert (Tf[6] >= Tf[5] - 1e-12).all()
    assert (Tf[0] <= Tf[1] + 1e-12).all()
    inside = slice(2, 5)
    own = friction.law.torque(friction.theta, x.each(lambda a: a[inside]), ())
    assert_allclose(Tf[inside], own, rtol=1e-12)


def test_what_cannot_be_traced_is_refused_in_one_line():
    class Deciding(known.CoulombViscous):
        def torque(self, theta, x, memory):
            return theta[..., 0] * (x.w if (x.w > 0).all() else -x.w)

    friction = Friction(Deciding(), [[0.1, 0.2]])
    with assert_refused("cannot be written as code"):
        assert exported(friction).programs is None


def test_several_sets_of_parameters_are_refused():
    with assert_refused("holds several frictions"):
        exported(Friction(known.CoulombViscous(), np.zeros((3, 1, 2))))
