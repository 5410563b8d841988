"""Every mechanism passes `check_mechanism`, and a mistake in any of its parts does not."""

from dataclasses import replace

import pytest
from fixtures.cart_poles import cart_pole
from fixtures.mistakes import changes, mistakes
from fixtures.random_machines import MECHANISMS, wrapped

from frictionid.errors import InputError
from frictionid.mechanics import (
    acrobot,
    check_mechanism,
    linear_axis,
    two_mass_axis,
    unit_inertia,
)

MASSES = dict(motor_inertia=0.01, load_inertia=0.04, stiffness=80.0)
ALL = {
    **MECHANISMS,
    "linear_axis": linear_axis(),
    "unit": unit_inertia(("m", "rad")),
    "wrapped": wrapped(acrobot()),
    "cart-pole": cart_pole(),
    "another cart-pole": cart_pole().with_values({"cart": 2.0, "length": 0.1}),
}
for gap in (0.0, 0.02):
    ALL |= {f"two_mass_axis, {gap}": two_mass_axis(gap=gap, **MASSES)}
    ALL |= {f"hanging, {gap}": two_mass_axis(True, gap, **MASSES, moment=2.0)}


@pytest.mark.parametrize("name", ALL)
def test_mechanisms_keep_to_the_protocol(name):
    check_mechanism(ALL[name])


PARTS = """
base => acrobot: base of a batch must be that of each entry
batch => energy of a batch must be that of each entry
dynamics => dynamics and terms must have the same h
asymmetric => M must be symmetric
negative => these parameters give no inertia|M must be positive definite
momentum => momentum must be M w
dLdq => dLdq must be the derivative of T - V
energy => dLdq must be the derivative of T - V
by_q => partials by q must be
by_w => partials by w must be
by_p => the regressor times p must be
load => load must be finite and not negative
"""


@mistakes(PARTS)
def test_a_wrong_part_is_named(wrong, words):
    with pytest.raises((AssertionError, InputError), match=words):
        check_mechanism(wrapped(acrobot(), wrong))


FACTS = """
joints = ["a", "a"] => joints must be different
position_units = ["rad"] => position_units must have one entry per joint
driven = [false, true, true] => driven must have one entry per joint
base_units = [] => base_units must have one entry per base parameter
driven = [false, false] => terms must have the mechanism's B
"""


@mistakes(FACTS)
def test_facts_that_contradict_each_other_are_named(wrong, words):
    with pytest.raises(AssertionError, match=words):
        check_mechanism(replace(wrapped(acrobot()), **changes(wrong)))
