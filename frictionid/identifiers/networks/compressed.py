"""Static networks by Levenberg-Marquardt on compressed squares: all folds at once, in seconds.

A law that depends on its joint's velocity alone sees the rows only through its torques at some
eighty speeds (`hats`). Its many numbers are held near where they began, as strongly as suits
recordings that are held out inside each fold: the maximum of a posterior, whose equations are as
small as there are speeds [MacKay1992].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, at_rest
from frictionid.friction.laws.ensemble import together
from frictionid.friction.laws.network_law import NetworkLaw, is_learned
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.networks.compressed_problem import Compressed, compressed, node_speeds
from frictionid.identifiers.networks.early_stopping import check_share, held_out
from frictionid.identifiers.networks.ensemble_seeds import member_seeds
from frictionid.identifiers.networks.scales import speed_scale, torque_scale
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import normalised

_SHARP, _CREEP = 1e-9, 1e-6  # [rad/s]: smoothing that does not show at a speed that is none
_DAMPING = (1e-8, 1e8)
_RIDGE = 1e-9  # of the curvature of the torques


@dataclass(frozen=True)
class CompressedNetwork(Identifier):
    """Fits a network of its own joint's velocity, such as `MLP()`.

    nodes : speeds in each direction at which the data are compressed
    freedom : standard deviations of the weights about their start, from which each fold chooses by
        the recordings held out in it, a `share` of its weight
    members : networks with other starts and other recordings held out; friction is their mean
    iterations, tolerance : a fit ends after so many steps, or where they gain less, relative

    Raises
    ------
    InputError
        For another kind of law, or settings that mean nothing.
    """

    law: Any
    nodes: int = 40
    freedom: tuple[float, ...] = (0.1, 0.3, 1.0)
    share: float = 0.15
    members: int = 1
    iterations: int = 60
    tolerance: float = 1e-5

    def __post_init__(self) -> None:
        law = self.law
        known = isinstance(law, NetworkLaw) and law.has_gradient and not law.has_memory
        if not known or law.others:
            reason = "sees other joints" if known else "is no static network with a gradient"
            raise InputError(
                "Levenberg-Marquardt on compressed squares needs a network of its own joint's "
                f'velocity, {law} {reason}: choose solver = "adam"'
            )
        for name in ("nodes", "iterations"):
            if not (type(getattr(self, name)) is int and getattr(self, name) >= 2):
                raise InputError(f"{name} = {getattr(self, name)!r} must be an integer above one")
        if not self.freedom or not all(0 < size < np.inf for size in self.freedom):
            raise InputError(f"freedom = {self.freedom!r} must list positive numbers")
        if type(self.members) is not int or self.members < 1:
            raise InputError(f"members = {self.members!r} must be a positive integer")
        check_share(self.share)

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        weights = normalised(weights, problem)
        scales = np.stack([torque_scale(problem, weights), speed_scale(problem, weights)], axis=-1)
        whole = self._squares(problem, weights)
        thetas = []
        for own in member_seeds(seed, self.members):
            start = self.law.initial_parameters(scales, np.random.default_rng(own))
            freedom = np.full(len(weights), self.freedom[0])
            if len(self.freedom) > 1:
                inner = held_out(problem, weights, self.share, own)
                judge = self._squares(problem, weights * inner)
                freedom = self._best(whole.without(judge), judge, start)
            thetas.append(self._settled(whole, start, freedom))
        return together(self.law, thetas)

    def _squares(self, problem: Problem, weights: Array) -> Compressed:
        speeds = node_speeds(problem, self.nodes)
        return compressed(problem, weights, speeds, self.law.width, self.law.shape)

    def _best(self, trial: Compressed, judge: Compressed, start: Array) -> Array:
        """Freedom (F,) whose fit to one part of a fold's rows is best on the other."""
        fits = [self._settled(trial, start, np.full(len(start), f)) for f in self.freedom]
        costs = np.stack([judge.cost(_torque(self.law, theta, judge.speeds)) for theta in fits])
        return np.asarray(self.freedom)[costs.argmin(axis=0)]

    def _settled(self, squares: Compressed, start: Array, freedom: Array) -> Array:
        """Parameters (F, n, P) of the highest posterior under a freedom (F,)."""
        prior = _Prior(start, freedom, is_learned(self.law) * 1.0, _precision(squares))
        stand = _stand(self.law, squares, prior, start)
        damping, active = np.ones(len(start)), np.ones(len(start), dtype=bool)
        for _ in range(self.iterations):
            trial = _stand(self.law, squares, prior, _moved(squares, prior, stand, damping))
            better = active & (trial.cost < stand.cost)
            gain = np.where(better, 1.0 - trial.cost / stand.cost, 0.0)
            damping = np.clip(damping * np.where(better, 0.2, 5.0), *_DAMPING)
            pairs = zip(trial, stand, strict=True)
            stand = _Stand(*(_chosen(better, new, old) for new, old in pairs))
            # each fold ends by itself, so that it is the same alone
            active &= np.where(better, gain >= self.tolerance, damping < _DAMPING[1])
            if not active.any():
                break
        return stand.theta


class _Prior(NamedTuple):
    """Where parameters begin (F, n, P), how far they move, and the rows' weight in their sizes."""

    start: Array
    freedom: Array  # (F,)
    learned: Array  # (P,)
    precision: Array  # (F,) [s^2/rad^2]


class _Stand(NamedTuple):
    """Parameters (F, n, P), their torques at the nodes (F, n, V), slopes (F, n, V, P), and cost."""

    theta: Array
    torque: Array
    slopes: Array
    cost: Array


def _precision(squares: Compressed) -> Array:
    """One over the residual's variance (F,) that no curve explains, times the rows' number."""
    curvature = np.einsum("fii->f", squares.A) / squares.A.shape[-1]
    eased = squares.A + (_RIDGE * curvature)[:, None, None] * np.eye(squares.A.shape[-1])
    T = np.linalg.solve(eased, squares.b[..., None])[..., 0]
    left = squares.c + ((squares.times(T) - 2 * squares.b) * T).sum(-1)
    n = len(squares.speeds)
    return squares.rows * n / np.maximum(left, 1e-12 * squares.c)


def _inputs(speeds: Array) -> Inputs:
    """Inputs at the nodes (V, n), those at rest on their side."""
    half = speeds.shape[1] // 2
    away = np.where(np.arange(2 * half) < half, -1.0, 1.0) * np.maximum(np.abs(speeds), _CREEP)
    return at_rest(away.T)


def _torque(law: Any, theta: Array, speeds: Array) -> Array:
    """Torque (F, n, V) at the nodes."""
    sharp = law.with_width(_SHARP)
    return np.swapaxes(sharp.torque(theta[:, None], _inputs(speeds), ()), 1, 2)


def _stand(law: Any, squares: Compressed, prior: _Prior, theta: Array) -> _Stand:
    torque = _torque(law, theta, squares.speeds)
    slopes = law.with_width(_SHARP).gradient(theta[:, None], _inputs(squares.speeds))
    off = (theta - prior.start) / prior.freedom[:, None, None]
    cost = prior.precision * squares.cost(torque) + (off**2).sum((1, 2))
    return _Stand(theta, torque, np.swapaxes(slopes, 1, 2) * prior.learned, cost)


def _moved(squares: Compressed, prior: _Prior, stand: _Stand, damping: Array) -> Array:
    """Parameters after a damped Gauss-Newton step, by equations in the torques at the nodes."""
    F, n, V, _ = stand.slopes.shape
    hold = 1.0 / prior.freedom**2
    ease = 1.0 / (hold * (1.0 + damping))
    back = (prior.start - stand.theta) * (hold * ease)[:, None, None]
    inner = np.zeros((F, n, V, n, V))
    for j in range(n):
        inner[:, j, :, j] = stand.slopes[:, j] @ np.swapaxes(stand.slopes[:, j], 1, 2)
    K = inner.reshape(F, n * V, n * V) * (prior.precision * ease)[:, None, None]
    pull = squares.b - squares.times(stand.torque.reshape(F, -1))
    rise = (stand.slopes @ back[..., None])[..., 0].reshape(F, -1)
    left = np.eye(n * V) + K @ squares.A
    right = rise + (K @ pull[..., None])[..., 0]
    u = np.linalg.solve(left, right[..., None])[..., 0]
    y = (pull - squares.times(u)).reshape(F, n, 1, V) * (prior.precision * ease)[
        :, None, None, None
    ]
    return stand.theta + back + (y @ stand.slopes)[:, :, 0]


def _chosen(which: Array, yes: Array, no: Array) -> Array:
    return np.where(which.reshape(-1, *(1,) * (yes.ndim - 1)), yes, no)
