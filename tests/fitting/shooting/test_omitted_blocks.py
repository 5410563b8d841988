"""Intervals hold what blocks that are not free would change, where these would show."""

import pytest
from coverage_cases import case_of, sets_of
from coverage_fits import SETTINGS

from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import refine
from frictionid.friction import Friction

CASE = case_of("coulomb_viscous", "joint")
START = Friction(CASE.law, CASE.values)
LEVEL = 0.12  # [N m]


def data_of(seed, recordings=6, late=False):
    return sets_of(CASE, [seed], recordings, late=late, substeps=4)[0]


def coulomb_of(dataset, *more):
    """Interval of the Coulomb level with more blocks free, and the warnings."""
    found = refine(START, dataset, (FrictionBlock(), *more), SETTINGS)
    return found.covariance.interval()[0], found.diagnostics.warnings


@pytest.mark.parametrize("seed", [1, 2])
def test_intervals_under_all_free_blocks_hold_the_truth(seed):
    """The torque acts 12 ms late, and a rotor is missing from the nominal mechanism."""
    dataset = data_of(seed, late=True)
    for more, omitted in (
        ((), ("inertia", "delay")),
        ((DelayBlock(),), ("inertia",)),
        ((InertiaBlock(),), ("delay",)),
        ((InertiaBlock(), DelayBlock()), ()),
    ):
        (low, high), warnings = coulomb_of(dataset, *more)
        assert low < LEVEL < high
        assert all(any(repr(name) in w for w in warnings) for name in omitted)


def test_blocks_that_show_nothing_change_nothing():
    (low, high), warnings = coulomb_of(data_of(3))
    assert low < LEVEL < high and high - low < 0.1 * LEVEL
    assert not warnings


def test_a_machine_without_a_motor_has_no_delay_to_omit():
    (low, high), warnings = coulomb_of(data_of(4, recordings=2))  # two free decays
    assert low < LEVEL < high
    assert not any("'delay'" in w for w in warnings)
