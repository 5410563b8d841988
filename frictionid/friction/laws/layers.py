"""Small feed-forward networks whose weights stand in one row, alike for NumPy and torch.

A network has `sizes`, the numbers of its inputs, of the tanh units of each hidden layer, and of its
linear outputs. Its weights (..., n, P), P = `count(sizes)`, are those of layer after layer, each
first from inputs to units, then the units' offsets. Recurrent cells stand before them.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.config import Count
from frictionid.friction import Memory

Hidden = Annotated[tuple[Count, ...], Field(min_length=1)]  # units of each hidden layer
_STEEP = (1.0, 4.0)  # slopes of the first units, which turn anywhere in their inputs' range
_SMALL = 0.3
_KEEP = 1.0  # offset of the gates that keep what cells hold [Gers2000]


def count(sizes: Sequence[int]) -> int:
    """Number of weights.

    >>> count((2, 8, 1))
    33
    """
    return sum((a + 1) * b for a, b in pairwise(sizes))


def drawn(sizes: Sequence[int], rng: np.random.Generator) -> Array:
    """Weights (P,) to start from: small outputs, and first units that turn in [0, 1]."""
    parts = []
    for i, (a, b) in enumerate(pairwise(sizes)):
        weights = rng.standard_normal((a, b)) / np.sqrt(a)
        offsets = np.zeros(b)
        if i == 0:
            weights[0] = rng.uniform(*_STEEP, b) * rng.choice([-1.0, 1.0], b)
            offsets = -weights[0] * rng.uniform(0.0, 1.0, b)
        if i == len(sizes) - 2:
            weights *= _SMALL
        parts += [weights.ravel(), offsets]
    return np.concatenate(parts)


def outputs(weights: Array, z: Array, sizes: Sequence[int]) -> Array:
    """Outputs (..., n, sizes[-1]) of inputs z (..., n, sizes[0]); the batch axes broadcast."""
    row, z, many = laid(weights, z)
    return unlaid(_forward(row, z, sizes)[-1], many)


def slopes(weights: Array, z: Array, sizes: Sequence[int]) -> tuple[Array, Array, Array]:
    """Output (..., n) of a network that has one, its slopes in the weights, and in the inputs.

    Shapes (..., n, P) and (..., n, sizes[0]).
    """
    row, z, many = laid(weights, z)
    xp, values, parts = namespace(row, z), _forward(row, z, sizes), []
    deltas = _backward(row, values, sizes)
    for delta, before in zip(deltas[:-1], values[-2::-1], strict=True):
        product = before[..., :, None] * delta[..., None, :]
        flat = xp.reshape(product, (*product.shape[:-2], product.shape[-2] * product.shape[-1]))
        parts += [delta, flat]
    by_weights = xp.concat(parts[::-1], axis=-1)
    return unlaid(values[-1], many)[..., 0], unlaid(by_weights, many), unlaid(deltas[-1], many)


def input_slopes(weights: Array, z: Array, sizes: Sequence[int]) -> tuple[Array, Array]:
    """Output (..., n) of a network that has one; its slopes (..., n, sizes[0]) in the inputs."""
    row, z, many = laid(weights, z)
    values = _forward(row, z, sizes)
    return unlaid(values[-1], many)[..., 0], unlaid(_backward(row, values, sizes)[-1], many)


def _layers(row: Array, sizes: Sequence[int]) -> Iterator[tuple[Array, Array]]:
    """Matrix (..., n, a, b) and offsets (..., n, 1, b) of each layer."""
    xp, at = namespace(row), 0
    for a, b in pairwise(sizes):
        W = xp.reshape(row[..., at : at + a * b], (*row.shape[:-1], a, b))
        yield W, row[..., None, at + a * b : at + (a + 1) * b]
        at += (a + 1) * b


def _forward(row: Array, z: Array, sizes: Sequence[int]) -> list[Array]:
    """Inputs and values of each layer, (..., n, rows, units)."""
    xp, values = namespace(row, z), [z]
    for i, (W, offset) in enumerate(_layers(row, sizes)):
        z = xp.matmul(z, W) + offset
        z = xp.tanh(z) if i < len(sizes) - 2 else z
        values.append(z)
    return values


def _backward(row: Array, values: list[Array], sizes: Sequence[int]) -> list[Array]:
    """Slopes of the only output in what the units of each layer sum up, last first; in inputs."""
    xp, deltas = namespace(row), [0.0 * values[-1] + 1.0]
    for (W, _), before in zip(reversed(list(_layers(row, sizes))), values[-2::-1], strict=True):
        delta = xp.matmul(deltas[-1], xp.swapaxes(W, -1, -2))
        deltas.append(delta if before is values[0] else delta * (1.0 - before * before))
    return deltas


def laid(weights: Array, z: Array) -> tuple[Array, Array, bool]:
    """Weights, inputs as matrices (..., n, rows, a), and whether one set of weights has many rows.

    Many points under one set of weights are then a product of matrices.
    """
    xp = namespace(weights, z)
    if z.ndim > 2 and (weights.ndim == 2 or weights.shape[-3] == 1):
        row = weights if weights.ndim == 2 else weights[..., 0, :, :]
        return row, xp.swapaxes(z, -3, -2), True
    return weights, z[..., None, :], False


def unlaid(value: Array, many: bool) -> Array:
    """Values (..., n, rows, b) as (..., n, b), the other way round than `laid`."""
    return namespace(value).swapaxes(value, -3, -2) if many else value[..., 0, :]


def drawn_gates(sizes: tuple[int, int], rng: np.random.Generator) -> Array:
    """Weights to learn from of gates with these numbers of inputs and outputs."""
    cells = sizes[1] // 4
    gates = rng.uniform(-1.0, 1.0, sizes) / np.sqrt(cells)
    offsets = np.zeros(sizes[1])
    offsets[cells : 2 * cells] = _KEEP
    return np.concatenate([gates.ravel(), offsets])


def cells_after(weights: Array, z: Array, memory: Memory) -> tuple[Array, Array]:
    """Outputs h and contents c (..., n, H) of cells after a sample z (..., n, a).

    c' = keep c + take tanh(new),   h' = give tanh(c')

    of the gates take, keep, give and new, linear in z and h; `memory` holds h and then c.
    """
    xp, H = namespace(weights, z), len(memory) // 2
    h, c = (xp.stack(part, axis=-1) for part in (memory[:H], memory[H:]))
    both = beside(z, h)
    gates = outputs(weights, both, (both.shape[-1], 4 * H))
    shares = rise(gates[..., : 3 * H])
    take, keep, give = (shares[..., k * H : (k + 1) * H] for k in range(3))
    c = keep * c + take * xp.tanh(gates[..., 3 * H :])
    return give * xp.tanh(c), c


def beside(z: Array, h: Array) -> Array:
    """Features (..., n, a + b) of two arrays whose batch axes broadcast."""
    xp = namespace(z, h)
    if z.shape[:-1] != h.shape[:-1]:
        shape = np.broadcast_shapes(z.shape[:-1], h.shape[:-1])
        z, h = (xp.broadcast_to(part, (*shape, part.shape[-1])) for part in (z, h))
    return xp.concat([z, h], axis=-1)


def rise(y: Array) -> Array:
    """Slope of `softplus`: between zero and one.

    >>> rise(np.array([-1e3, 0.0, 1e3]))
    array([0. , 0.5, 1. ])
    """
    return 0.5 + 0.5 * namespace(y).tanh(0.5 * y)


def stacked(features: Sequence[Array]) -> Array:
    """Features (..., n, a) of arrays whose batch axes broadcast."""
    whole: Any = sum(0.0 * feature for feature in features)
    return namespace(whole).stack([feature + whole for feature in features], axis=-1)
