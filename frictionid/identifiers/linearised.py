"""A law along the rows of a problem, to first order in its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction, Law, Nodes, along
from frictionid.identifiers.residual import Problem

_DIFFERENCE = 1e-6
_NUMBERS = 1e7  # torques at a time


class Rows(NamedTuple):
    """Residuals of a law and their slopes; thetas are flat here, (F, N) with N = n P."""

    law: Law
    problem: Problem

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.problem.r.shape[-1])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest parameters, (N,) each."""
        low, high = np.tile(np.reshape(self.law.bounds, (-1, 2)), (self.joints, 1)).T
        return low, high

    def friction(self, theta: Array) -> Friction:
        """Friction with the parameters theta."""
        return Friction(self.law, theta.reshape(len(theta), self.joints, len(self.law.names)))

    def residual(self, theta: Array) -> Array:
        """Residuals e, shape (F, K, n) [rad/s]."""
        return self.problem.residual(along(self.friction(theta), self.problem.nodes))

    def slopes(self, theta: Array) -> Array:
        """-de/dtheta = G dTf/dtheta, shape (F, K, n, n, P): only Tf_j depends on theta_j."""
        at_nodes = _gradient(self.friction(theta), self.problem)
        F, S, n, P = at_nodes.shape
        mean = self.problem.mean(at_nodes.reshape(F, S, n * P))
        return self.problem.G[..., None] * mean.reshape(F, len(self.problem.r), 1, n, P)

    def equations(self, theta: Array, residual: Array, weights: Array) -> tuple[Array, Array]:
        """Half the downhill gradient (F, N) of the weighted squares, and their curvature (F, N, N).

        Fold by fold, which stays in the processor's cache; with memory, time is the outer loop.

        Raises
        ------
        InputError
            Where they are not finite.
        """
        F, N = theta.shape
        together = max(F, 1) if self._remembers() else 1
        downhill, curvature = np.empty((F, N)), np.empty((F, N, N))
        for begin in range(0, F, together):
            part = slice(begin, begin + together)
            J = self.slopes(theta[part]).reshape(len(theta[part]), self.problem.r.size, N)
            weighted = np.swapaxes(J * np.repeat(weights[part], self.joints, 1)[..., None], 1, 2)
            downhill[part] = (weighted @ residual[part].reshape(len(J), -1, 1))[..., 0]
            curvature[part] = weighted @ J
        self.check(downhill, curvature)
        return downhill, curvature

    def check(self, *arrays: Array) -> None:
        """Refuse to go on with numbers that are not finite.

        Raises
        ------
        InputError
            Saying where to look.
        """
        if not all(np.isfinite(array).all() for array in arrays):
            raise InputError(
                f"the fit of {self.law} met numbers that are not finite: look for such rows in the "
                "problem, and for parameters within the law's bounds where its torque is not finite"
            )

    def _remembers(self) -> bool:
        theta = np.reshape(self.law.initial[0], (1, -1))
        return bool(self.law.start(theta, self.problem.nodes.inputs))


def _gradient(friction: Friction, problem: Problem) -> Array:
    """dTf_j/dtheta_jp along the nodes, (F, S, n, P)."""
    law, nodes, theta = friction.law, problem.nodes, friction.theta
    shape = (len(theta), *nodes.inputs.w.shape, theta.shape[-1])
    by_node = theta[..., None, :, :]
    if hasattr(law, "gradient") and not law.start(by_node, nodes.inputs):
        return np.broadcast_to(law.gradient(by_node, nodes.inputs), shape)
    out, together = np.empty(shape), max(1, int(_NUMBERS / (2 * np.prod(shape[:-1]))))
    for i in range(0, len(law.names), together):
        places = range(i, min(i + together, len(law.names)))
        out[..., i : i + together] = np.moveaxis(_rises(friction, nodes, places), 0, -1)
    return out


def _rises(friction: Friction, nodes: Nodes, places: Sequence[int]) -> Array:
    """Slopes of the torque along the nodes in some parameters, by differences, (p, F, S, n)."""
    law, theta = friction.law, friction.theta
    both = np.repeat(np.repeat(theta[None], 2, axis=0)[:, None], len(places), axis=1)
    for k, i in enumerate(places):
        step = _DIFFERENCE * np.maximum(1e-2, np.abs(theta[..., i]))
        low, high = law.bounds[i]
        both[0, k, ..., i] = np.minimum(theta[..., i] + step, high)
        both[1, k, ..., i] = np.maximum(theta[..., i] - step, low)
    up, down = along(Friction(law, both), nodes)  # time is the outer loop: go through it once
    apart = np.stack([(both[0] - both[1])[k, ..., i] for k, i in enumerate(places)])
    return (up - down) / apart[..., None, :]
