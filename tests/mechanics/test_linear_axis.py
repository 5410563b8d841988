"""A prismatic joint: Newton's second law, and units of force and length in all that is printed."""

import numpy as np
import pytest

from frictionid.comparison.registry import LAWS
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.errors import InputError
from frictionid.friction import Friction, units_of
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.friction.model_files import load_model, save_model
from frictionid.mechanics import Plant, linear_axis, mechanism_of


def test_a_carriage_follows_newtons_second_law():
    rng = np.random.default_rng(0)
    q, w = rng.normal(size=(2, 20, 1))
    mechanism = linear_axis()
    terms = mechanism.terms(mechanism.base({"mass": 95.0}), q, w)
    np.testing.assert_allclose(terms.M, 95.0 * np.ones((20, 1, 1)))
    np.testing.assert_array_equal(terms.h, np.zeros((20, 1)))
    np.testing.assert_allclose(terms.momentum, 95.0 * w)
    np.testing.assert_allclose(terms.energy, 95.0 * w[:, 0] ** 2 / 2)


def test_the_guide_carries_the_weight():
    zero = np.zeros((1, 1))
    assert linear_axis().load({"mass": 2.0}, zero, zero, zero) == pytest.approx(2.0 * 9.81)


def test_a_sliding_carriage_stops_where_friction_says():
    """v^2 = 2 (Fc/M) s under Coulomb friction alone."""
    plant = Plant.from_parameters(linear_axis(), {"mass": 4.0})
    friction = Friction(CoulombViscous(width=1e-3), np.array([[8.0, 0.0]]))
    start = State(np.zeros(1), np.array([0.3]))
    motion = rollout(plant, friction, start, np.zeros((200, 1)), np.full(200, 1e-3))
    assert motion.w[-1, 0] == 0.0
    assert motion.q[-1, 0] == pytest.approx(0.3**2 / (2 * 8.0 / 4.0), rel=1e-2)


def test_options_are_checked():
    assert mechanism_of({"kind": "linear_axis", "driven": False}).B[0, 0] == 0.0
    with pytest.raises(InputError, match="driven = 3 must be true or false"):
        mechanism_of({"kind": "linear_axis", "driven": 3})


@pytest.mark.parametrize("law", [CoulombViscous(), Stribeck(), Stribeck(symmetric=False)], ids=str)
def test_no_unit_of_a_prismatic_joint_turns(law):
    assert units_of(law) == law.units
    assert not any("rad" in unit or "N m" in unit for unit in units_of(law, "m"))


def test_forces_are_printed_and_kept_in_newtons(tmp_path):
    friction = Friction(CoulombViscous(), np.array([[20.4, 203.5]]), position_units=("m",))
    assert "coulomb 20.4 N, viscous 203.5 N s/m" in str(friction)
    assert friction[..., :].position_units == ("m",)
    save_model(friction, tmp_path / "model.json", LAWS)
    text = (tmp_path / "model.json").read_text()
    assert '"N s/m"' in text and "N m" not in text
    assert load_model(tmp_path / "model.json", LAWS).units_at(0) == ("N", "N s/m")
