"""Damped Gauss-Newton steps within bounds, and the minimum of several fits at once by them.

Minimised over the parameters x (N,) of each of F fits, within bounds, is

    cost(x) + (x - mean)' P (x - mean),    cost(x) = sum of weighted squares of a residual e(x)

by Levenberg-Marquardt [Marquardt1963]. A secant correction adds to the Gauss-Newton Hessian what
earlier steps show it to lack [Dennis1981]: in the narrow valleys of friction laws (a higher peak
that falls off sooner) that saves most of the steps.

One-step fits and the balance of torques are such problems. Shooting takes the same steps in a loop
of its own, `shooting.gauss_newton`: evaluating its cost is as dear as its linearisation, which also
weighs the rows anew, and single windows may go back. A network's weights are more than the speeds
that show them, so `identifiers.compressed` solves for the torques instead.
"""

from typing import NamedTuple, Protocol

import numpy as np

from frictionid.arrays import Array, picked

_FIRST, _DAMPING = 1e-6, (1e-9, 1e9)  # of unit diagonals: at first, least and most
_REFUSED = 1e-3  # least damping after a step that was refused: less would hardly change it
_NOTHING = 1e-200  # information below this leaves no trace: products of it underflow
_CLEAR = 1e-8  # a change of slope above rounding
_CONVEX = 1e-9  # of unit diagonals: a curvature that is negative by rounding


class Conditions(NamedTuple):
    """What F fits of N parameters are made under.

    weights : (F, ...) of the rows; low, high, mean, precision : (F, N) of bounds, and of priors in
    units of the cost; floor : (F,), costs below are rounding
    """

    weights: Array
    low: Array
    high: Array
    mean: Array
    precision: Array
    floor: Array

    def prior_cost(self, x: Array) -> Array:
        """Squares (F,) of the priors."""
        return (self.precision * (x - self.mean) ** 2).sum(axis=-1)


class Problem(Protocol):
    """Residuals of the same rows for F fits at once, whatever they are of."""

    def residual(self, x: Array) -> Array:
        """Residuals (F, ...) at parameters (F, N)."""
        ...

    def cost(self, residual: Array, weights: Array) -> Array:
        """Weighted squares (F,) of residuals."""
        ...

    def normal_equations(self, x: Array, residual: Array, weights: Array) -> tuple[Array, Array]:
        """J'We (F, N) and J'WJ (F, N, N), with J = -de/dx."""
        ...

    def possible(self, x: Array) -> Array:
        """The parameters (F, N), or those that there can be on the way to them."""
        ...


class Minimum(NamedTuple):
    """Where fits ended: parameters (F, N), residuals (F, ...), steps at most, converged (F,)."""

    x: Array
    residual: Array
    iterations: int
    converged: Array


class _State(NamedTuple):
    """State of the iteration in A of the fits, at x (A, N).

    which (A,); residual (A, ...); cost and damping (A,); descent J'We (A, N); hessian J'WJ
    (A, N, N) by Gauss-Newton, and secant (A, N, N), its correction; the prior is in all of them
    """

    which: Array
    x: Array
    residual: Array
    cost: Array
    descent: Array
    hessian: Array
    secant: Array
    damping: Array


def minimum(
    problem: Problem,
    x: Array,
    under: Conditions,
    iterations: int,
    tolerance: float = 0.0,
    still: float = 0.0,
) -> Minimum:
    """The local minima next to x (F, N); fits that have converged take no more steps.

    iterations : steps at most
    tolerance : a fit ends where a step would reduce the cost by less, relative
    still : or where it moves all parameters by less [1 / root of the diagonal of J'WJ]
    """
    which, count = np.arange(len(x)), 0
    residual = problem.residual(x)
    cost = problem.cost(residual, under.weights) + under.prior_cost(x)
    descent, hessian = _equations(problem, x, residual, under)
    secant, damping = np.zeros_like(hessian), np.full(len(x), _FIRST)
    state = _State(which, x, residual, cost, descent, hessian, secant, damping)
    x, residual, converged = x.copy(), residual.copy(), np.zeros(len(x), dtype=bool)
    while len(which) and count < iterations:
        state, small, stalled = _next(problem, state, picked(under, which), tolerance, still)
        x[which], residual[which], converged[which] = state.x, state.residual, small
        state, count = picked(state, ~(small | stalled)), count + 1
        which = state.which
    return Minimum(x, residual, count, converged)


def _next(
    problem: Problem, state: _State, under: Conditions, tolerance: float, still: float
) -> tuple[_State, Array, Array]:
    """State after one step where that lowers the cost; which steps were small, and fits stalled."""
    step, predicted = _step(state, under)
    x = problem.possible(np.clip(state.x + step, under.low, under.high))
    with np.errstate(all="ignore"):  # a step too far is refused below, whatever it gives
        residual = problem.residual(x)
        cost = problem.cost(residual, under.weights) + under.prior_cost(x)
        reduction = state.cost - cost
    small = predicted <= tolerance * state.cost + under.floor
    small |= np.abs(step * np.sqrt(_size(state.hessian))).max(axis=1, initial=0.0) < still
    better = reduction > 0
    ratio = reduction / np.maximum(predicted, 1e-300)
    factor = np.select([ratio > 0.75, ratio > 0.25], [0.1, 1.0], 20.0)
    new = state._replace(
        x=_where(better, x, state.x),
        residual=_where(better, residual, state.residual),
        cost=np.where(better, cost, state.cost),
        secant=_where(better, state.secant, 0.0),
        damping=np.clip(
            state.damping * factor, np.where(better, _DAMPING[0], _REFUSED), _DAMPING[1]
        ),
    )
    moved = np.flatnonzero(better & ~small)
    stalled = ~better & (state.damping >= _DAMPING[1])
    return _with_equations(problem, state, new, moved, picked(under, moved)), small, stalled


def _where(rows: Array, values: Array, others: Array | float) -> Array:
    """Values (A, ...) in some rows (A,), others elsewhere."""
    return np.where(rows.reshape(-1, *(1,) * (values.ndim - 1)), values, others)


def _equations(
    problem: Problem, x: Array, residual: Array, under: Conditions
) -> tuple[Array, Array]:
    """Descent (A, N) and Gauss-Newton Hessian (A, N, N) of the residuals and the prior."""
    descent, hessian = problem.normal_equations(x, residual, under.weights)
    pull = under.precision * (under.mean - x)
    return descent + pull, hessian + under.precision[..., None] * np.eye(x.shape[-1])


def _step(state: _State, under: Conditions) -> tuple[Array, Array]:
    """Damped steps d (A, N) within the bounds, and the reductions of the cost (A,) they predict.

    With B = J'WJ + secant where that is convex, else J'WJ; the reduction is d'(2 J'We - B d).
    """
    B, size = state.hessian, _size(state.hessian)
    if state.secant.any():
        full, root = B + state.secant, np.sqrt(size)
        curvature = np.linalg.eigvalsh(full / root[:, :, None] / root[:, None, :])
        B = _where(curvature.min(axis=-1, initial=1.0) >= -_CONVEX, full, B)
    damped = B + (state.damping[:, None] * size)[:, :, None] * np.eye(B.shape[-1])
    step = bounded(damped, state.descent, under.low - state.x, under.high - state.x)
    predicted = step * (2 * state.descent - np.einsum("fij,fj->fi", B, step))
    return step, predicted.sum(axis=-1)


def _with_equations(
    problem: Problem, before: _State, after: _State, moved: Array, under: Conditions
) -> _State:
    """`after` with the normal equations of the fits that moved, and their secant correction.

    The symmetric rank-one update makes the Hessian explain the change of the gradient over the
    step d: with y the part of the change that J'WJ + secant does not explain,

        secant + y y' / (y'd),   where y'd is clearly not zero
    """
    if not len(moved):
        return after
    part, start = picked(after, moved), picked(before, moved)
    descent, hessian = _equations(problem, part.x, part.residual, under)
    d = part.x - start.x
    y = start.descent - descent - np.einsum("fij,fj->fi", hessian + part.secant, d)
    product, root = (y * d).sum(axis=-1), np.sqrt(_size(hessian))
    size = np.linalg.norm(y / root, axis=-1) * np.linalg.norm(d * root, axis=-1)
    clear = np.abs(product) > _CLEAR * size
    factor = np.where(clear, 1.0 / np.where(clear, product, 1.0), 0.0)
    secant = part.secant + factor[:, None, None] * y[:, :, None] * y[:, None, :]
    out = picked(after, np.arange(len(after.which)))  # a copy
    out.descent[moved], out.hessian[moved], out.secant[moved] = descent, hessian, secant
    return out


def box_step(H: Array, g: Array, low: Array, high: Array, damping: float) -> Array:
    """Step d (B, N) with (H + damping diag H) d = g as nearly as low <= d <= high let it.

    Solved for in units in which the diagonals of H (B, N, N) are one.
    """
    scale = np.sqrt(_size(H))
    A = H / (scale[:, :, None] * scale[:, None, :]) + damping * np.eye(H.shape[-1])
    return bounded(A, g / scale, low * scale, high * scale) / scale


def _size(H: Array) -> Array:
    """Diagonals (..., N) of H (..., N, N); one where there is nothing, or what underflows."""
    diagonal = np.einsum("...ii->...i", H)
    return np.where(diagonal > _NOTHING, diagonal, 1.0)


def scaled_inverse(H: Array, smallest: float) -> Array:
    """H^-1 of normal matrices (..., N, N) by units in which diagonals are one; zero where singular.

    smallest : of the largest singular value in these units, one that counts

    >>> scaled_inverse(np.array([[4e8, 0.0], [0.0, 1e-310]]), 1e-9)
    array([[2.5e-09, 0.0e+00],
           [0.0e+00, 0.0e+00]])
    """
    scale = np.sqrt(_size(H))
    scale = scale[..., None] * scale[..., None, :]
    return np.linalg.pinv(H / scale, rcond=smallest, hermitian=True) / scale


_BLOCKS = 5  # turns in which all parameters may change sides together
_TURNS = 200


def bounded(H: Array, g: Array, low: Array, high: Array) -> Array:
    """Minimum d (B, N) of d'H d/2 - g'd within low <= d <= high, all (B, N).

    By block pivoting: parameters that leave their bounds are put there, and those that a bound need
    not hold are freed, all at once for a few turns, then one at a time, which ends [Portugal1994].
    H (B, N, N) is positive semidefinite; a parameter without influence stays nearest to zero.

    >>> H = np.array([[[2.0, 1.0], [1.0, 2.0]]])
    >>> bounded(H, np.array([[3.0, 0.0]]), np.array([[-1.0, 0.0]]), np.array([[5.0, 5.0]]))
    array([[1.5, 0. ]])
    """
    base = np.clip(np.zeros_like(g), low, high)
    g, low, high = g - np.einsum("bij,bj->bi", H, base), low - base, high - base
    eye, fixed = np.eye(g.shape[-1]), low >= high
    side = np.where((low >= 0) & (g < 0), -1, np.where((high <= 0) & (g > 0), 1, 0))
    side = np.where(fixed, 1, side)
    for turn in range(_TURNS):
        free = (side == 0) * 1.0
        held = np.select([side < 0, side > 0], [low, high], 0.0)
        A = H * free[:, :, None] * free[:, None, :]
        A = A + (np.einsum("bii->bi", A) <= 0)[:, :, None] * eye
        pull = (g - np.einsum("bij,bj->bi", H, held)) * free
        d = np.linalg.solve(A, pull[..., None])[..., 0] + held
        change = _change(side, d, g - np.einsum("bij,bj->bi", H, d), low, high)
        wrong = (change != side) & ~fixed
        if not wrong.any():
            break
        if turn >= _BLOCKS:
            wrong &= np.cumsum(wrong[:, ::-1], axis=1)[:, ::-1] == 1  # the last one only
        side = np.where(wrong, change, side)
    return base + np.clip(d, low, high)


def _change(side: Array, d: Array, slope: Array, low: Array, high: Array) -> Array:
    """Side that each parameter should be on: -1 at its lower bound, 1 at its upper, 0 between."""
    crossed = np.where(d < low, -1, np.where(d > high, 1, 0))
    return np.where(side == 0, crossed, np.where(side * slope < 0, 0, side))
