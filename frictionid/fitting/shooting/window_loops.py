"""Windows one by one, in compiled loops: their predictions, and their normal equations.

Arrays of all windows would be written and read several times; those of one stay in the cache.
"""

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
    """Fill in the zeros of a `WindowPrediction`, see `predict_windows`.

    From node x_k of a window to the next, with the end F_k of the interval, its derivatives P_k by
    x_k and B_k by the parameters,

        g_{k+1} = F_k - x_{k+1} + P_k g_k,    T_{k+1} = P_k T_k + [0, B_k]

    measured, weight (2, K, n) : angles before and after intervals, and what they are scaled by
    end (K, s), by_start (K, s, s), by (K, s, D), angle (D, n) : see `Linearisation`
    """
    (W, N), (s, width), n = windows.shape, carried.shape[2:], error.shape[2]
    g_end, T_end = np.zeros(s), np.zeros((s, width))
    for m in range(W):
        for a in range(2 * n):
            carried[m, 0, a, a] = 1.0
        for k in range(N):
            i = windows[m, k]
            if i < 0:
                break
            g, T = moved[m, k], carried[m, k]
            share[m, k] = 1.0 if k else 0.5
            _compare(measured[0, i], weight[0, i], nodes[i], g, T, angle, error[m, k], slope[m, k])
            if k + 1 < N and windows[m, k + 1] >= 0:
                _pass_on(by_start[i], by[i], g, T, moved[m, k + 1], carried[m, k + 1])
                for a in range(s):
                    moved[m, k + 1, a] += end[i, a] - nodes[windows[m, k + 1], a]
                continue
            _pass_on(by_start[i], by[i], g, T, g_end, T_end)
            after = error[m, k + 1], slope[m, k + 1]
            _compare(measured[1, i], weight[1, i], end[i], g_end, T_end, angle, *after)
            share[m, k + 1] = 0.5


@called
def _pass_on(
    by_start: Array, by: Array, g: Array, T: Array, g_ahead: Array, T_ahead: Array
) -> None:
    """Set what g (s,) and T (s, 2n + D) at the start of an interval are at its end."""
    (s, width), D = T.shape, by.shape[1]
    for a in range(s):
        g_ahead[a] = 0.0
        for d in range(width):
            T_ahead[a, d] = 0.0
        for d in range(D):
            T_ahead[a, width - D + d] = by[a, d]
        for b in range(s):
            factor = by_start[a, b]
            g_ahead[a] += factor * g[b]
            for d in range(width):
                T_ahead[a, d] += factor * T[b, d]


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
            slope[j, d] = T[j, d] * weight[j]
        for d in range(D):
            slope[j, 2 * n + d] += angle[d, j] * weight[j]


@compiled
def eliminate(
    slope: Array,
    error: Array,
    root: Array,
    prior: Array,
    damping: Array,
    counts: Array,
    H: Array,
    g: Array,
    to_start: Array,
    start: Array,
    leverage: Array,
) -> None:
    """Fill in the zeros of `NormalEquations`, see `eliminate_states`.

    Of the weighted rows [A, C] of initial state and parameters, and their errors b,

        rest = C - A S,    S = (A'A)^-1 A'C,    H = rest' rest,    g = rest' b

    where what is known of the initial state before, its prior, is so many rows more.

    slope (W, R, 2n + D), error and root (W, R) : of R angles, and the root of what each counts
    """
    (W, R, width), size = slope.shape, start.shape[1]
    D, rows = width - size, R + size
    A, rest = np.zeros((rows, width + 1)), np.zeros((rows, D))
    at_start, inverse = np.zeros((size, size)), np.zeros((size, size))
    cross, solved = np.zeros((size, D + 1)), np.zeros((size, D + 1))
    for m in range(W):
        for r in range(R):
            for d in range(width):
                A[r, d] = slope[m, r, d] * root[m, r]
            A[r, width] = error[m, r] * root[m, r]
        for a in range(size):
            A[R + a, a] = np.sqrt(prior[1, m, a])
            A[R + a, width] = A[R + a, a] * prior[0, m, a]
        _add_up(A, at_start, cross)
        _solve(at_start, cross, inverse, solved)
        # as a sum of squares: a difference of large ones may come out negative
        for r in range(rows):
            for d in range(D):
                rest[r, d] = A[r, size + d]
            for a in range(size):
                for d in range(D):
                    rest[r, d] -= A[r, a] * solved[a, d]
            for d in range(D):
                g[m, d] += counts[m] * A[r, width] * rest[r, d]
        if D and counts[m] > 0.0:  # what is left out may be infinite
            H[m] = counts[m] * (rest.T @ rest)
        else:
            g[m] = 0.0
        for r in range(R):
            for a in range(size):
                for c in range(size):
                    leverage[m, r] += A[r, a] * inverse[a, c] * A[r, c]
        for a in range(size):
            at_start[a, a] += damping[m, a]
        _solve(at_start, cross, inverse, solved)
        for a in range(size):
            for d in range(D):
                to_start[m, a, d] = solved[a, d]
            start[m, a] = solved[a, D]


@called
def _add_up(A: Array, at_start: Array, cross: Array) -> None:
    """Set what rows A (R, 2n + D + 1) of slopes and errors say of the initial state.

    at_start (2n, 2n) : of it by itself; cross (2n, D + 1) : beside parameters and errors
    """
    size = len(at_start)
    for a in range(size):
        for c in range(size):
            at_start[a, c] = 0.0
        for d in range(cross.shape[1]):
            cross[a, d] = 0.0
    for r in range(len(A)):
        for a in range(size):
            factor = A[r, a]
            for c in range(size):
                at_start[a, c] += factor * A[r, c]
            for d in range(cross.shape[1]):
                cross[a, d] += factor * A[r, size + d]


@called
def _solve(matrix: Array, right: Array, inverse: Array, out: Array) -> None:
    """Set the inverse (s, s) of a positive definite matrix, and its product with the right side."""
    size, left = len(matrix), matrix.copy()
    for a in range(size):
        for b in range(size):
            inverse[a, b] = 1.0 if a == b else 0.0
    for p in range(size):  # by Gauss and Jordan
        scale = 1.0 / left[p, p]
        for b in range(size):
            left[p, b] *= scale
            inverse[p, b] *= scale
        for a in range(size):
            factor = left[a, p] if a != p else 0.0
            for b in range(size):
                left[a, b] -= factor * left[p, b]
                inverse[a, b] -= factor * inverse[p, b]
    for a in range(size):
        for d in range(right.shape[1]):
            out[a, d] = 0.0
        for b in range(size):
            for d in range(right.shape[1]):
                out[a, d] += inverse[a, b] * right[b, d]
