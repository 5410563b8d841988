"""Training set of networks without memory, or whose memory holds samples of the motion: rows.

What the network sees of each node does not change while it learns, and is computed before.
"""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.networks.fold_stack import FoldStack, Tensor, WeightedRows
from frictionid.friction import Nodes
from frictionid.friction.laws.network_law import NetworkLaw


class RowTrainingSet:
    """Rows of a problem under weights (F, K); each is an item of a batch.

    used : (F, items), which of them have a weight in a fold
    """

    rows_per_item = 1

    def __init__(self, stack: FoldStack, weights: Array):
        problem = stack.problem
        self.law, self.items = stack.law, len(problem.r)
        self.rows, self.used = WeightedRows(stack, weights), np.asarray(weights > 0)
        self.stencil = stack.tensor(np.pad(problem.stencil, ((0, 1), (0, 0))))
        self.coefficients = stack.tensor(problem.coefficients)[:, None]
        self.first = stack.first_nodes()[:, None]
        memory = window(stack.law, problem.nodes)
        of = stack.law.features(stack.theta[:, None], problem.nodes.inputs, memory)
        parts = ((of.z, 2), (of.share, 1), (of.sign, 1))
        self.features = [stack.by_fold(part, axes) for part, axes in parts]

    def cost(self, theta: Tensor, items: Tensor) -> Tensor:
        """Mean weighted squares (F,) of the items (F, B)."""
        torque = self._torque(theta, self.stencil[items].flatten(1))
        mean = (torque.unflatten(1, (-1, len(self.coefficients))) * self.coefficients).sum(2)
        return self.rows.squares(items, mean).mean(1)

    def _torque(self, theta: Tensor, nodes: Tensor) -> Tensor:
        """Torque (F, N, n) at nodes (F, N)."""
        flat = (nodes + self.first).flatten()
        z, share, sign = (s.index_select(0, flat).unflatten(0, nodes.shape) for s in self.features)
        level: Tensor = self.law.level(theta[:, None], z, share)
        return level * sign


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
        raise InputError(f"{law}: networks with a memory of this kind cannot be trained")
    first = np.repeat(nodes.first[:-1], np.diff(nodes.first))
    place = np.arange(len(nodes.time)) - first
    newest = place // nodes.per_sample
    ages = [np.maximum(newest - age, 0) for age in range(law.samples)]
    places = [first + age * nodes.per_sample for age in ages]
    q, w = nodes.inputs.q, nodes.inputs.w
    if not law.presliding:
        return tuple(w[at] for at in places)
    # before a recording, as in the initial memory state: as if the velocity had been constant
    missing = [np.maximum(age - newest, 0)[:, None] for age in range(law.samples)]
    pairs = zip(places, missing, strict=True)
    return (w[places[0]], *(q[at] - law.sample_time * k * w[first] for at, k in pairs))
