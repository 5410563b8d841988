"""Laws of plants: a plant is its mechanism with parameters filled in, one row or many."""

import numpy as np
import pytest
import torch
from fixtures.random_machines import (
    MECHANISMS,
    assert_close,
    assert_same_terms,
    drawn,
    physical,
    states,
)
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.arrays import plain
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.mechanics import Plant, acrobot, pendulum


def recording(name, parameters):
    time = np.array([0.0, 0.1])
    zero = Signal(time, np.zeros((2, 2)))
    return Recording(name, zero, zero._replace(hold="previous"), parameters=parameters)


def dataset(parameters, overrides):
    table = {"kind": "acrobot", "parameters": parameters}
    recordings = tuple(recording(f"r{i}", o) for i, o in enumerate(overrides))
    return Dataset("made up", table, recordings, {}, {}, None)


@pytest.mark.parametrize("name", MECHANISMS)
def test_plant_passes_its_parameters_to_the_mechanism(name):
    mechanism = MECHANISMS[name]
    v, q, w, u = drawn(mechanism, 1)
    plant, p = Plant.from_parameters(mechanism, v), mechanism.base(v)
    assert_close(plant.p, p)
    assert plant.n == mechanism.n
    assert_same_terms(plant.terms(q, w), mechanism.terms(p, q, w))
    for ours, theirs in zip(plant.dynamics(q, w), mechanism.dynamics(p, q, w), strict=True):
        assert_close(ours, theirs)
    assert_close(plant.load(q, w, u), mechanism.load(v, q, w, u))


def test_an_index_picks_rows_of_everything():
    mechanism, rng = acrobot(), np.random.default_rng(2)
    v = physical(mechanism, rng, (4,))
    plant = Plant.from_parameters(mechanism, v | {"g": 9.81})
    rows = np.array([2, 0, 2])
    q, w = states(mechanism, rng, (3,))
    picked, expected = plant[rows], {k: np.broadcast_to(x, 4)[rows] for k, x in v.items()}
    expected["g"] = np.full(3, 9.81)
    assert {k: x.tolist() for k, x in picked.parameters.items()} == {
        k: x.tolist() for k, x in expected.items()
    }
    assert_close(picked.p, mechanism.base(expected))
    assert_close(picked.load(q, w, 0.0 * q), mechanism.load(expected, q, w, 0.0 * q))
    assert plant[1].p.shape == (6,)


def test_gradients_pass_through_a_plant_of_tensors():
    mass = torch.tensor([0.5, 1.0], dtype=torch.float64, requires_grad=True)
    plant = Plant.from_parameters(pendulum(), {"mass": mass, "length": 2.0})
    hanging = torch.zeros((2, 1), dtype=torch.float64)
    total = plant.p[:, 0].sum() + plant.load(hanging, hanging, hanging).sum()
    (slope,) = torch.autograd.grad(total, mass)
    assert_allclose(plain(slope), 2.0**2 + 9.81)


def test_recordings_keep_their_own_parameters_before_replacements_and_the_table():
    data = dataset({"m4": 0.084, "m3": 0.2}, [{}, {"m4": 0.0}])
    names = acrobot().base_names
    plant = plant_of(data)
    assert plant.mechanism == acrobot(m4=0.084, m3=0.2)
    assert plant.p.shape == (2, len(names))
    assert_array_equal(plant.parameters["m4"], [0.084, 0.0])
    assert_array_equal(plant.parameters["m3"], [0.2, 0.2])
    replaced = plant_of(data, {"m4": 0.5, "m3": 0.3})
    assert_array_equal(replaced.parameters["m4"], [0.5, 0.0])
    assert_array_equal(replaced.parameters["m3"], [0.3, 0.3])
    assert data.mechanism.values == {"m4": 0.084, "m3": 0.2}


def test_plant_of_a_data_set_refuses_a_wrong_replacement():
    with assert_refused("acrobot has no parameter 'm9'"):
        plant_of(dataset({}, [{}]), {"m9": 1.0})


def test_plain_is_a_numpy_array_without_gradient():
    tensor = torch.ones(3, dtype=torch.float64, requires_grad=True)
    for array in (tensor, 2.0 * tensor - 1.0, np.ones(3), [1.0, 1.0, 1.0]):
        assert type(plain(array)) is np.ndarray
        assert_array_equal(plain(array), np.ones(3))


@pytest.mark.parametrize(
    "kind, angles, message",
    [
        ("acrobot", 1, r"'a': 1 columns of angle, but acrobot has 2 joints; give one"),
        ("linear_axis", 2, r"2 columns of angle, but linear_axis has 1 joint; give"),
    ],
)
def test_columns_that_the_mechanism_does_not_have_are_refused(kind, angles, message):
    time = np.array([0.0, 0.1])
    angle = Signal(time, np.zeros((2, angles)))
    data = Dataset("rig", {"kind": kind}, (Recording("a", angle, angle),))
    with assert_refused(message):
        plant_of(data)
