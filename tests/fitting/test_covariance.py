"""Parameters that mean nothing where another one may be zero are not called identified."""

import numpy as np
from fixtures.driven_pendulum import driven_pendulum

from frictionid.data.calibration import Calibration
from frictionid.fitting.covariance import meaningless
from frictionid.fitting.parameters import Estimate, FrictionBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.friction import Friction
from frictionid.friction.laws import LuGre, Stribeck
from frictionid.mechanics import pendulum


def entries_of(friction):
    return FrictionBlock().parameters(Estimate(friction, Calibration.ideal(1), pendulum()))


def hanging(friction, *weak):
    entries = entries_of(friction)
    names = [e.name.split(" ")[0] for e in entries]
    found = meaningless(friction, entries, np.isin(names, weak))
    return {names[k]: tuple(names[i] for i in on) for k, on in found.items()}


def test_a_velocity_hangs_on_its_peak_and_nothing_hangs_on_it():
    friction = Friction(Stribeck(), np.array([[0.1, 0.03, 1.5, 0.01]]))
    assert list(Stribeck().names) == ["coulomb", "peak", "stribeck_velocity", "viscous"]
    assert hanging(friction, "peak") == {"stribeck_velocity": ("peak",)}
    assert hanging(friction, "peak", "coulomb") == {"stribeck_velocity": ("peak",)}
    assert hanging(friction, "stribeck_velocity", "viscous", "coulomb") == {}
    assert hanging(friction) == {}


def test_a_doubtful_peak_leaves_no_velocity():
    friction = Friction(Stribeck(), np.array([[0.1, 0.03, 1.5, 0.01]]))
    none, peak = np.zeros(4, dtype=bool), np.array([False, True, False, False])
    assert meaningless(friction, entries_of(friction), none, peak) == {2: (1,)}
    assert meaningless(friction, entries_of(friction), none, none) == {}


def test_stiffness_of_a_bristle_shows_before_it_slides():
    friction = Friction(LuGre(), np.array([[0.1, 0.03, 1.5, 0.01, 0.01, 0.1, 0.5]]))
    assert LuGre().names[4:] == ("presliding", "damping", "damping_velocity")
    assert hanging(friction, "viscous") == {}
    assert hanging(friction, "damping", "peak") == {
        "stribeck_velocity": ("peak",),
        "damping_velocity": ("damping",),
    }


def test_a_peak_that_is_not_there_leaves_no_velocity():
    first = Friction(Stribeck(), np.array([[0.05, 0.01, 1.0, 0.01]]))
    found = refine(first, driven_pendulum(150), settings=Settings(windows=(0.1, 0.33)))
    covariance = found.covariance
    names = [p.name.removesuffix(" of joint 1") for p in covariance.parameters]
    known = dict(zip(names, covariance.identified, strict=True))
    assert known["coulomb"] and known["viscous"]
    assert not known["peak"] and not known["stribeck_velocity"]
