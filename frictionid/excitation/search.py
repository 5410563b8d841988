"""The search for signals: a pool of random ones, an exchange of recordings, and refinement.

Maximised is the smallest eigenvalue of the expected information, the inverse of the covariance of
all parameters, each in units of the best that one recording can do for it (E-optimality
[Walter1997], standardised [Dette1997]). Recordings add up in it, so that the best set is found
among motions that are simulated once, by exchange [Fedorov1972].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.excitation.experiment import Experiment
from frictionid.excitation.information import Expected, covariances, expected
from frictionid.excitation.motion import COARSE, moved
from frictionid.excitation.waves import Waves

_SWEEPS = 5
_SPREAD = (0.003, 0.3)  # of a change, in the unit cube: motions are sensitive
_CHANGED = 4.0  # coordinates, on average
_TRIES = 3


@dataclass(frozen=True)
class Search:
    """How long is searched: random signals, then generations of refined ones; seed of the draws."""

    pool: int = 384
    generations: int = 4
    children: int = 192
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (("pool", 1), ("generations", 0), ("children", 1), ("seed", 0)):
            if getattr(self, name) < least:
                raise InputError(f"{name} = {getattr(self, name)} must be at least {least}")


class Pool(NamedTuple):
    """Signals x (N, size) that keep the limits, and what each will tell."""

    x: Array
    expected: Expected

    def joined(self, other: Pool) -> Pool:
        """Both pools as one."""
        pairs = zip(self.expected, other.expected, strict=True)
        both = Expected(*(np.concatenate(pair, axis=1) for pair in pairs))
        return Pool(np.concatenate([self.x, other.x]), both)


def best(
    waves: Waves, search: Search, done: Callable[[str], None] = lambda _: None
) -> tuple[Array, Array]:
    """Signals x (R, size) of the experiment's recordings, and the value reached after each stage.

    `done` is called with a line of text after each of the `generations + 1` stages.

    Raises
    ------
    InputError
        Where no signal of the pool keeps the limits.
    """
    random = np.random.default_rng(search.seed)
    pool = _first(waves, search, random)
    scale, recordings = scales(waves.experiment, pool.expected), waves.experiment.recordings
    chosen, value = choose(pool.expected, scale, recordings)
    values = [value]
    done(f"{len(pool.x)} signals keep the limits")
    for _ in range(search.generations):
        parents = pool.x[chosen]
        x = _children(parents, search.children, random)
        more = simulated(waves, x, search.seed)
        pool = pool if more is None else pool.joined(more)
        chosen, value = choose(pool.expected, scale, recordings, chosen)
        values.append(value)
        done(f"{100 * np.sqrt(values[0] / value):.0f} % of the first standard errors")
    return pool.x[chosen], np.array(values)


def simulated(waves: Waves, x: Array, seed: int) -> Pool | None:
    """Those of the signals that keep the limits, None where none does."""
    motions = moved(waves.experiment, waves.torque(x), waves.start(x), width=COARSE)
    kept = np.flatnonzero(motions.within(waves.experiment))
    if not kept.size:
        return None
    return Pool(x[kept], expected(waves.experiment, motions.pick(kept), seed))


def _first(waves: Waves, search: Search, random: np.random.Generator) -> Pool:
    for _ in range(_TRIES):
        pool = simulated(waves, random.uniform(size=(search.pool, waves.size)), search.seed)
        if pool is not None:
            return pool
    limits = waves.experiment.limits
    raise InputError(
        f"none of {_TRIES * search.pool} signals keeps the limits, velocity "
        f"{limits.velocity.tolist()} and angle {limits.angle.tolist()}: shorten the recordings, "
        "raise the frequencies, widen the limits, or give start angles at which the machine rests"
    )


def _children(parents: Array, count: int, random: np.random.Generator) -> Array:
    """Signals near the parents: each changed in a few coordinates, by much or by little."""
    x = parents[np.arange(count) % len(parents)]
    few = random.uniform(size=x.shape) < _CHANGED / x.shape[1]
    low, high = np.log(_SPREAD)
    spread = np.exp(random.uniform(low, high, size=(count, 1)))
    folded = np.abs(x + few * spread * random.standard_normal(x.shape)) % 2.0
    return np.minimum(folded, 2.0 - folded)  # reflected at both ends


def choose(
    pool: Expected, scale: Array, recordings: int, begin: Array | None = None
) -> tuple[Array, float]:
    """Indices (R,) of the recordings that together tell most, and their value.

    One after the other is exchanged for the best in its place until nothing improves.
    """
    chosen = [] if begin is None else [int(i) for i in begin]
    value = 0.0
    for _ in range(_SWEEPS):
        before = list(chosen)
        for place in range(recordings):
            others = chosen[:place] + chosen[place + 1 :]
            sums = Expected(*(x + x[:, others].sum(1, keepdims=True) for x in pool))
            values = information(sums, scale)
            chosen = [*chosen[:place], int(np.argmax(values)), *chosen[place + 1 :]]
            value = float(values.max())
        if chosen == before:
            break
    return np.array(chosen), value


def information(sums: Expected, scale: Array) -> Array:
    """Smallest eigenvalue of the scaled information at the worst level, (N,) for (L, N, P, P)."""
    covariance = covariances(sums) / (scale[:, None] * scale)
    blind = ~np.isfinite(covariance).all(axis=(-2, -1))
    safe = np.where(blind[..., None, None], 0.0, covariance)
    largest = np.linalg.eigvalsh(safe)[..., -1]
    return np.where(blind, 0.0, 1.0 / np.maximum(largest, 1e-300)).min(axis=0)


def scales(experiment: Experiment, pool: Expected) -> Array:
    """Least standard error (P,) that one recording of the pool gives each parameter.

    So each parameter counts by how far it is from the best that could be done for it alone, not by
    a guess of its size [Dette1997]. Where all are blind, its size has to do.
    """
    variances = np.diagonal(covariances(pool), axis1=-2, axis2=-1).max(axis=0).min(axis=0)
    p = np.abs(experiment.plant.p)
    sizes = np.concatenate([experiment.friction.theta.ravel(), np.where(p > 0, p, p.max())])
    return np.where(np.isfinite(variances), np.sqrt(variances), sizes)
