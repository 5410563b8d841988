"""Static networks by Levenberg-Marquardt on compressed squares, in seconds.

A law that depends on its joint's velocity alone sees the rows only through its torques at some
eighty speeds, in a hat basis (see `compressed_problem`). Its weights have a normal prior about
their initial values, whose deviation is chosen by recordings held out inside each fold. The maximum
of the posterior solves equations that are as small as there are speeds [MacKay1992].
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field
from scipy.linalg import block_diag
from scipy.sparse import csr_array, diags_array, hstack

from frictionid.arrays import Array
from frictionid.config import Count, NotNegative, Positive, validated
from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, Law, at_rest
from frictionid.friction.law import smooth_sign
from frictionid.friction.laws.mlp import together
from frictionid.friction.laws.network_law import NetworkLaw, is_learned

from ..identifier import Identifier
from ..one_step.residual import Problem, normalised
from .network_training import Share, friction_scales, held_out, member_seeds

_FINE = 30.0  # how much closer nodes stand at rest than at the highest speed


class Compressed(NamedTuple):
    """Squares of the rows: A (N, N), b (N,) and c, with N = n V.

    speeds (n, V) [rad/s]: the velocities of each joint at which its torques stand, negative ones
    first; both directions have a node at rest. rows: how many rows have a weight.
    """

    A: Array
    b: Array
    c: float
    speeds: Array
    rows: float

    def cost(self, torque: Array) -> float:
        """Weighted squares [rad^2/s^2] of torques (n, V)."""
        return float(self.c - 2 * self.b @ torque.ravel() + self.square(torque))

    def square(self, torque: Array) -> float:
        """Weighted squares [rad^2/s^2] of what torques (n, V) do to the rows."""
        T = torque.ravel()
        return float(T @ self.A @ T)

    def without(self, part: "Compressed") -> "Compressed":
        """Squares of the rows that are in none of a part of them."""
        A, b, c = self.A - part.A, self.b - part.b, self.c - part.c
        return Compressed(A, b, c, self.speeds, self.rows - part.rows)


def node_speeds(problem: Problem, weights: Array, count: int) -> Array:
    """Velocities (n, 2 count) from the fastest negative to the fastest positive of each joint.

    Of the rows with a weight (K,).
    """
    highest = np.abs(problem.nodes.inputs.w[problem.stencil[weights > 0]]).max(axis=(0, 1))
    share = np.expm1(np.linspace(0.0, 1.0, count) * np.log1p(_FINE)) / _FINE
    speeds = np.maximum(highest, 1e-3)[:, None] * share
    return np.concatenate([-speeds[:, ::-1], speeds], axis=1)


def compressed(
    problem: Problem, weights: Array, speeds: Array, width: float, shape: str
) -> Compressed:
    """Squares of the rows under weights (K,), for torques at node velocities (n, V).

    width, shape : smoothing of sgn(w), which stays exact between the nodes
    """
    n, V = speeds.shape
    means = [_means(problem, j, speeds[j], width, shape) for j in range(n)]
    A, b = np.zeros((n * V, n * V)), np.zeros(n * V)
    for i in range(n):
        columns = hstack([diags_array(problem.G[:, i, j]) @ means[j] for j in range(n)], "csr")
        weighted = (diags_array(weights) @ columns).T
        A += (weighted @ columns).toarray()
        b += weighted @ problem.r[:, i]
    c = float(np.einsum("k,ki->", weights, problem.r**2))
    return Compressed(A, b, c, speeds, float((weights > 0).sum()))


def _means(problem: Problem, joint: int, speeds: Array, width: float, shape: str) -> Any:
    """Share (K, V) of the torque at each node speed in the mean friction of each row."""
    basis = _hat_basis(problem.nodes.inputs.w[:, joint], speeds, width, shape)
    parts = zip(problem.coefficients, problem.stencil.T, strict=True)
    return sum(c * basis[index] for c, index in parts)


def _hat_basis(w: Array, speeds: Array, width: float, shape: str) -> Any:
    """Hat functions (S, V) of the node speeds at velocities w (S,), times |sgn(w)| smoothed."""
    half = len(speeds) // 2
    positive = speeds[half:]
    below = np.clip(np.searchsorted(positive, np.abs(w), side="right") - 1, 0, half - 2)
    share = (np.abs(w) - positive[below]) / (positive[below + 1] - positive[below])
    sign = np.abs(smooth_sign(w, width, shape))
    low = np.where(w > 0, half + below, half - 1 - below)
    high = np.where(w > 0, low + 1, low - 1)
    rows = np.tile(np.arange(len(w)), 2)
    values = np.concatenate([(1.0 - share) * sign, share * sign])
    return csr_array((values, (rows, np.concatenate([low, high]))), (len(w), len(speeds)))


_SHARP, _CREEP = 1e-9, 1e-6  # [rad/s]: smoothing that does not show at a speed next to zero
_DAMPING = (1e-8, 1e8)
_RIDGE = 1e-9  # of the mean curvature in the torques

Several = Annotated[int, Field(ge=2)]


@validated
class CompressedNetwork(Identifier):
    """Fits a network of its own joint's velocity, such as `MLP()`.

    nodes : speeds in each direction at which the data are compressed
    prior_deviations : standard deviations of the weights about their initial values, from which
        each fold chooses by the recordings held out in it, a `share` of its weight
    members : networks with other initial weights and other recordings held out; friction is their
        mean
    iterations : steps at most
    tolerance : a fit ends where a step reduces the cost by less, relative
    """

    law: Law
    nodes: Several = 40
    prior_deviations: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.1, 0.3, 1.0)
    share: Share = 0.15
    members: Count = 1
    iterations: Several = 60
    tolerance: NotNegative = 1e-5

    def __post_init__(self) -> None:
        law, reason = self.law, ""
        if not isinstance(law, NetworkLaw) or not law.has_gradient or law.has_memory:
            reason = "is no static network with a gradient"
        elif law.others:
            reason = "sees other joints"
        if reason:
            raise InputError(
                "Levenberg-Marquardt on compressed squares needs a network of its own joint's "
                f'velocity, {law} {reason}: choose solver = "adam"'
            )

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        weights = normalised(weights, problem)
        folds = zip(weights, friction_scales(problem, weights), strict=True)
        each = [self._fitted(problem, weight, scale[None], seed) for weight, scale in folds]
        return together(self.law, [np.stack(member) for member in zip(*each, strict=True)])

    def _fitted(self, problem: Problem, weights: Array, scales: Array, seed: int) -> list[Array]:
        """Parameters (n, P) of each member of one fold with weights (K,), on speeds of its own."""
        law: Any = self.law
        form, speeds = problem.fitted_form(law), node_speeds(problem, weights, self.nodes)
        whole = compressed(problem, weights, speeds, form.width, form.shape)
        thetas = []
        for start in member_seeds(seed, self.members):
            initial = law.initial_parameters(scales, np.random.default_rng(start))[0]
            deviation = self.prior_deviations[0]
            if len(self.prior_deviations) > 1:
                held = weights * held_out(problem, weights[None], self.share, start)[0]
                left_out = compressed(problem, held, speeds, form.width, form.shape)
                deviation = self._best_deviation(whole.without(left_out), left_out, initial)
            thetas.append(self._posterior_mode(whole, initial, deviation))
        return thetas

    def _best_deviation(self, training: Compressed, held: Compressed, initial: Array) -> float:
        """Least prior deviation whose fit to one part of the rows is as good as any on the other.

        Up to the standard error of the difference of costs, 2 s |G dT| with torques dT apart and
        residuals of size s: a hair more freedom makes cusps where there are hardly any rows.
        """
        fits = [self._posterior_mode(training, initial, d) for d in self.prior_deviations]
        torques = [_torque(self.law, theta, held.speeds) for theta in fits]
        costs = [held.cost(torque) for torque in torques]
        best = int(np.argmin(costs))
        variance = costs[best] / (held.rows * len(held.speeds))
        off = [held.square(torque - torques[best]) for torque in torques]
        worse = (np.array(costs) - costs[best]) ** 2 > 4.0 * variance * np.array(off)
        return float(np.min(np.array(self.prior_deviations)[~worse]))

    def _posterior_mode(self, squares: Compressed, initial: Array, deviation: float) -> Array:
        """Parameters (n, P) of the highest posterior under a prior about the initial ones."""
        posterior = _Posterior(self.law, squares, initial, deviation, _precision(squares))
        point, damping = posterior.at(initial), 1.0
        for _ in range(self.iterations):
            tried = posterior.at(posterior.stepped(point, damping))
            better, gain = tried.cost < point.cost, 1.0 - tried.cost / point.cost
            damping = min(max(damping * (0.2 if better else 5.0), _DAMPING[0]), _DAMPING[1])
            point = tried if better else point
            if gain < self.tolerance if better else damping >= _DAMPING[1]:
                break
        return point.theta


class _Point(NamedTuple):
    """Parameters (n, P), torques (n, V) at the node speeds, their Jacobian (n, V, P), and cost.

    The Jacobian is zero for parameters that are not learned.
    """

    theta: Array
    torque: Array
    jacobian: Array
    cost: float


class _Posterior(NamedTuple):
    """Squares of the rows, and a normal prior of the parameters.

    mean (n, P), and deviation of the prior; precision [s^2/rad^2]: number of rows over the variance
    of the residual
    """

    law: Law
    squares: Compressed
    mean: Array
    deviation: float
    precision: float

    def at(self, theta: Array) -> _Point:
        """The point at parameters (n, P)."""
        torque = _torque(self.law, theta, self.squares.speeds)
        gradient = self.law.with_width(_SHARP).gradient(theta, _inputs(self.squares.speeds))
        jacobian = np.swapaxes(gradient, 0, 1) * is_learned(self.law)
        distance = (theta - self.mean) / self.deviation
        cost = self.precision * self.squares.cost(torque) + float((distance**2).sum())
        return _Point(theta, torque, jacobian, cost)

    def stepped(self, point: _Point, damping: float) -> Array:
        """Parameters (n, P) after a damped Gauss-Newton step d.

        With the torques T at the node speeds and their Jacobian J, the prior's h = 1 / deviation^2,
        the precision p and the damping l, the normal equations

            (h (1 + l) I + p J'A J) d = h (mean - theta) + p J'(b - A T)

        are solved for the change u = J d of the torques (Woodbury identity): with
        s = 1 / (h (1 + l)), d0 = s h (mean - theta) and K = s p J J',

            (I + K A) u = J d0 + K (b - A T),   d = d0 + s p J'(b - A T - A u)
        """
        (n, V, _), A = point.jacobian.shape, self.squares.A
        h = 1.0 / self.deviation**2
        s = 1.0 / (h * (1.0 + damping))
        d0 = (self.mean - point.theta) * (h * s)
        K = block_diag(*(J @ J.T for J in point.jacobian)) * (self.precision * s)
        pull = self.squares.b - A @ point.torque.ravel()
        right = (point.jacobian @ d0[..., None]).ravel() + K @ pull
        u = np.linalg.solve(np.eye(n * V) + K @ A, right)
        weighted = (pull - A @ u) * (self.precision * s)
        return point.theta + d0 + (weighted.reshape(n, 1, V) @ point.jacobian)[:, 0]


def _precision(squares: Compressed) -> float:
    """Number of rows over the variance of the residual that no curve explains."""
    A, b = squares.A, squares.b
    T = np.linalg.solve(A + _RIDGE * np.trace(A) / len(A) * np.eye(len(A)), b)
    left = squares.c + ((A @ T - 2 * b) * T).sum()
    return float(squares.rows * len(squares.speeds) / np.maximum(left, 1e-12 * squares.c))


def _inputs(speeds: Array) -> Inputs:
    """Inputs at the nodes (V, n); the two at rest are each moved a little to their side."""
    half = speeds.shape[1] // 2
    side = np.where(np.arange(2 * half) < half, -1.0, 1.0)
    return at_rest((side * np.maximum(np.abs(speeds), _CREEP)).T)


def _torque(law: Law, theta: Array, speeds: Array) -> Array:
    """Torque (n, V) at the nodes."""
    return np.asarray(law.with_width(_SHARP).torque(theta, _inputs(speeds), ()).T)
