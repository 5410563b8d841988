"""Windows one by one, in compiled loops: their predictions, and their normal equations."""

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.machine_code import called, compiled


@compiled
def follow(
    windows: Array,
    measured: Array,
    weight: Array,
    nodes: Array,
    end: Array,
    by_start: Array,
    by: Array,
    angle: Array,
    error: Array,
    slope: Array,
    share: Array,
    moved: Array,
    carried: Array,
) -> None:
    """Fill in the arrays of a `WindowPrediction`, see `predict_windows`.

    measured, weight (2, K, n) : angles before and after intervals, and what they are scaled by
    end (K, s), by_start (K, s, s), by (K, s, D), angle (D, n) : see `Linearisation`
    """
    (s, width), n = carried.shape[2:], error.shape[2]
    T, T_before = np.zeros((s, width)), np.zeros((s, width))
    g, g_before = np.zeros(s), np.zeros(s)
    for m in range(len(windows)):
        g[:], T[:] = 0.0, 0.0
        for a in range(2 * n):
            T[a, a] = 1.0
        count = int((windows[m] >= 0).sum())
        error[m, count + 1 :], slope[m, count + 1 :], share[m, count + 1 :] = 0.0, 0.0, 0.0
        moved[m, count:], carried[m, count:] = 0.0, 0.0
        for k in range(count):
            i, last = windows[m, k], k + 1 == count
            g_before[:], T_before[:] = g, T
            moved[m, k], carried[m, k] = g, T
            share[m, k] = 1.0 if k else 0.5
            _compare(measured[0, i], weight[0, i], nodes[i], g, T, angle, error[m, k], slope[m, k])
            for a in range(s):
                g[a] = 0.0 if last else end[i, a] - nodes[windows[m, k + 1], a]
                T[a] = 0.0
                T[a, 2 * n :] = by[i, a]
                for b in range(s):
                    factor = by_start[i, a, b]
                    g[a] += factor * g_before[b]
                    for d in range(width):
                        T[a, d] += factor * T_before[b, d]
            if last:
                share[m, k + 1] = 0.5
                place = error[m, k + 1], slope[m, k + 1]
                _compare(measured[1, i], weight[1, i], end[i], g, T, angle, *place)


@called
def _compare(
    measured: Array,
    weight: Array,
    state: Array,
    g: Array,
    T: Array,
    angle: Array,
    error: Array,
    slope: Array,
) -> None:
    """Set the error (n,) of a prediction g beside a state (s,), and its slope (n, 2n + D)."""
    n, D = len(measured), len(angle)
    for j in range(n):
        error[j] = (measured[j] - state[j] - g[j]) * weight[j]
        for d in range(T.shape[1]):
            slope[j, d] = T[j, d]
        for d in range(D):
            slope[j, 2 * n + d] += angle[d, j]
        for d in range(T.shape[1]):
            slope[j, d] *= weight[j]


@compiled
def eliminate(
    slope: Array,
    error: Array,
    root: Array,
    prior: Array,
    damping: Array,
    H: Array,
    g: Array,
    to_start: Array,
    start: Array,
    leverage: Array,
) -> None:
    """Fill in the arrays of `NormalEquations`, see `eliminate_states`.

    slope (W, R, 2n + D), error and root (W, R) : of R angles, and the root of what each counts
    """
    (W, R, width), size = slope.shape, start.shape[1]
    D = width - size
    A, rest, kept = np.zeros((R, width + 1)), np.zeros((R, D)), np.zeros((size, D))
    at_start, inverse = np.zeros((size, size)), np.zeros((size, size))
    cross, solved = np.zeros((size, D + 1)), np.zeros((size, D + 1))
    for m in range(W):
        wanted, precision = prior[0, m], prior[1, m]
        _add_up(slope[m], error[m], root[m], wanted, precision, A, at_start, cross)
        _solve(at_start, cross, inverse, solved)
        # as a sum of squares: a difference of large ones may come out negative
        for r in range(R):
            for d in range(D):
                rest[r, d] = A[r, size + d]
            for a in range(size):
                total = 0.0
                for c in range(size):
                    total += inverse[a, c] * A[r, c]
                leverage[m, r] += total * A[r, a]
                for d in range(D):
                    rest[r, d] -= A[r, a] * solved[a, d]
            for d in range(D):
                g[m, d] += A[r, width] * rest[r, d]
        for a in range(size):
            for d in range(D):
                kept[a, d] = np.sqrt(precision[a]) * solved[a, d]
                g[m, d] -= precision[a] * wanted[a] * solved[a, d]
        if D:
            H[m] = rest.T @ rest + kept.T @ kept
        if damping[m].any():
            for a in range(size):
                at_start[a, a] += damping[m, a]
            _solve(at_start, cross, inverse, solved)
        to_start[m], start[m] = solved[:, :D], solved[:, D]


@called
def _add_up(
    slope: Array,
    error: Array,
    root: Array,
    wanted: Array,
    precision: Array,
    A: Array,
    at_start: Array,
    cross: Array,
) -> None:
    """Set weighted slopes and errors A (R, 2n + D + 1), and what they say of the initial state.

    at_start (2n, 2n) : of it by itself; cross (2n, D + 1) : beside parameters and errors
    """
    (R, width), size = slope.shape, len(at_start)
    at_start[:], cross[:] = 0.0, 0.0
    for a in range(size):
        at_start[a, a], cross[a, width - size] = precision[a], precision[a] * wanted[a]
    for r in range(R):
        for d in range(width):
            A[r, d] = slope[r, d] * root[r]
        A[r, width] = error[r] * root[r]
        for a in range(size):
            factor = A[r, a]
            for c in range(size):
                at_start[a, c] += factor * A[r, c]
            for d in range(width + 1 - size):
                cross[a, d] += factor * A[r, size + d]


@called
def _solve(matrix: Array, right: Array, inverse: Array, out: Array) -> None:
    """Set the inverse (s, s) of a positive definite matrix, and its product with the right side."""
    size, left = len(matrix), matrix.copy()
    inverse[:], out[:] = np.eye(size), 0.0
    for p in range(size):  # by Gauss and Jordan
        scale = 1.0 / left[p, p]
        left[p] *= scale
        inverse[p] *= scale
        for a in range(size):
            factor = left[a, p]
            if a != p:
                left[a] -= factor * left[p]
                inverse[a] -= factor * inverse[p]
    for a in range(size):
        for b in range(size):
            for d in range(right.shape[1]):
                out[a, d] += inverse[a, b] * right[b, d]
