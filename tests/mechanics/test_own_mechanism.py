"""Mechanisms from their bodies, and the cart-pole of comparisons/own_mechanism.py as an example."""

import shutil
import tomllib

import numpy as np
import pytest
import sympy as sp
from fixtures.cart_poles import TRUE, cart_pole, cart_pole_data
from fixtures.mistakes import changes, mistakes
from fixtures.paths import ROOT
from fixtures.random_machines import assert_close
from fixtures.refusals import assert_refused

from frictionid import load_dataset
from frictionid.comparison.fit_model import fit_model
from frictionid.data.recordings import Dataset
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.parameters import FrictionBlock
from frictionid.fitting.shooting import Shooting
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import (
    Body,
    Joint,
    Parameter,
    check_mechanism,
    double_pendulum,
    from_bodies,
)
from frictionid.simulate import write_dataset as write


@pytest.fixture(scope="module")
def recorded():
    return cart_pole_data()


def test_the_example_is_short_and_stands_in_the_docs():
    text = (ROOT / "comparisons/own_mechanism.py").read_text()
    assert len(text.splitlines()) < 40
    code = text.split('"""', 2)[2].strip()
    assert code in (ROOT / "docs/mechanisms.md").read_text()


def test_units_are_those_of_each_joint_and_base_parameter():
    m = cart_pole()
    assert m.position_units == ("m", "rad")
    assert m.velocity_units == ("m/s", "rad/s")
    assert m.torque_units == ("N", "N m")
    assert dict(zip(m.base_names, m.base_units, strict=True)) == {
        "cart+mass": "kg",
        "length*mass": "kg m",
        "inertia+length^2*mass": "kg m^2",
        "g*length*mass": "N m",
    }


def test_one_step_fits_and_shooting_find_the_friction_of_both_joints(recorded):
    law = LeastSquares(CoulombViscous())
    speeds = np.array([2.0, 8.0])[:, None] * np.linspace(0.1, 1.0, 10)

    def curve(theta):
        return theta[:, :1] + theta[:, 1:] * speeds

    for recipe, share in ((None, 0.05), (Shooting(blocks=(FrictionBlock(),)), 0.01)):
        fitted = fit_model(recorded, law, recipe) if recipe else fit_model(recorded, law)
        off = np.linalg.norm(curve(fitted.theta) - curve(TRUE), axis=1)
        assert (off < share * np.linalg.norm(curve(TRUE), axis=1)).all()


def test_a_data_set_and_the_module_beside_it_are_read_with_trust(recorded, tmp_path):
    write(recorded, tmp_path / "data")
    shutil.copy(ROOT / "comparisons/own_mechanism.py", tmp_path / "data")
    with assert_refused(r"'own_mechanism:cart_pole' is code"):
        load_dataset(tmp_path / "data")
    again = load_dataset(tmp_path / "data", trust=True)
    assert again.mechanism == recorded.mechanism
    text = (tmp_path / "data/dataset.toml").read_text()
    assert tomllib.loads(text)["units"] == {
        "angle": ["m", "rad"],
        "velocity": ["m/s", "rad/s"],
        "torque": ["N", "N m"],
    }
    given = load_dataset(tmp_path / "data", mechanism=cart_pole())
    assert given.mechanism == recorded.mechanism
    assert isinstance(given, Dataset)


# ---------------------------------------------------------------- from bodies to equations


def test_bodies_of_a_built_in_mechanism_give_its_equations():
    """The double pendulum, whose base parameters are then found and not given."""
    given = double_pendulum()
    d = given.description
    joints = [Joint(name, q) for name, q in zip(d.joints, d.q, strict=True)]
    found = from_bodies(d.bodies, joints, d.parameters, rotors=d.rotors)
    values = {"m1": 0.6, "m2": 0.4, "I1": 0.02, "I2": 0.014, "Ir": 1e-5, "gr": 6.0}
    q, w, u = np.random.default_rng(1).normal(size=(3, 50, 2))
    assert len(found.base_names) == len(given.base_names) == 6
    for name in ("M", "h", "momentum", "dLdq", "energy"):
        one, other = (getattr(m.terms(m.base(values), q, w), name) for m in (given, found))
        assert_close(one, other)
    assert_close(given.load(values, q, w, u), found.load(values, q, w, u))


def spring(**options):
    x, m, k = sp.symbols("x m k")
    return from_bodies(
        [Body(m, x, 0)],
        [Joint("slider", x, "m")],
        [Parameter("m", 2.0, "kg", "slider"), Parameter("k", 50.0, "N/m", "spring")],
        potential=k * x**2 / 2,
        **options,
    )


def test_a_spring_is_a_potential_energy_and_no_g_is_a_level_plane():
    m = spring()
    assert (m.base_names, m.base_units) == (("m", "k"), ("kg", "N/m"))
    _, h = m.dynamics(m.base({}), np.array([0.1]), np.array([0.0]))
    assert h == pytest.approx(-5.0)
    assert m.load({}, np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1))) == pytest.approx(0.0)


def test_base_parameters_may_have_names():
    m, k = sp.symbols("m k")
    named = spring(base={"stiffness": -k, "moved": 2 * m})  # factors are taken care of
    assert (named.base_names, named.base_units) == (("stiffness", "moved"), ("N/m", "kg"))
    assert named.base({"m": 3.0}).tolist() == [-50.0, 6.0]
    check_mechanism(named)
    q, plain = np.array([0.1]), spring()
    for ours, theirs in zip(*(m.dynamics(m.base({}), q, q) for m in (named, plain)), strict=True):
        assert_close(ours, theirs)
    with pytest.raises(
        ValueError,
        match=r"own: the coefficient .* base parameter \(stiffness\): add one to",
    ):
        spring(base={"stiffness": k}).dynamics(np.ones(1), np.ones(1), np.ones(1))


def test_symbols_may_carry_assumptions():
    x, m = sp.symbols("x m", positive=True)
    found = from_bodies(
        [Body(m, x, 0)], [Joint("slider", x, "m")], [Parameter("m", 1.0, "kg", "slider")]
    )
    check_mechanism(found)


MISTAKES = r"""
parameters = ["m", "lenght"] => 'length' is neither a joint's .*mean 'lenght'
parameters = ["m", "length", "x"] => 'x' names two parameters or joints
unit = "deg" => the unit of slider is 'deg'; it must be "rad" or "m"
joint = 2 => a body has joint = 2; joints count from 0 to 0
inside = true => parameter 'length' stands inside .*length.*: write the number
"""


@mistakes(MISTAKES)
def test_mistakes_are_one_sentence(wrong, words):
    x, m, length = sp.symbols("x m length")
    change = changes(wrong)
    place = sp.sin(x / length) if "inside" in change else x + length * sp.sin(x)
    with assert_refused(words):
        from_bodies(
            [Body(m, place, 0, joint=change.get("joint", 0))],
            [Joint("slider", x, change.get("unit", "rad"))],
            [Parameter(p, 1.0, "m", p) for p in change.get("parameters", ("m", "length"))],
        )
