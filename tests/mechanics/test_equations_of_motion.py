"""Laws of mechanics: terms that belong together, energy, linearity, arrays of any kind."""

import pickle

import numpy as np
import pytest
import torch
from fixtures.random_machines import (
    MECHANISMS,
    assert_close,
    assert_same_terms,
    drawn,
    random_case,
)
from fixtures.refusals import assert_refused

from frictionid.arrays import times
from frictionid.mechanics import acrobot, double_pendulum, pendulum


@pytest.fixture(params=MECHANISMS)
def mechanism(request):
    return MECHANISMS[request.param]


# ---------------------------------------------------------------- base parameters


def test_motion_shows_every_base_parameter_by_itself(mechanism):
    _, q, w = random_case(mechanism, 14)
    a = np.random.default_rng(15).normal(scale=100.0, size=q.shape)
    columns = []
    for unit in np.eye(len(mechanism.base_names)):
        M, h = mechanism.dynamics(unit, q, w)
        columns.append((times(M, a) - h).ravel())
    regressor = np.stack(columns, axis=-1)
    singular = np.linalg.svd(regressor / np.linalg.norm(regressor, axis=0), compute_uv=False)
    assert singular.min() > 0.05


def test_without_a_rotor_at_joint_2_the_double_pendulum_has_five_base_parameters():
    five = ("inertia_11", "inertia_22", "coupling", "gravity_1", "gravity_2")
    assert double_pendulum((True, False)).base_names == five
    assert double_pendulum((False, False)).base_names == five
    assert double_pendulum((False, True)).base_names == ("inertia_11", "inertia_12", *five[1:])


def test_unknown_parameter_names_are_refused():
    m = pendulum()
    with assert_refused("pendulum has no parameter 'masss'; did you mean 'mass'"):
        m.base({"masss": 1.0})
    with assert_refused("has no parameter 'm'"):
        m.load({"m": 1.0}, np.zeros(1), np.zeros(1), np.zeros(1))


# ---------------------------------------------------------------- arrays


def test_torch_gives_what_numpy_gives(mechanism):
    v, q, w, u = drawn(mechanism, 23)
    tv = {k: torch.from_numpy(x) for k, x in v.items()}
    tq, tw, tu = (torch.from_numpy(x) for x in (q, w, u))
    out = mechanism.terms(mechanism.base(tv), tq, tw)
    assert all(isinstance(x, torch.Tensor) and x.dtype == torch.float64 for x in out)
    assert_same_terms(mechanism.terms(mechanism.base(v), q, w), type(out)(*map(np.asarray, out)))
    assert_close(mechanism.load(tv, tq, tw, tu).numpy(), mechanism.load(v, q, w, u))


def test_gradients_pass_from_the_motion_to_the_physical_parameters():
    m = acrobot()
    rotor = torch.tensor(1e-6, dtype=torch.float64, requires_grad=True)
    M = m.inertia(m.base({"rotor": rotor, "gear": 18.0}), torch.zeros(2, dtype=torch.float64))
    (slope,) = torch.autograd.grad(M[1, 1], rotor)
    assert float(slope) == pytest.approx(18.0**2)


def test_one_parameter_per_row_and_the_others_common():
    """An exchangeable mass: one entry for each recording, all other parameters numbers."""
    m = acrobot()
    p = m.base({"m4": np.array([0.0, 0.084])})
    assert p.shape == (2, 6)
    assert_close(p[1], m.base({}))
    assert_close(p[0], m.base({"m4": 0.0}))
    q, w = np.zeros((2, 2)), np.zeros((2, 2))
    load = m.load({"m4": np.array([0.0, 0.084])}, q, w, q)
    assert_close(load[0] - load[1], np.full(2, -0.084 * 9.81), 1e-10)


def test_whole_numbers_are_taken_as_floats():
    m = pendulum()
    p = m.base({"mass": 2, "length": np.array([1, 2])})
    assert p.dtype == np.float64
    np.testing.assert_array_equal(p[:, 0], [2.0, 8.0])


def test_a_motors_constants_are_parameters_that_move_nothing():
    plain, motor = pendulum(), pendulum(motor=True)
    assert motor.base_names == plain.base_names
    assert set(motor.defaults) - set(plain.defaults) == {"kt", "R"}
    physical = {"mass": 0.3, "length": 0.2, "rotor": 0.01}
    assert_close(motor.base({**physical, "kt": 0.4, "R": 3.0}), plain.base(physical))
    q, w, u = np.random.default_rng(0).normal(size=(3, 4, 1))
    assert_close(motor.load(physical, q, w, u), plain.load(physical, q, w, u))
    with pytest.raises(ValueError, match="motor: it should be a valid boolean, not 'yes'"):
        pendulum(motor="yes")


def test_machines_of_one_kind_share_their_compiled_code():
    light, heavy = acrobot(m4=0.0), acrobot(m4=0.1)
    assert light != heavy and light._code is heavy._code
    assert acrobot() == acrobot() != pendulum()
    assert pickle.loads(pickle.dumps(heavy))._code is heavy._code
