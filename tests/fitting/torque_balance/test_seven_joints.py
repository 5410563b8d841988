"""An arm of seven joints: simulated, written, read, and its friction found."""

import numpy as np
import pytest
from fixtures.seven_joints import TRUE, arm_rig, curve_errors

from frictionid.comparison.fit_model import fit_model
from frictionid.data.readers.dataset import load_dataset
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.torque_balance import InverseDynamics
from frictionid.friction.laws import Stribeck
from frictionid.simulate import simulate, write_dataset


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    write_dataset(simulate(arm_rig(folder, 1, recordings=2, seconds=2.5)), folder / "data")
    return load_dataset(folder / "data")


@pytest.fixture(scope="module")
def friction(data):
    return fit_model(data, LeastSquares(Stribeck()), InverseDynamics())


def test_friction_of_every_joint(data, friction):
    """Within 1 % (bar 5 %), with masses and rotors 20 % wrong."""
    assert (curve_errors(friction, data) < 0.01).all()
    estimates = [e for e in friction.provenance.refined.parameters if e.block == "friction"]
    held = [e.holds(TRUE[e.parameter][e.joint]) for e in estimates]
    assert len(held) == 28
    assert np.mean(held) > 0.8


def test_base_parameters_that_the_torques_do_not_tell_are_the_nominal_ones(data, friction):
    held = [e for e in friction.provenance.refined.parameters if e.block == "inertia" and e.held]
    assert len(held) > 5
    assert all(e.value == e.nominal for e in held)
    base = dict(zip(data.mechanism.base_names, friction.calibration.base, strict=True))
    assert [base[e.name] for e in held] == [e.nominal for e in held]
