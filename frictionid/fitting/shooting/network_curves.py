"""Static networks in shooting: polynomials stand for their curves, which compiled loops follow.

A network of its own joint's velocity enters the motion through one curve y(z) for each direction,
z in [0, 1]. As a sum of Chebyshev's polynomials of 2 z - 1 it is linear in its coefficients, and
takes few operations. Changes of the weights are, to first order, changes of the coefficients.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.config import Count
from frictionid.friction import Friction, Inputs, Law, Memory
from frictionid.friction.laws.layers import slopes, stacked
from frictionid.friction.laws.levels import on_side
from frictionid.friction.laws.mlp import MLP
from frictionid.friction.laws.network_law import LevelNetwork, fine, side_of

_ITERATIONS = 500  # of half a millisecond
_FIRST = 0.01  # damping, of the mean square of a row of slopes
_CLOSE = 1e-4  # of y, and so of the level: what is closer is the curve that was wanted


@dataclass(frozen=True)
class CurveLaw(LevelNetwork):
    """Tf = level sgn(w), the level of an `MLP` with polynomials of z in place of its layers.

    degree : of the polynomials, one for each direction, or one for both where `odd`
    dissipative, monotone_tail, width, shape : as in `MLP`
    """

    degree: Count = 32
    odd: bool = False
    dissipative: bool = True
    monotone_tail: bool = True
    width: float = 0.02
    shape: str = "tanh"
    kind = ""

    @property
    def sizes(self) -> tuple[int, ...]:
        return (2 - self.odd, 1)

    @property
    def weights(self) -> int:
        """Number of coefficients of one joint."""
        return (2 - self.odd) * (self.degree + 1)

    def drawn(self, rng: np.random.Generator) -> Array:
        """Level curves."""
        return np.zeros(self.weights)

    def inputs(self, theta: Array, x: Inputs, speed: Array, memory: Memory) -> Array:
        return stacked([fine(speed / theta[..., 1]), *([] if self.odd else [side_of(x.w)])])

    def network(self, theta: Array, z: Array) -> Array:
        row, x, total = self.layer_weights(theta), 2.0 * z[..., 0] - 1.0, 0.0 * z[..., 0]
        before, here = x, 0.0 * x + 1.0
        for k in range(self.degree + 1):
            sides = [row[..., i] for i in range(k, self.weights, self.degree + 1)]
            total = total + (sides[0] if self.odd else on_side(z[..., 1], *sides)) * here
            before, here = here, 2.0 * x * here - before
        return total


def has_curve(law: Law, free: Array) -> bool:
    """Whether a law is a network of its own joint's velocity with all weights free, of (P,)."""
    return isinstance(law, MLP) and not law.others and bool(free[len(law.scales) :].all())


def curve_of(network: Friction, changes: Array) -> tuple[Friction, Array]:
    """The friction of a network as a `CurveLaw`, and what changes of its numbers make of that.

    changes : (n, P, r); those of the coefficients are (n, P', r)
    """
    law: Any = network.law
    theta = network.theta
    settings = {f.name: getattr(law, f.name) for f in fields(CurveLaw) if f.name != "degree"}
    curve, first = CurveLaw(**settings), len(law.scales)
    y, by_weights = _on_nodes(network, curve)
    to_coefficients = np.linalg.inv(_polynomials(curve.degree))

    def coefficients(values: Array) -> Array:
        """Coefficients (n, s V, r) of curves (n, s V, r) on the nodes of s directions."""
        n, rows, r = values.shape
        sides = values.reshape(n, -1, len(to_coefficients), r)
        return (to_coefficients @ sides).reshape(n, rows, r)

    shape = coefficients(y[..., None])[..., 0]
    numbers = np.concatenate([theta[:, :first], shape], axis=1)
    changed = coefficients(by_weights @ changes[:, first:])
    changed = np.concatenate([changes[:, :first], changed], axis=1)
    return replace(network, law=curve, theta=numbers, constraints=None), changed


def network_of(curve: Friction, network: Friction) -> Friction:
    """The network with weights near its own ones that give a curve, by damped Gauss-Newton."""
    law: Any = curve.law
    scales, wanted = len(law.scales), _values(curve)
    theta = np.concatenate([curve.theta[:, :scales], network.theta[:, scales:]], axis=1)
    y, J = _on_nodes(replace(network, theta=theta), law)
    damping = np.full(curve.n, _FIRST)
    for _ in range(_ITERATIONS):
        if (np.abs(wanted - y) < _CLOSE).all():
            break
        tried = np.array(theta)
        tried[:, scales:] += _step(J, wanted - y, damping)
        y_tried, J_tried = _on_nodes(replace(network, theta=tried), law)
        better = ((wanted - y_tried) ** 2).sum(axis=1) < ((wanted - y) ** 2).sum(axis=1)
        theta, y, J = (
            np.where(better.reshape(-1, *(1,) * (old.ndim - 1)), new, old)
            for new, old in ((tried, theta), (y_tried, y), (J_tried, J))
        )
        damping = damping * np.where(better, 0.5, 2.0)
    return replace(network, theta=theta)


def distance(curve: Friction, network: Friction) -> float:
    """How far a network's y is from that of a curve, at most: about its share of the level."""
    law: Any = curve.law
    off = _on_nodes(network, law)[0] - _values(curve)
    return float(np.abs(off).max())


def _values(curve: Friction) -> Array:
    """Values y (n, s V) of a curve at the nodes of s directions."""
    law: Any = curve.law
    sides = law.layer_weights(curve.theta).reshape(curve.n, -1, law.degree + 1)
    return (sides @ _polynomials(law.degree).T).reshape(curve.n, -1)


def _step(J: Array, off: Array, damping: Array) -> Array:
    """The least steps (n, W) that take off (n, V) most of it, J (n, V, W); damping (n,)."""
    square = J @ np.swapaxes(J, 1, 2)
    held = damping * np.einsum("jvv->j", square) / off.shape[1]
    square = square + held[:, None, None] * np.eye(off.shape[1])
    return (np.swapaxes(J, 1, 2) @ np.linalg.solve(square, off[..., None]))[..., 0]


def _nodes(degree: int) -> Array:
    """Chebyshev's nodes (V,) in [-1, 1]."""
    return np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))


def _polynomials(degree: int) -> Array:
    """Values (V, V) of the polynomials, in the columns, at the nodes."""
    return np.polynomial.chebyshev.chebvander(_nodes(degree), degree)


def _on_nodes(network: Friction, curve: CurveLaw) -> tuple[Array, Array]:
    """A network's y (n, s V) at the nodes of s directions; slopes (n, s V, W) in the weights."""
    z = (_nodes(curve.degree) + 1.0) / 2.0
    sides = [[z]] if curve.odd else [[z, side + 0.0 * z] for side in (1.0, -1.0)]
    rows = np.concatenate([np.stack(inputs, axis=-1) for inputs in sides])
    each = np.repeat(rows[:, None], network.n, axis=1)
    law: MLP = network.law  # type: ignore[assignment]
    y, by_weights, _ = slopes(law.layer_weights(network.theta), each, law.sizes)
    return y.T, np.swapaxes(by_weights, 0, 1)
