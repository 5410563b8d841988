"""Gram matrices of laws that are linear in their parameters: all that a fit needs of the rows.

With a column a = G sum_m c_m f(node_m) for each parameter, and the residual r as the last one,

    A = [a, r],   T = sum_k w_k A_k' A_k

Rows that have the same weight in every fold are added up once; each fold then adds a few matrices.
"""

import numpy as np

from frictionid.arrays import Array, stretches
from frictionid.friction import Law

from .linearised import Linearised
from .residual import Problem

FEW = 10  # recordings whose scatter says little
_STRETCHES = 20
_CELLS = 2000


def columns(law: Law, problem: Problem) -> Array:
    """Columns [a, r] of all rows, shape (K, n, N + 1), for a law that is linear in theta."""
    linearised = Linearised(law, problem)
    K, n = problem.r.shape
    A = linearised.jacobian(np.zeros((1, n * len(law.names))))[0].reshape(K, n, -1)
    linearised.check_finite(A, problem.r)
    return np.concatenate([A, problem.r[..., None]], axis=-1)


def clusters(problem: Problem) -> Array:
    """Cluster (K,) of each row: its recording, or where these are few, a stretch of it.

    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
    >>> labels = clusters(synthetic_problem(1))  # three recordings
    >>> len(np.unique(labels))
    21
    """
    count = len(np.unique(problem.recording))
    pieces = 1 if count >= FEW else -(-_STRETCHES // count)
    return stretches(problem.recording, problem.time, pieces)


def grams(A: Array, weights: Array, labels: Array) -> Array:
    """Gram matrices (F, C, M, M) of each fold in each cluster of labels (K,).

    A (K, n, M), weights (F, K)
    """
    M, count = A.shape[-1], int(labels.max()) + 1
    keys = np.ascontiguousarray(np.concatenate([labels[None], weights]).T)  # (K, F + 1)
    keys = keys.view([("", keys.dtype)] * keys.shape[1])[:, 0]  # one key for each row
    _, first, cell = np.unique(keys, return_index=True, return_inverse=True)
    if len(first) > _CELLS:
        parts = [_by(labels, count, A * np.sqrt(w)[:, None, None]) for w in weights]
        return np.stack(parts)
    of_cells = _by(cell, len(first), A)
    out = np.zeros((len(weights), count, M * M))
    for c in range(count):
        cells = labels[first] == c
        out[:, c] = weights[:, first[cells]] @ of_cells[cells].reshape(int(cells.sum()), M * M)
    return out.reshape(len(weights), count, M, M)


def _by(label: Array, count: int, A: Array) -> Array:
    """Gram matrix (count, M, M) of the rows with each label."""
    order = np.argsort(label, kind="stable")
    edges = np.searchsorted(label[order], np.arange(count + 1))
    table = A[order].reshape(len(A), -1)
    flat = [table[a:b].reshape(-1, A.shape[-1]) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return np.stack([part.T @ part for part in flat])
