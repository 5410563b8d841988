"""The axis of two masses: motor and load with a spring between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import frictionid as fid
from frictionid.mechanics import check_mechanism, pendulum, two_mass_axis
from frictionid.simulate import Camera, Curve, Rig, Run, Sine, Stribeck, simulate

NUMBERS = dict(motor_inertia=0.01, load_inertia=0.04, stiffness=80.0)


@pytest.mark.parametrize("hanging", [False, True])
def test_it_keeps_to_the_protocol(hanging):
    check_mechanism(two_mass_axis(hanging, **NUMBERS, **({"moment": 2.0} if hanging else {})))


def test_it_swings_at_the_frequency_of_two_masses_and_a_spring():
    axis = two_mass_axis(**NUMBERS)
    p = axis.base(axis.nominal())
    zero = np.zeros(2)
    M, _ = axis.dynamics(p, zero, zero)
    K = -np.stack([axis.dynamics(p, q, zero)[1] for q in np.eye(2)], axis=-1)
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    motor, load, k = NUMBERS.values()
    np.testing.assert_allclose(squares, [0.0, k * (1 / motor + 1 / load)], atol=1e-9)


def test_both_masses_together_are_a_pendulum():
    axis = two_mass_axis(True, **NUMBERS, moment=2.0)
    whole = pendulum(mass=1.0, length=0.2, inertia=0.01, g=10.0)
    q, a = np.array([0.4, 0.4]), np.array([3.0, 3.0])
    M, h = axis.dynamics(axis.base(axis.nominal()), q, 0 * q)
    one, of_one = whole.dynamics(whole.base(whole.nominal()), q[:1], 0 * q[:1])
    np.testing.assert_allclose((M @ a - h).sum(), (one @ a[:1] - of_one).sum())


def test_friction_of_motor_and_load_and_the_stiffness_come_out():
    machine = {"kind": "two_mass_axis", "parameters": NUMBERS}
    friction = Stribeck(Curve((0.10, 0.05), (0.10, 0.05), (0.01, 0.02)))
    runs = tuple(
        Run(f"{k}", (0.0, 0.0), (), (Sine(0.8, f),)) for k, f in enumerate((1.3, 5.0, 9.0))
    )
    rig = Rig("axis", machine, friction, Camera(600, 400.0, 1e-4), runs, substeps=8)
    believed = {**NUMBERS, "stiffness": 1.1 * NUMBERS["stiffness"], "load_inertia": 0.05}
    data = replace(simulate(rig), mechanism=two_mass_axis(**believed))
    blocks = {"free": ["inertia"], "fixed": ["inertia.motor_inertia"]}
    frame = fid.fit(data, "coulomb_viscous", method="shooting", **blocks).frame
    found = frame["value"].to_numpy()
    np.testing.assert_allclose(found[:4], [0.10, 0.01, 0.05, 0.02], rtol=0.05)
    np.testing.assert_allclose(
        found[4:6], [NUMBERS["load_inertia"], NUMBERS["stiffness"]], rtol=0.01
    )
