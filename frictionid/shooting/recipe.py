"""Shooting as a recipe: what is freed, and which one-step fit it begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.recipe import INTEGRAL, Recipe
from frictionid.rig import stacked
from frictionid.shooting.blocks import Block, FrictionBlock
from frictionid.shooting.refine import Refined, begin, refined
from frictionid.shooting.settings import Settings
from frictionid.shooting.solve import settle
from frictionid.shooting.track import Track


@dataclass(frozen=True)
class Shooting:
    """Friction refined by shooting, from what a one-step recipe finds.

    blocks : what is free; settings : windows, noise, iterations; start : the recipe it begins with
    """

    name: str = "shooting"
    blocks: tuple[Block, ...] = (FrictionBlock(),)
    settings: Settings = Settings()
    start: Recipe = INTEGRAL


def refine_folds(
    friction: Friction, track: Track, recipe: Shooting, training: Array
) -> tuple[Friction, Refined]:
    """Friction (F, n, P) of all folds with its rigs, and all that is known of the last one.

    training : (F, K), the intervals of the track that each fold may use; the last one is that of
        all data. The others begin where it ended, and end where their own data say: their last
        steps are smaller than a tenth of a standard error, so nothing is left of their begin.
    """
    whole, nodes = _one(friction[-1], track, recipe, training[-1] > 0, None)
    frictions = []
    for f in range(len(training) - 1):
        part, _ = _one(whole.friction, track, recipe, training[f] > 0, nodes)
        frictions.append(part.friction)
    return _together([*frictions, whole.friction]), whole


def _one(
    friction: Friction, track: Track, recipe: Shooting, use: Array, nodes: Array | None
) -> tuple[Refined, Array]:
    intervals, guess = begin(friction, track, recipe.blocks, recipe.settings)
    stages = 0 if nodes is None else 1
    shot = settle(intervals, guess, use, nodes, stages=stages)
    return refined(intervals, shot, recipe.blocks), shot.nodes


def _together(frictions: Sequence[Friction]) -> Friction:
    theta = np.stack([np.asarray(f.theta) for f in frictions])
    rigs = [f.rig for f in frictions if f.rig is not None]
    return replace(frictions[-1], theta=theta, rig=stacked(rigs))
