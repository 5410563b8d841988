"""Where tensors are, they stay: nothing that a step or a cost makes is left on another device.

No machine of these tests has a GPU. What runs without looking at values runs on `meta`, which
refuses to compute with tensors of another device. The physics step does look: there, whatever makes
a tensor must name its device, and no NumPy array may meet a tensor.
"""

import numpy as np
import pytest
import torch
from fixtures.paths import ROOT
from torch.overrides import TorchFunctionMode

from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.step import acceleration, semi_implicit_step
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.identifiers.network_data import (
    FoldStack,
    RowTrainingSet,
    SequenceTrainingSet,
)
from frictionid.friction import Friction, Inputs
from frictionid.friction.laws import LSTM, MLP, CoulombViscous, FilmLag, LuGre, Stribeck, WindowMLP
from frictionid.mechanics import Plant

MAKERS = {
    *(torch.zeros, torch.ones, torch.empty, torch.full, torch.eye, torch.arange, torch.linspace),
    *(torch.tensor, torch.as_tensor, torch.asarray),
}
LAWS = [CoulombViscous(), Stribeck(), LuGre(), FilmLag(), MLP((4,)), LSTM(2, hidden=(3,))]


class Strays(TorchFunctionMode):
    """Names of the functions that made a tensor on no named device, or met a NumPy array."""

    def __init__(self):
        super().__init__()
        self.found = []

    def __torch_function__(self, function, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        tensors = any(isinstance(a, torch.Tensor) for a in args)
        arrays = any(isinstance(a, np.ndarray) for a in args)
        makes = function in MAKERS and kwargs.get("device") is None
        if (makes and not tensors) or (arrays and tensors):
            self.found.append(getattr(function, "__name__", str(function)))
        return function(*args, **kwargs)


def acrobot():
    plant = plant_of(load_dataset(ROOT / "data/acrobot_clean"))[0]
    return Plant(plant.mechanism, {}, torch.as_tensor(plant.p))


def friction_of(law):
    return Friction(law, torch.as_tensor(np.tile(np.asarray(law.initial[0]), (2, 1))))


def moved(plant, friction, device):
    """The same on another device."""
    there = Plant(plant.mechanism, {}, plant.p.to(device))
    return there, Friction(friction.law, friction.theta.to(device))


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_the_physics_step_makes_no_tensor_elsewhere(law):
    rng = np.random.default_rng(0)
    q, w, u = (torch.as_tensor(rng.normal(size=(5, 2))) for _ in range(3))
    w[:2] = 0.0  # joints that stick, and others that stop
    dt, held = torch.full((3,), 1 / 60, dtype=q.dtype), u[None] * torch.ones(3, 1, 1)
    plant, friction = acrobot(), friction_of(law)
    with Strays() as strays:
        rollout(plant, friction, State(q, w), held, dt)
    assert strays.found == []


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_accelerations_and_steps_without_stiction_stay_where_they_are(law):
    plant, friction = moved(acrobot(), friction_of(law), "meta")
    q, w, u = torch.zeros(3, 5, 2, dtype=torch.float64, device="meta")
    state = State(q, w, law.start(friction.theta, Inputs(q, w, u, 0.0 * q)))
    now = Instant(plant, friction, state, u)
    assert acceleration(now).device.type == "meta"
    dt = torch.full((1,), 0.01, dtype=q.dtype, device="meta")
    after = semi_implicit_step(now, dt)
    assert {x.device.type for x in (after.q, after.w, *after.memory)} == {"meta"}


def test_a_tensor_of_another_device_is_refused():
    """What the tests above rest on."""
    plant, friction = moved(acrobot(), friction_of(CoulombViscous()), "meta")
    q, w, u = torch.zeros(3, 5, 2, dtype=torch.float64, device="meta")
    with pytest.raises(RuntimeError, match="device"):
        acceleration(Instant(plant, friction, State(q, w), torch.zeros(5, 2, dtype=torch.float64)))


@pytest.mark.parametrize("law", [MLP((4,)), WindowMLP(2, hidden=(3,)), LSTM(3, hidden=(4,))])
def test_costs_of_networks_and_their_gradients_stay_on_the_device(law):
    problem = synthetic_problem(1)
    weights = synthetic_weights(problem)
    shape = (len(weights), problem.r.shape[1], 2)
    theta = law.initial_parameters(np.full(shape, [0.1, 5.0]), np.random.default_rng(0))
    stack = FoldStack(law, [problem] * len(theta), theta, "meta")
    recurrent = law.cells > 0
    training = (
        SequenceTrainingSet(stack, weights, 4, 6) if recurrent else RowTrainingSet(stack, weights)
    )
    leaf = stack.tensor(stack.theta).requires_grad_()
    cost = training.cost(leaf, stack.tensor(np.zeros((len(weights), 5), dtype=int)))
    cost.sum().backward()
    assert cost.device.type == leaf.grad.device.type == "meta"
