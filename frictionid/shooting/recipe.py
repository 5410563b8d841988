"""Shooting as a recipe: what is freed, and which one-step fit it begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.friction import Friction
from frictionid.identifiers.formulation import INTEGRAL, Recipe
from frictionid.mechanics.calibration import stack_calibrations
from frictionid.shooting.gauss_newton import solve
from frictionid.shooting.intervals import Intervals
from frictionid.shooting.parameters import FrictionBlock, ParameterBlock
from frictionid.shooting.parameters.friction import on_support
from frictionid.shooting.parameters.parameter_block import values_of
from frictionid.shooting.refine import Refined, prepare_fit, refined_by
from frictionid.shooting.settings import Settings

_STEPS = 4  # of folds, from the fit to all data


@dataclass(frozen=True)
class Shooting:
    """Friction refined by shooting, from what a one-step recipe finds.

    blocks : what is free; settings : windows, noise, iterations; start : the recipe it begins with
    """

    name: str = "shooting"
    blocks: tuple[ParameterBlock, ...] = (FrictionBlock(),)
    settings: Settings = Settings()
    start: Recipe = INTEGRAL


def refine_folds(
    friction: Friction, intervals: Intervals, recipe: Shooting, training: Array
) -> tuple[Friction, Refined]:
    """Friction (F, n, P) of all folds with its calibrations, and all that is known of the last one.

    training : (F, K), the intervals of the track that each fold may use; the last one is that of
        all data. The others begin where it ended, at a fraction of a standard error from where
        their own data say, and have four steps of Gauss and Newton to get there, after which
        nothing is left of their begin. Priors stay where the first step of their own fold put them.
        Folds in which a sparse law has other terms are fitted from their own begin, and so are all
        of a network, which keeps something of it where the motion shows nothing: it takes over no
        more than the states of the motion.
    """
    network = friction.law.is_network
    own = [on_support(recipe.blocks, friction[f]) for f in range(len(training))]
    recipe = replace(recipe, blocks=own[-1])
    whole, nodes = _one(friction[-1], intervals, recipe, training[-1] > 0, None, None)
    alone = recipe
    few = min(recipe.settings.iterations, _STEPS)
    recipe = replace(recipe, settings=replace(recipe.settings, iterations=few))
    frictions = []
    for f in range(len(training) - 1):
        use = training[f] > 0
        if network or own[f] != own[-1]:
            other, states = replace(alone, blocks=own[f]), nodes if network else None
            frictions.append(_one(friction[f], intervals, other, use, states, None)[0].friction)
            continue
        known = _values(friction[f], intervals, recipe)
        part, _ = _one(whole.friction, intervals, recipe, use, nodes, known)
        frictions.append(part.friction)
    return _together([*frictions, whole.friction]), whole


def _values(friction: Friction, intervals: Intervals, recipe: Shooting) -> Array:
    """Values (D,) of the free parameters in a friction, before any shooting."""
    problem, estimate = prepare_fit(friction, intervals, recipe.blocks, recipe.settings)
    return values_of(estimate, problem.blocks)


def _one(
    friction: Friction,
    intervals: Intervals,
    recipe: Shooting,
    use: Array,
    nodes: Array | None,
    known: Array | None,
) -> tuple[Refined, Array]:
    problem, estimate = prepare_fit(friction, intervals, recipe.blocks, recipe.settings)
    stages = 0 if nodes is None else 1
    if nodes is not None:
        states = nodes[:, : 2 * intervals.n]
        nodes = np.concatenate([states, *problem.initial_memory(estimate)], axis=-1)
    solution = solve(problem, estimate, use, nodes, stages=stages, mean=known)
    return refined_by(problem, solution, friction), solution.nodes


def _together(frictions: Sequence[Friction]) -> Friction:
    theta = namespace(frictions[-1].theta).stack([f.theta for f in frictions])
    calibrations = [f.calibration for f in frictions if f.calibration is not None]
    return replace(frictions[-1], theta=theta, calibration=stack_calibrations(calibrations))
