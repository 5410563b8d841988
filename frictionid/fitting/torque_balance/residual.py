"""Torque that a model leaves unexplained, and its derivatives in the free parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.one_step.linearised import torque_gradient
from frictionid.fitting.parameters.parameter_block import (
    Estimate,
    FreeBlock,
    Logged,
    Parameter,
    all_parameters,
    prior_mean,
    prior_precision,
)
from frictionid.fitting.torque_balance.torque_balance import TorqueBalance
from frictionid.friction import along


def left_to_friction(balance: TorqueBalance, estimate: Estimate) -> Array:
    """Mean torques (K, n) [N m] that rigid bodies do not need: gain u(t - delay) + bias - Y p."""
    calibration = estimate.calibration
    logged = balance.logged(float(calibration.delay)).mean[0]
    applied = (calibration.gain * logged + calibration.bias) * estimate.mechanism.motors
    base = np.asarray(calibration.base) + balance.base
    return np.asarray(applied - np.einsum("kib,kb->ki", balance.regressor, base))


def logged_gain(estimate: Estimate) -> Array:
    """Gain (n,) of the logged torques, at least a thousandth."""
    return np.maximum(np.asarray(estimate.calibration.gain, dtype=float), 1e-3)


@dataclass(frozen=True, eq=False)
class TorqueProblem:
    """What does not change while the free parameters are fitted to the torques.

    e = (gain u(t - delay) + bias - Y p - mean Tf) / gain    (K, n) [N m, as logged]

    The logged torque is what is measured: were its gain not divided by, a smaller one would make
    its noise smaller, too, and the gain of a joint with much friction would come out near zero.
    """

    balance: TorqueBalance
    blocks: tuple[FreeBlock, ...]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All free parameters, with the values that the fit begins with."""
        return all_parameters(self.blocks)

    @property
    def prior_precision(self) -> Array:
        """Precision (D,) of the parameters' priors."""
        return prior_precision(self.parameters)

    @property
    def prior_mean(self) -> Array:
        """Mean (D,) of the parameters' priors."""
        return prior_mean(self.parameters)

    def residual(self, estimate: Estimate) -> Array:
        """Unexplained torques e (K, n) [N m]."""
        balance = self.balance
        mean = balance.problem.mean(along(estimate.friction, balance.nodes))
        left = left_to_friction(balance, estimate) - mean @ estimate.mechanism.friction_map
        return np.asarray(left / logged_gain(estimate))

    def slopes(self, estimate: Estimate) -> Array:
        """Derivatives (K, n, D) of the unexplained torques in the free parameters."""
        balance, driven = self.balance, estimate.mechanism.motors
        out = np.zeros((*balance.slides.shape, len(self.parameters)))
        pieces = balance.logged(float(estimate.calibration.delay))
        u = Logged(pieces.mean[0], pieces.mean_later[0])
        for own in self.blocks:
            at = range(own.columns.start, own.columns.stop)
            if own.block.enters == "friction":
                slope = self._friction_slopes(estimate)
                for k, p in zip(at, own.parameters, strict=True):
                    acts = estimate.mechanism.friction_map[p.place[0]]
                    out[:, :, k] = -slope[:, p.place[0], p.place[1], None] * acts
            elif own.block.enters == "base":
                which = [p.place[0] for p in own.parameters]
                out[:, :, own.columns] = -balance.regressor[:, :, which]
            else:
                by_torque = own.block.torque_slope(estimate, own.parameters, u)
                out[:, :, own.columns] = np.moveaxis(by_torque * driven, 0, -1)
        out /= logged_gain(estimate)[:, None]
        for own in self.blocks:
            if own.block.name == "gain":
                joints = [p.place[0] for p in own.parameters]
                columns = np.arange(own.columns.start, own.columns.stop)
                gain = logged_gain(estimate)[joints]
                out[:, joints, columns] -= self.residual(estimate)[:, joints] / gain
        return out

    def _friction_slopes(self, estimate: Estimate) -> Array:
        """Derivatives (K, m, P) of the mean friction at each place in its own parameters."""
        friction, problem = estimate.friction, self.balance.problem
        batch = friction.law, np.asarray(friction.theta)[None]
        at_nodes = torque_gradient(type(friction)(*batch), problem)[0]
        S, n, P = at_nodes.shape
        return problem.mean(at_nodes.reshape(S, n * P)).reshape(-1, n, P)
