"""Shooting as a recipe: what is freed, and which one-step fit it begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array, namespace
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.identifiers import Identifier
from frictionid.identifiers.formulation import INTEGRAL, Recipe, TrainingData
from frictionid.identifiers.one_step_fit import OneStepFit
from frictionid.mechanics.calibration import stack_calibrations
from frictionid.shooting.gauss_newton import solve
from frictionid.shooting.parameters import FrictionBlock, ParameterBlock
from frictionid.shooting.parameters.friction import on_support
from frictionid.shooting.parameters.parameter_block import values_of
from frictionid.shooting.refine import Refined, prepare_fit, refined_by
from frictionid.shooting.sample_intervals import Intervals
from frictionid.shooting.settings import Settings

_STEPS = 4  # of Gauss and Newton, of a fold that begins at the fit to all data


class ShootingData(TrainingData, Protocol):
    """What shooting fits: intervals of measured angles.

    `interval_weights` (F + 1, K) are positive where a fold may use an interval; the last row is
    that of all data.
    """

    @property
    def intervals(self) -> Intervals: ...
    @property
    def interval_weights(self) -> Array: ...


@dataclass(frozen=True, eq=False)
class ShootingFit:
    """Friction (F, n, P) of F folds, the last one all data, refined by shooting."""

    friction: Friction
    refined: Refined

    def half_widths(self) -> Array:
        """Half the width (n, P) of the 95 % intervals of the friction of all data, or NaN."""
        covariance = self.refined.covariance
        half = np.full(np.shape(self.refined.friction.theta), np.nan)
        for entry, error in zip(covariance.parameters, covariance.error, strict=True):
            if entry.block == "friction":
                half[entry.place] = stdtrit(covariance.freedom, 0.975) * error
        return half


@dataclass(frozen=True)
class Shooting:
    """Friction refined by shooting, from the fit of a one-step recipe.

    blocks : what is free; settings : windows, noise, iterations; start : the recipe it begins with
    """

    name: str = "shooting"
    blocks: tuple[ParameterBlock, ...] = (FrictionBlock(),)
    settings: Settings = Settings()
    start: Recipe = INTEGRAL
    needs_intervals: ClassVar[bool] = True
    scheme: ClassVar[str] = "shooting"
    calibrator: ClassVar[None] = None
    corrects: ClassVar[tuple[str, ...]] = ()

    @property
    def first_step(self) -> Recipe:
        """The one-step recipe that a fit begins with."""
        return self.start

    @property
    def steps(self) -> tuple[Recipe, ...]:
        """The one-step recipes whose problems a fit needs."""
        return (self.start,)

    def check(self, identifier: Identifier) -> None:
        """Check that it can fit an identifier.

        Raises
        ------
        InputError
            For identifiers that use no mechanism.
        """
        check_mechanism(self.name, identifier)

    def fit(
        self, identifier: Identifier, data: ShootingData, seed: int
    ) -> OneStepFit | ShootingFit:
        """The identifier's friction of all folds and of all data, refined unless it is fixed.

        Raises
        ------
        InputError
            Where the fit fails.
        """
        first = self.start.fit(identifier, data, seed)
        if identifier.fixed:
            return first
        refined = refine_folds(first.friction, data.intervals, self, data.interval_weights)
        return ShootingFit(*refined)


def check_mechanism(recipe: str, identifier: Identifier) -> None:
    """Refuse identifiers that use no mechanism.

    Raises
    ------
    InputError
        With the name of the recipe, and what to do.
    """
    if not identifier.uses_mechanism:
        raise InputError(
            f"recipe {recipe!r}: shooting needs the physics that a black box lacks: give it "
            'recipes = ["integral"], or another one-step recipe'
        )


def refine_folds(
    friction: Friction, intervals: Intervals, recipe: Shooting, training: Array
) -> tuple[Friction, Refined]:
    """Friction (F, n, P) of all folds with its calibrations, and the whole result of the last one.

    training : (F, K), the intervals that each fold may use; the last row is that of
        all data

    All data are fitted first. Each fold begins where that fit ended, a fraction of a standard error
    from its own optimum, and takes four steps of Gauss and Newton. Its priors stay centred on its
    own one-step fit. Two kinds of folds are fitted from their own one-step fit instead: those in
    which a sparse law has other terms, and those of a network, whose numbers keep something of
    where they began. Networks take over no more than the states of the motion.
    """
    blocks = [on_support(recipe.blocks, friction[f]) for f in range(len(training))]
    of_all = replace(recipe, blocks=blocks[-1])
    whole, nodes = _refined(_Start(friction[-1]), intervals, of_all, training[-1] > 0)
    few = min(recipe.settings.iterations, _STEPS)
    short = replace(recipe.settings, iterations=few)
    network = friction.law.is_network
    frictions = []
    for f, use in enumerate(training[:-1] > 0):
        own = replace(recipe, blocks=blocks[f])
        if network:
            start = _Start(friction[f], nodes)
        elif blocks[f] != blocks[-1]:
            start = _Start(friction[f])
        else:
            own = replace(of_all, settings=short)
            start = _Start(whole.friction, nodes, _values(friction[f], intervals, own))
        frictions.append(_refined(start, intervals, own, use)[0].friction)
    return _together([*frictions, whole.friction]), whole


@dataclass(frozen=True, eq=False)
class _Start:
    """Where a fit by shooting begins.

    nodes : states and memories at the intervals' begins, of the smoothed motion by default; from
        given ones only the last stage of windows is fitted
    mean : (D,) of the priors, those of the friction by default
    """

    friction: Friction
    nodes: Array | None = None
    mean: Array | None = None


def _values(friction: Friction, intervals: Intervals, recipe: Shooting) -> Array:
    """Values (D,) of the free parameters in a friction, before any shooting."""
    problem, estimate = prepare_fit(friction, intervals, recipe.blocks, recipe.settings)
    return values_of(estimate, problem.blocks)


def _refined(
    start: _Start, intervals: Intervals, recipe: Shooting, use: Array
) -> tuple[Refined, Array]:
    """The result of a fit to the intervals in use (K,), and the nodes where it ended."""
    problem, estimate = prepare_fit(start.friction, intervals, recipe.blocks, recipe.settings)
    if start.nodes is None:
        solution = solve(problem, estimate, use, mean=start.mean)
    else:
        states = start.nodes[:, : 2 * intervals.n]
        nodes = np.concatenate([states, *problem.initial_memory(estimate)], axis=-1)
        solution = solve(problem, estimate, use, nodes, stages=1, mean=start.mean)
    return refined_by(problem, solution, start.friction), solution.nodes


def _together(frictions: Sequence[Friction]) -> Friction:
    theta = namespace(frictions[-1].theta).stack([f.theta for f in frictions])
    calibrations = [f.calibration for f in frictions if f.calibration is not None]
    return replace(frictions[-1], theta=theta, calibration=stack_calibrations(calibrations))
