"""[mechanism] tables, own descriptions of a machine, and the flat code that is made of them."""

import numpy as np
import pytest
import sympy as sp
import torch
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused

from frictionid.mechanics import (
    acrobot,
    mechanism_of,
    pendulum,
)
from frictionid.mechanics.symbolic import scalar_code

# ---------------------------------------------------------------- [mechanism] tables


def test_table_builds_the_mechanism_with_its_options():
    assert mechanism_of({"kind": "acrobot"}) == acrobot()
    driven = mechanism_of({"kind": "double_pendulum", "driven": [False, True]})
    assert driven.driven == (False, True)
    assert mechanism_of({"kind": "pendulum", "driven": False}).driven == (False,)


def test_table_parameters_go_before_defaults_and_overrides_before_both():
    table = {"kind": "acrobot", "parameters": {"m4": 0.1, "m3": 0.2}}
    p = mechanism_of(table).nominal({"m4": 0})
    assert p == acrobot().defaults | {"m3": 0.2, "m4": 0}
    assert table["parameters"] == {"m4": 0.1, "m3": 0.2}
    given = {"mass": 2.0, "length": 0.5}
    table = {"kind": "pendulum", "parameters": given}
    assert mechanism_of(table).nominal({}) == pendulum().defaults | given


WRONG = r"""
kind = ""
    => known: 'acrobot', 'double_pendulum', 'linear_axis', 'pendulum', 'two_mass_axis'
kind = "acrobott" => kind = 'acrobott' is unknown; did you mean 'acrobot'\?
kind = 3 => kind = '3' is unknown
kind = "pendulum"; motors = true => no option 'motors'; did you mean 'motor'
kind = "pendulum"; colour = "red" => no option 'colour'; known: 'driven'
kind = "pendulum"; driven = {J = 1} => driven = .* a value or a list of values
kind = "double_pendulum"; driven = true => driven: it should be a valid list, not True
kind = "double_pendulum"; driven = [true] => 'driven\[1\]' is missing
kind = "double_pendulum"; driven = ["no", "yes"]
    => driven\[0\]: it should be a valid boolean, not 'no'
kind = "double_pendulum"; driven = [[true]] => must be a value or a list of values
kind = "pendulum"; driven = "yes" => driven: it should be a valid boolean, not 'yes'
kind = "acrobot"; parameters = 3 => parameters = 3 must be a table: name = number
kind = "pendulum"; parameters = {lenght = 1.0}
    => pendulum has no parameter 'lenght'; did you mean 'length'
kind = "pendulum"; parameters = {kt = 1.0} => no parameter 'kt'; motor = true in \[mechanism\]
kind = "pendulum"; parameters = {mass = "1"} => mass = '1' must be a finite number
kind = "pendulum"; parameters = {mass = true} => mass = True must be a finite num
kind = "pendulum"; parameters = {mass = nan} => mass = nan must be a finite num
kind = "pendulum"; parameters = {g = inf} => g = inf must be a finite number
kind = "pendulum"; parameters = {mass = 0.5}
    => pendulum needs length \[m\] \(joint to centre of mass\): give
kind = "linear_axis"; parameters = {} => linear_axis needs mass \[kg\]
kind = "double_pendulum"; parameters = {m1 = 1.0, m2 = 1.0}
    => needs l1 \[m\] .*, r1 .*, r2 .*, I1 .*, I2\b
kind = "pendulum"; parameters = {mass = -0.5, length = 1.0} => mass = -0.5 kg is negative
kind = "acrobot"; parameters = {m4 = -0.1} => acrobot: m4 = -0.1 kg is negative
kind = "pendulum"; parameters = {mass = 1.0, length = 1.0, rotor = -1e-3}
    => rotor = -0.001 kg m\^2 is neg
kind = "pendulum"; parameters = {mass = 0.0, length = 1.0}
    => give no inertia to a direction of motion
kind = "pendulum"; parameters = {mass = 1.0, length = 1.0, inertia = -1.5}
    => eigenvalue of M: -0.5\)
"""


@mistakes(WRONG)
def test_a_wrong_table_is_reported_with_the_mistake(wrong, words):
    """Without a mass or length nothing is assumed, and none is negative."""
    with assert_refused(words):
        mechanism_of(changes(wrong)).nominal({})


def test_a_missing_kind_and_a_wrong_override_are_reported_with_the_mistake():
    with assert_refused("kind = '' is unknown"):
        mechanism_of({})
    table = {"kind": "acrobot"}
    with assert_refused("no parameter 'rotr'; did you mean 'rotor'"):
        mechanism_of(table).nominal({"rotr": 1.0})
    with assert_refused("m4 = None must be a finite number"):
        mechanism_of(table).nominal({"m4": None})


def test_what_a_recording_gives_need_not_stand_in_the_table():
    table = {"kind": "pendulum", "parameters": {"length": 0.5}}
    assert mechanism_of(table).nominal({"mass": 2.0})["mass"] == 2.0


# ---------------------------------------------------------------- flat code and derivation


def test_scalar_code_of_constants_needs_no_functions():
    x = sp.Symbol("x")
    numbers = [sp.Integer(3), 2, sp.Rational(1, 3), sp.pi, sp.sqrt(2), sp.sin(1), 0.1 + 0.2]
    out = scalar_code([x], numbers)(np, np.zeros(4))
    assert out == (3.0, 2.0, 1 / 3, np.pi, 2.0**0.5, np.sin(1.0), 0.1 + 0.2)  # every digit


@pytest.mark.parametrize("xp", [np, torch], ids=["numpy", "torch"])
def test_scalar_code_of_powers_roots_and_functions(xp):
    x, y = sp.symbols("x y")
    outputs = [
        sp.sqrt(x),
        1 / sp.sqrt(x),
        sp.sqrt(2) * x,
        x ** sp.Rational(3, 2),
        x**-2,
        sp.Integer(2) ** 3 * x,
        sp.exp(-((y / x) ** 2)),
        sp.atan(y) + sp.tanh(x) * sp.sin(y) ** 2,
        (x + y) * sp.cos(x + y) + sp.log(x + y),
    ]
    a, b = np.array([0.5, 2.0, 7.0]), np.array([0.1, 1.0, 3.0])
    expected = sp.lambdify([x, y], outputs)(a, b)
    arguments = (a, b) if xp is np else (torch.from_numpy(a), torch.from_numpy(b))
    out = scalar_code([x, y], outputs)(xp, *arguments)
    for actual, wanted in zip(out, expected, strict=True):
        np.testing.assert_allclose(actual, wanted, rtol=1e-14)


def test_scalar_code_shares_what_repeats():
    """A counting namespace: sin of the same angle is computed once."""
    calls = []

    class Counting:
        @staticmethod
        def sin(x):
            calls.append(x)
            return np.sin(x)

    x, y = sp.symbols("x y")
    out = scalar_code([x, y], [sp.sin(x + y) * x, sp.sin(x + y) * y])(Counting, 1.0, 2.0)
    assert calls == [3.0]
    assert out == (np.sin(3.0), 2.0 * np.sin(3.0))
