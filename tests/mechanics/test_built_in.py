"""Mechanisms beside the pendulum: a linear axis, and two masses with a spring between them."""

import numpy as np
import pandas as pd
import pytest
from drive_logs import LooseAxis
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction, units_of
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.friction.model_files import load_model, save_model
from frictionid.mechanics import (
    Plant,
    linear_axis,
    mechanism_of,
    pendulum,
    two_mass_axis,
)


def test_a_carriage_follows_newtons_second_law():
    rng = np.random.default_rng(0)
    q, w = rng.normal(size=(2, 20, 1))
    mechanism = linear_axis()
    terms = mechanism.terms(mechanism.base({"mass": 95.0}), q, w)
    assert_allclose(terms.M, 95.0 * np.ones((20, 1, 1)))
    assert_array_equal(terms.h, np.zeros((20, 1)))
    assert_allclose(terms.momentum, 95.0 * w)
    assert_allclose(terms.energy, 95.0 * w[:, 0] ** 2 / 2)


def test_the_guide_carries_the_weight():
    zero = np.zeros((1, 1))
    for force in (0.0, 30.0):  # what accelerates the carriage is the motor's, not the guide's
        load = linear_axis().load({"mass": 2.0}, zero, zero, zero + force)
        assert load == pytest.approx(2.0 * 9.81)


def test_a_sliding_carriage_stops_where_friction_says():
    """v^2 = 2 (Fc/M) s under Coulomb friction alone."""
    plant = Plant.from_parameters(linear_axis(), {"mass": 4.0})
    friction = Friction(CoulombViscous(width=1e-3), [[8.0, 0.0]])
    start = State(np.zeros(1), np.array([0.3]))
    motion = rollout(plant, friction, start, np.zeros((200, 1)), np.full(200, 1e-3))
    assert motion.w[-1, 0] == 0.0
    assert motion.q[-1, 0] == pytest.approx(0.3**2 / (2 * 8.0 / 4.0), rel=1e-2)


def test_options_are_checked():
    assert mechanism_of({"kind": "linear_axis", "driven": False}).B[0, 0] == 0.0
    with assert_refused("linear_axis: driven: it should be a valid boolean, not 3"):
        mechanism_of({"kind": "linear_axis", "driven": 3})


@pytest.mark.parametrize("law", [CoulombViscous(), Stribeck(), Stribeck(symmetric=False)], ids=str)
def test_no_unit_of_a_prismatic_joint_turns(law):
    assert units_of(law) == law.units
    assert not any("rad" in unit or "N m" in unit for unit in units_of(law, "m"))


def test_forces_are_printed_and_kept_in_newtons(tmp_path):
    friction = Friction(CoulombViscous(), [[20.4, 203.5]], position_units=("m",))
    assert "coulomb 20.4 N, viscous 203.5 N s/m" in str(friction)
    assert friction[..., :].position_units == ("m",)
    save_model(friction, tmp_path / "model.json")
    text = (tmp_path / "model.json").read_text()
    assert '"N s/m"' in text and "N m" not in text
    assert load_model(tmp_path / "model.json").units_at(0) == ("N", "N s/m")


NUMBERS = dict(motor_inertia=0.01, load_inertia=0.04, stiffness=80.0)


def test_it_swings_at_the_frequency_of_two_masses_and_a_spring():
    axis = two_mass_axis(**NUMBERS)
    p = axis.base(axis.nominal())
    zero = np.zeros(2)
    M, _ = axis.dynamics(p, zero, zero)
    K = -np.stack([axis.dynamics(p, q, zero)[1] for q in np.eye(2)], axis=-1)
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    motor, load, k = NUMBERS.values()
    assert_allclose(squares, [0.0, k * (1 / motor + 1 / load)], atol=1e-9)


def test_both_masses_together_are_a_pendulum():
    axis = two_mass_axis(True, **NUMBERS, moment=2.0)
    whole = pendulum(mass=1.0, length=0.2, inertia=0.01, g=10.0)
    q, a = np.array([0.4, 0.4]), np.array([3.0, 3.0])
    M, h = axis.dynamics(axis.base(axis.nominal()), q, 0 * q)
    one, of_one = whole.dynamics(whole.base(whole.nominal()), q[:1], 0 * q[:1])
    assert_allclose((M @ a - h).sum(), (one @ a[:1] - of_one).sum())


def test_the_gears_press_beyond_the_gap_and_not_within_it():
    axis = two_mass_axis(gap=0.02, **NUMBERS)
    twist = np.array([-0.5, -0.011, -0.009, 0.0, 0.004, 0.0099, 0.0101, 0.02, 3.0])
    q = np.stack([twist + 0.7, 0.7 + 0.0 * twist], axis=-1)
    terms = axis.terms(axis.base(axis.nominal()), q, 0.0 * q)
    beyond = twist - np.clip(twist, -0.01, 0.01)
    press = NUMBERS["stiffness"] * np.stack([-beyond, beyond], axis=-1)
    assert_allclose(terms.h, press, atol=NUMBERS["stiffness"] * 1e-6)
    middle = terms.energy[3]
    energy = NUMBERS["stiffness"] * beyond**2 / 2
    assert_allclose(terms.energy - middle, energy, atol=NUMBERS["stiffness"] * 1e-9)


def test_a_table_of_the_mechanism_keeps_the_gap():
    axis = two_mass_axis(gap=0.02, **NUMBERS)
    again = mechanism_of(axis.table)
    assert again.table == axis.table and again.table["gap"] == 0.02
    assert "gap" not in two_mass_axis(**NUMBERS).table


@pytest.mark.parametrize("gap", [-0.01, float("nan"), float("inf"), True, "wide"])
def test_gaps_that_mean_nothing_are_refused(gap):
    with pytest.raises(ValueError, match="two_mass_axis: gap: it should be .*, not"):
        two_mass_axis(gap=gap)


def test_friction_on_both_sides_of_a_gap_comes_out_and_only_with_it():
    rig = LooseAxis()
    logs = {str(k): pd.DataFrame(rig.log(k, seconds=4.0)) for k in range(2)}
    truth = [rig.motor_coulomb, rig.motor_viscous, rig.load_coulomb, rig.load_viscous]
    truth += [rig.load_inertia, rig.stiffness]
    noise = {}
    for gap in (rig.gap, 1.2 * rig.gap):
        believed = {"motor_inertia": rig.motor_inertia, "load_inertia": 0.05, "stiffness": 120.0}
        data = fid.Dataset.from_frames(
            logs,
            two_mass_axis(gap=gap, **believed),
            time="t",
            angle=["q1", "q2"],
            torque=["u1", "u2"],
            hold="previous",
        )
        free = {"free": ["friction", "inertia"], "fixed": ["inertia.motor_inertia"]}
        fit = fid.fit(data, "coulomb_viscous", method="shooting", **free)
        noise[gap] = max(fit.convergence.angle_noise)
        if gap == rig.gap:
            assert_allclose(fit.frame.value, truth, rtol=0.03)
            assert not fit.convergence.warnings
    assert noise[rig.gap] == pytest.approx(1e-4, rel=0.05)  # that of the encoders
    assert noise[1.2 * rig.gap] > 3 * noise[rig.gap]
