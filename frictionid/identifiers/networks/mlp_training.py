"""What a network learns from: residuals of rows drawn for each fold, as tensors.

Everything that does not change while it learns is computed before: what the network sees of each
node, under the scales of each fold. All folds stand side by side, as one model.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Nodes
from frictionid.friction.laws.network_law import NetworkLaw
from frictionid.identifiers.residual import Problem

Tensor = Any  # of torch


class Rows:
    """Rows of a problem, one by one, for laws whose memory holds samples, or nothing at all.

    theta (F, n, P): scales of each fold stand in it; weights (F, K)
    """

    rows = 1  # in each item that is drawn

    def __init__(
        self, law: NetworkLaw, problem: Problem, theta: Array, weights: Array, device: str
    ):
        self.law, self.device = law, device
        memory = window(law, problem.nodes)
        self.items, self.nodes = len(problem.r), len(problem.nodes.time)
        self.folds, self.joints = theta.shape[:2]
        # one more row without any weight, for folds that have fewer of them
        self.weights = self.tensor(np.pad(told(weights, problem), ((0, 0), (0, 1))))
        self.r = self.tensor(np.pad(problem.r, ((0, 1), (0, 0))))
        self.G = self.tensor(np.pad(problem.G, ((0, 1), (0, 0), (0, 0))))
        self.stencil = self.tensor(np.pad(problem.stencil, ((0, 1), (0, 0))))
        self.coefficients = self.tensor(problem.coefficients)[:, None]
        self.before = self.tensor(np.arange(self.folds) * self.nodes)[:, None]
        of = law.features(theta[:, None], problem.nodes.inputs, memory)
        parts = ((of.z, 2), (of.share, 1), (of.sign, 1))
        self.features = [self.tensor(by_fold(part, theta, axes)) for part, axes in parts]

    def counted(self, weights: Array) -> Array:
        """Which items count under weights (F, K)."""
        return weights > 0

    def tensor(self, values: Array) -> Tensor:
        """Values on the device; a copy."""
        return torch.tensor(values, device=self.device)

    def cost(self, theta: Tensor, items: Tensor) -> Tensor:
        """Weighted squares (F,) of the items (F, B)."""
        torque = self._torque(theta, self.stencil[items].flatten(1))
        mean = (torque.unflatten(1, (-1, len(self.coefficients))) * self.coefficients).sum(2)
        e = self.r[items] - (self.G[items] * mean[..., None, :]).sum(-1)
        return (self.weights.gather(1, items) * (e * e).sum(-1)).mean(1)

    def _torque(self, theta: Tensor, nodes: Tensor) -> Tensor:
        """Torque (F, N, n) at nodes (F, N)."""
        flat = (nodes + self.before).flatten()
        z, share, sign = (s.index_select(0, flat).unflatten(0, nodes.shape) for s in self.features)
        level: Tensor = self.law.level(theta[:, None], z, share)
        return level * sign


def by_fold(values: Array, theta: Array, axes: int) -> Array:
    """Values (..., S, n) of S nodes, or (..., S, n, a) with two axes, of fold after fold."""
    shape = (len(theta), *values.shape[-1 - axes :])
    return np.concatenate(np.broadcast_to(values, shape))


def told(weights: Array, problem: Problem) -> Array:
    """Weights (F, K) of which those of a row are one on average, in squares of its fold's size."""
    squares = weights @ (problem.r**2).sum(1)
    return weights * ((weights > 0).sum(axis=1) / np.maximum(squares, 1e-300))[:, None]


def window(law: NetworkLaw, nodes: Nodes) -> tuple[Array, ...]:
    """Memory (S, n) at each node of a law that remembers samples of the velocity, newest first.

    Raises
    ------
    InputError
        Where a law has a memory of another kind.
    """
    if not law.has_memory:
        return ()
    if not law.reads_window:
        raise InputError(f"{law}: its memory is none of those that training knows")
    first = np.repeat(nodes.first[:-1], np.diff(nodes.first))
    place = np.arange(len(nodes.time)) - first
    newest = place // nodes.per_sample
    ages = [np.maximum(newest - age, 0) for age in range(law.samples)]
    places = [first + age * nodes.per_sample for age in ages]
    q, w = nodes.inputs.q, nodes.inputs.w
    if not law.presliding:
        return tuple(w[at] for at in places)
    # before a recording's begin, as the law's memory starts: as if the velocity had been constant
    missing = [np.maximum(age - newest, 0)[:, None] for age in range(law.samples)]
    pairs = zip(places, missing, strict=True)
    return (w[places[0]], *(q[at] - law.sample_time * k * w[first] for at, k in pairs))
