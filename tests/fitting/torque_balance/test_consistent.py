"""Base parameters that bodies can have: always, nearest, and untouched where they already are."""

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose

from frictionid.comparison.fit_model import fit_model
from frictionid.data.recordings import Dataset
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.parameters import FrictionBlock, InertiaBlock
from frictionid.fitting.torque_balance import InverseDynamics, TorqueSettings
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import configurations, pendulum
from frictionid.mechanics.rigid_body.rigid_body_tree import (
    moments_of,
    nearest_consistent,
    pseudo_inertia,
)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return wrist.mechanism(tmp_path_factory.mktemp("arm"))


def least(arm, base):
    """Smallest eigenvalue of M over all positions."""
    return np.linalg.eigvalsh(arm.inertia(base, configurations(arm.n, 9))).min()


def metric(draw, base):
    """Some information, of parameters as large as these."""
    A = draw.standard_normal((3 * len(base), len(base))) / np.maximum(np.abs(base), 0.1)
    return 1e4 * A.T @ A


def rotors(arm, base):
    return [p for name, p in zip(arm.base_names, base, strict=True) if name.startswith("rotor")]


def test_moments_and_pseudo_inertias_make_each_other(arm):
    J = pseudo_inertia(arm.tree.inertia)
    assert_allclose(moments_of(J), arm.tree.inertia, atol=1e-12)
    assert (np.linalg.eigvalsh(J) > 0).all()


def test_what_is_consistent_stays(arm):
    """Other bodies of the same joints, drawn at random."""
    draw = np.random.default_rng(0)
    for _ in range(2):
        factors = np.linalg.cholesky(pseudo_inertia(arm.tree.inertia))
        factors = factors + 0.3 * np.tril(draw.standard_normal((3, 4, 4))) * np.abs(factors).max()
        bodies = moments_of(factors @ np.swapaxes(factors, 1, 2))
        base = arm.reduction.regrouping @ np.append(bodies, draw.uniform(0.1, 0.5, 4))
        found = nearest_consistent(arm, base, metric(draw, base))
        assert_allclose(found, base, atol=1e-3 * np.abs(base).max())


def test_what_no_bodies_have_comes_to_the_nearest_that_some_have(arm):
    draw, nominal = np.random.default_rng(1), arm.base({})
    wrong = 0
    for _ in range(2):
        wanted = nominal - 1.5 * np.abs(nominal) * draw.uniform(0, 1, len(nominal))
        weight = metric(draw, nominal)
        found = nearest_consistent(arm, wanted, weight)
        wrong += least(arm, wanted) <= 0
        assert least(arm, found) > 0
        assert min(rotors(arm, found), default=0.0) >= 0
        off = found - wanted
        # no step towards other bodies comes nearer: the set is convex
        for share in draw.uniform(0.5, 2.0, 20):
            towards = share * nominal - found
            assert off @ weight @ towards > -1e-2 * (off @ weight @ off)
    assert wrong == 2


def fitted(data, **settings):
    method = InverseDynamics(
        blocks=(FrictionBlock(), InertiaBlock()), settings=TorqueSettings(**settings)
    )
    return fit_model(data, LeastSquares(CoulombViscous()), method)


def off(arm, base):
    """How far base parameters are from those that bodies can have."""
    weight = np.diag(1e6 / np.maximum(np.abs(arm.base({})), 0.05) ** 2)
    return float(np.abs(nearest_consistent(arm, base, weight) - base).max())


def test_a_fit_to_little_motion_is_consistent(arm):
    """The free one has bodies that there cannot be, and finds no viscous friction of joint 1."""
    short = wrist.dataset(arm, wrist.frame(arm, seconds=1.5))
    free, held = (fitted(short, consistent=flag) for flag in (False, True))
    assert off(arm, np.asarray(free.calibration.base)) > 0.1
    base = np.asarray(held.calibration.base)
    assert off(arm, base) < 1e-6 and least(arm, base) > 0
    errors = [np.abs(np.asarray(f.theta)[:, 1] - wrist.VISCOUS).max() for f in (free, held)]
    assert errors[1] < 0.5 * errors[0]


def test_a_fit_that_is_consistent_anyway_stays(arm):
    data = wrist.dataset(arm, wrist.frame(arm, seconds=3.0))
    free, held = (fitted(data, consistent=flag) for flag in (False, True))
    assert_allclose(held.calibration.base, free.calibration.base, atol=1e-6)
    assert_allclose(held.theta, free.theta, rtol=1e-4)


def test_mechanisms_without_bodies_are_refused():
    t = np.arange(0.0, 4.0, 0.01)
    one = {"time": t, "angle": np.sin(2 * t), "torque": np.cos(2 * t)}
    data = Dataset.from_arrays({"a": one}, pendulum(mass=0.5, length=0.3))
    with assert_refused("needs the bodies of a URDF or MJCF"):
        fitted(data, consistent=True)
