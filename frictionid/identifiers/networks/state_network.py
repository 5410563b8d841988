"""Networks without physics: acceleration learned from the states and torques of all joints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.friction.laws.ensemble import together
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.networks.early_stopping import held_out
from frictionid.identifiers.networks.ensemble_seeds import member_seeds
from frictionid.identifiers.networks.network import Network, check_device
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import normalised
from frictionid.identifiers.sparse_dynamics import accelerations

_LEAST = 1e-3  # of the largest speed or torque of any joint


@dataclass(frozen=True)
class StateNetwork(Identifier):
    """Trains a `StateMLP` or a `StateLSTM`, as `training` trains a network of friction.

    Its law's joints are those of the problem, its sample time that of the samples.

    Raises
    ------
    InputError
        For rows of joints at rest that are left open: here they are to be explained.
    """

    training: Network

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        own = self.training
        check_device(own.device)
        weights = normalised(weights, problem)
        law: Any = replace(own.law, joints=problem.r.shape[1])
        if law.sample_time is not None:
            law = replace(law, sample_time=float(np.median(problem.dt)))
        scales, seeds = _scales(problem, weights), member_seeds(seed, own.members)
        start = np.concatenate(
            [law.initial_parameters(scales, np.random.default_rng(s)) for s in seeds]
        )
        inner = np.concatenate([held_out(problem, weights, own.share, s) for s in seeds])
        every = np.tile(weights, (own.members, 1))
        queues = [s for s in seeds for _ in weights]
        theta = own.trained(law, problem, start, (every * ~inner, every * inner), queues)
        return together(law, np.split(theta, own.members))


def _scales(problem: Problem, weights: Array) -> Array:
    """Sizes (F, n, 3) in each fold: of a joint's acceleration, and of speeds and torques of all."""
    y, _ = accelerations(problem)
    inputs = problem.nodes.inputs
    share = weights / weights.sum(axis=1, keepdims=True)
    out = np.empty((len(weights), y.shape[1], 3))
    out[..., 0] = np.sqrt(share @ y**2)
    for i, values in enumerate((inputs.w, inputs.u), start=1):
        size = np.sqrt((share @ problem.mean(values) ** 2).max(axis=1, keepdims=True))
        out[..., i] = np.where(size > 0, size, 1.0)
    return np.maximum(out, _LEAST * out.max(axis=1, keepdims=True))
