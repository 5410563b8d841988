"""Inverse dynamics as a method of fitting: what is freed, in every fold."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array

from ..fit import Fit
from ..identifier import Identifier
from ..one_step.recipe import INTEGRAL, Recipe
from ..parameter_block import ParameterBlock
from ..parameters import BiasBlock, DelayBlock, FrictionBlock, InertiaBlock
from ..shooting.recipe import ShootingData, with_folds
from ..shooting.settings import applicable
from .fit import fit_torques
from .solve import TorqueSettings
from .torque_balance import TorqueBalance, torque_balance

DEFAULT_BLOCKS: tuple[ParameterBlock, ...] = (
    FrictionBlock(),
    InertiaBlock(offered=True),
    DelayBlock(offered=True),
    BiasBlock(),
)


@dataclass(frozen=True)
class InverseDynamics:
    """Friction fitted to the torques that the motion needs, with inertia and sensors free.

    The rows are means over short windows, one for each joint, of the momentum balance along the
    smoothed motion: as in the identification of robots by inverse dynamics and least squares
    [Gautier1991], without accelerations. Cheaper than shooting for arms with many joints; what the
    smoother takes off the motion is missing in it, as in every one-step fit.

    blocks : what is free: friction, base parameters, delay and bias of the torque, or its gain
    settings : window, weights, iterations; start : the one-step recipe whose rows score it
    """

    name: str = "inverse_dynamics"
    blocks: tuple[ParameterBlock, ...] = DEFAULT_BLOCKS
    settings: TorqueSettings = TorqueSettings()
    start: Recipe = INTEGRAL
    needs_intervals: ClassVar[bool] = True
    scheme: ClassVar[str] = "inverse dynamics"
    calibrated: ClassVar[None] = None
    corrects: ClassVar[tuple[str, ...]] = ()

    @property
    def steps(self) -> tuple[Recipe, ...]:
        """The one-step recipes whose problems a fit needs: the one whose rows judge it."""
        return (self.start,)

    def fit(self, identifier: Identifier, data: ShootingData, seed: int) -> Fit:
        """The identifier's friction of all folds and of all data, unless it is fixed.

        Raises
        ------
        InputError
            Where the fit fails, and for networks.
        """
        if identifier.fixed:
            return self.start.fit(identifier, data, seed)
        intervals = data.intervals
        balance = torque_balance(
            intervals.dataset, intervals.states, self.settings.window, self.settings.node_time
        )
        blocks = applicable(self.blocks, intervals.dataset)
        return with_folds(
            [
                fit_torques(identifier, balance, blocks, self.settings, use, seed)
                for use in window_weights(balance, data) > 0
            ]
        )


def window_weights(balance: TorqueBalance, data: ShootingData) -> Array:
    """Weights (F + 1, K) of the windows: those that train a fold in all their samples."""
    intervals, weights = data.intervals, data.interval_weights
    out = np.ones((len(weights), len(balance.start)))
    for i in np.unique(balance.recording):
        windows, rows = balance.recording == i, np.flatnonzero(intervals.recording == i)
        middle = intervals.time[rows] + intervals.dt[rows] / 2
        held_out = np.cumsum(weights[:, rows] <= 0, axis=1)
        before = np.concatenate([np.zeros((len(weights), 1)), held_out], axis=1)
        first, last = (np.searchsorted(middle, t[windows]) for t in (balance.start, balance.stop))
        out[:, windows] = before[:, last] == before[:, first]
    return out
