"""95 % intervals of shooting hold the truth; 100 sets of each law: comparisons/intervals.py."""

from dataclasses import replace

import coverage_cases
import numpy as np
import pytest
from coverage_cases import case_of, sets_of
from coverage_fits import SETTINGS, by_shooting, shot

from frictionid.arrays import usual_step
from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.fitting.shooting.settings import DEFAULT_BLOCKS
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous

BENT = "presliding of joint 1"


@pytest.fixture(scope="module")
def found():
    """Parameters of six sets of a joint with Stribeck friction, at most 42."""
    case = case_of("stribeck", "joint")
    sets = sets_of(case, range(101, 107), 8, late=True, substeps=2)
    return [e for data in sets for e in by_shooting(case, data)]


def test_intervals_hold_the_truth(found):
    held = [e.held for e in found if e.identified]
    assert len(held) > 30
    assert np.mean(held) > 0.85  # 0.95 less three standard deviations of 42 cases


def test_intervals_are_no_wider_than_errors_ask_for(found):
    ratio = np.array([e.error / e.half for e in found if e.identified])
    assert 0.2 < np.sqrt(np.mean(ratio**2)) < 0.75  # 0.5 of t distributed errors


def test_bristles_explain_the_motion_to_its_noise():
    """LuGre friction, beside an inertia and a delay that nobody knew.

    They bend less, as their damping does not show: nothing is said of how far.
    """
    case = case_of("lugre", "joint")
    fit = shot(sets_of(case, [102], 8, late=True)[0], case.law)
    assert fit.diagnostics.angle_noise[0] < 1.2 * coverage_cases.NOISE["joint"]
    bent = fit.covariance.identified[[p.name for p in fit.covariance.parameters].index(BENT)]
    assert not bent and any(w.startswith(f"{BENT} has no") for w in fit.covariance.undetermined)


# --- Blocks that are not free, where these would show ---------------------------------------------

PLAIN, LEVEL = case_of("coulomb_viscous", "joint"), 0.12  # [N m]


def data_of(seed, recordings=6, late=False):
    return sets_of(PLAIN, [seed], recordings, late=late, substeps=2)[0]


def coulomb_of(data, *more):
    """Interval of the Coulomb level with more blocks free, and the warnings."""
    start = Friction(PLAIN.law, PLAIN.values)
    found = refine(start, data, (FrictionBlock(), *more), SETTINGS)
    return found.covariance.interval()[0], found.diagnostics.warnings


@pytest.mark.parametrize("seed", [1, 2])
def test_intervals_under_all_free_blocks_hold_the_truth(seed):
    """The torque acts 12 ms late, and a rotor is missing from the nominal mechanism."""
    data = data_of(seed, late=True)
    for more, omitted in (
        ((), ("inertia", "delay")),
        ((DelayBlock(),), ("inertia",)),
        ((InertiaBlock(),), ("delay",)),
        ((InertiaBlock(), DelayBlock()), ()),
    ):
        (low, high), warnings = coulomb_of(data, *more)
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


@pytest.mark.parametrize(("samples", "held"), [(0.5, False), (1.5, True)])
def test_a_torque_that_acts_less_than_a_sample_early_may_be_no_held_one(samples, held):
    def later(recording):
        u = recording.torque
        torque = u._replace(time=u.time + samples * usual_step(u.time))
        return replace(recording, torque=torque)

    data = data_of(1)
    data = replace(data, recordings=tuple(map(later, data.recordings)))
    _, warnings = coulomb_of(data, DelayBlock())
    (words,) = (w for w in warnings if "before it was logged" in w)
    assert ("[hold]" in words) != held


# --- A model that does not explain the motion: intervals hold what another setting would give -----

UNEXPLAINED = "what is fitted does not explain the motion"


def loaded_gear(seed):
    """A gear whose friction grows with the load."""
    return sets_of(case_of("gear_load", "joint"), [seed], 4, late=True, substeps=2)[0]


def test_windows_of_other_lengths_give_intervals_that_overlap():
    blocks = (FrictionBlock(), InertiaBlock())
    short, long = (
        shot(loaded_gear(1), CoulombViscous(), blocks, Settings(windows=windows))
        for windows in ((0.1, 0.2), (0.1, 0.3, 1.0))
    )
    assert UNEXPLAINED in " ".join(long.diagnostics.warnings)
    a, b = (f.covariance.interval(0.95) for f in (short, long))
    assert ((a[:, 0] < b[:, 1]) & (b[:, 0] < a[:, 1])).all()


def test_base_parameters_stay_free_where_the_motion_is_not_explained(monkeypatch):
    """Intervals hold the errors of the model; at nominal values these would be larger."""
    monkeypatch.setitem(coverage_cases.NOISE, "joint", 1e-4)
    found = shot(loaded_gear(3), CoulombViscous(), DEFAULT_BLOCKS, Settings())
    assert UNEXPLAINED in " ".join(found.diagnostics.warnings)
    free = {p.name for p in found.covariance.parameters if p.tolerance > 0}
    assert {"inertia", "gravity"} <= free
    assert not any("stays at" in warning for warning in found.diagnostics.warnings)
