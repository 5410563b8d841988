"""Networks without physics: acceleration learned from the states and torques of all joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers.sparse_dynamics import accelerations
from frictionid.fitting.networks.network import Network
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.one_step.row_weights import normalised
from frictionid.friction import Friction

_SMALLEST = 1e-3  # of the largest speed or torque of any joint


@dataclass(frozen=True)
class StateNetwork(Identifier):
    """Trains a `StateMLP` or a `StateLSTM`, as `training` trains a network of friction.

    Its law's joints are those of the problem, its sample time that of the samples.

    Raises
    ------
    InputError
        For problems whose rows of joints at rest are masked: here they are to be explained.
    """

    training: Network

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        weights = normalised(weights, problem)
        law = replace(self.training.law, joints=problem.r.shape[1])
        scales = _scales(problem, weights)
        return self.training.train(law, problem, weights, scales, seed)[0]


def _scales(problem: Problem, weights: Array) -> Array:
    """Root mean squares (F, n, 3) of each joint's acceleration, and of speeds and torques of all.

    Of speeds and torques, the same for all joints, those of the joint that has most of it.
    """
    y, _ = accelerations(problem)
    inputs = problem.nodes.inputs
    share = weights / weights.sum(axis=1, keepdims=True)
    out = np.empty((len(weights), y.shape[1], 3))
    out[..., 0] = np.sqrt(share @ y**2)
    for i, values in enumerate((inputs.w, inputs.u), start=1):
        size = np.sqrt((share @ problem.mean(values) ** 2).max(axis=1, keepdims=True))
        out[..., i] = np.where(size > 0, size, 1.0)
    return np.maximum(out, _SMALLEST * out.max(axis=1, keepdims=True))
