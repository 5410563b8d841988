"""Every mechanism passes `check_mechanism`, and a mistake in any of its parts does not."""

from dataclasses import replace

import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.random_machines import MECHANISMS, wrapped

from frictionid.errors import InputError
from frictionid.mechanics import (
    acrobot,
    check_mechanism,
    linear_axis,
    unit_inertia,
)

ALL = {**MECHANISMS, "linear_axis": linear_axis(), "unit": unit_inertia(("m", "rad"))}


@pytest.mark.parametrize("name", ALL)
def test_built_in_mechanisms_keep_to_the_protocol(name):
    check_mechanism(ALL[name])


def test_a_wrapped_mechanism_passes():
    check_mechanism(wrapped(acrobot()))


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
