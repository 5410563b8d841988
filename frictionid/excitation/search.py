"""The search for signals: a pool of random ones, an exchange of recordings, and refinement.

Maximised is the smallest eigenvalue of the expected information, the inverse of the covariance of
all parameters, each in units of what a plain sine can do for it (E-optimality [Walter1997],
standardised [Dette1997]); friction, which is asked for, counts more than the base parameters, which
have to be known with it. Recordings add up in it, so that the best set is found
among motions that are simulated once, by exchange [Fedorov1972]. New signals come from the best and
from those that would nearly do in their place, by small changes and by differences between two of
them [Storn1997].
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
from frictionid.excitation.motion import moved
from frictionid.excitation.signals import Waves

# A base parameter may be this many times farther from the best that could be done before it binds,
# and friction of which plain sines hardly tell this many times.
LOOSE = 10.0
POOR = 4.0
_SWEEPS = 5
_SINES = 10  # one of so many signals of the first pool is a plain sine
_NEAR = 6  # signals kept as parents for each recording
_SPREAD = (0.003, 0.3)  # of a change, in the unit cube: motions are sensitive
_CHANGED = 4.0  # coordinates, on average
_STEP = (0.2, 0.8)  # of a difference between two parents
_KINDS = (4, 3, 3)  # of ten children: changed ones, differences, and fresh ones
_TRIES = 3


@dataclass(frozen=True)
class Search:
    """How long is searched: random signals, then generations of refined ones; seed of the draws."""

    pool: int = 600
    generations: int = 12
    children: int = 200
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
    sines, pool = _first(waves, search, random)
    recordings = waves.experiment.recordings
    scale = scales(waves.experiment, pool.expected, pool.expected.pick(slice(sines)))
    chosen, value = choose(pool.expected, scale, recordings)
    values = [value]
    done(f"{len(pool.x)} signals keep the limits")
    for _ in range(search.generations):
        x = _children(pool.x[_parents(pool.expected, scale, chosen)], search.children, random)
        more = simulated(waves, x, search.seed)
        pool = pool if more is None else pool.joined(more)
        chosen, value = choose(pool.expected, scale, recordings, chosen)
        values.append(value)
        done(f"{100 * np.sqrt(values[0] / value):.0f} % of the first standard errors")
    return pool.x[chosen], np.array(values)


def simulated(waves: Waves, x: Array, seed: int) -> Pool | None:
    """Those of the signals that keep the limits, None where none does."""
    motions = moved(waves.experiment, waves.torque(x), waves.start(x), quick=True)
    kept = np.flatnonzero(motions.within(waves.experiment))
    if not kept.size:
        return None
    return Pool(x[kept], expected(waves.experiment, motions.pick(kept), seed))


def _first(waves: Waves, search: Search, random: np.random.Generator) -> tuple[int, Pool]:
    """The first pool, and how many plain sines it begins with."""
    # at a resonance they are hard to find by chance, and hard to beat
    sines = waves.sines(search.pool // _SINES)
    for _ in range(_TRIES):
        x = random.uniform(size=(search.pool - len(sines), waves.size))
        pool = simulated(waves, np.concatenate([sines, x]), search.seed)
        if pool is not None:
            return int((pool.x[:, None] == sines).all(-1).any(-1).sum()), pool
    limits = waves.experiment.limits
    raise InputError(
        f"none of {_TRIES * search.pool} signals keeps the limits, velocity "
        f"{limits.velocity.tolist()} and angle {limits.angle.tolist()}: shorten the recordings, "
        "raise the frequencies, widen the limits, or give start angles at which the machine rests"
    )


def _parents(pool: Expected, scale: Array, chosen: Array) -> Array:
    """Indices of the chosen recordings and of the best in place of each."""
    near = [np.argsort(-_in_place(pool, scale, [*chosen], r))[:_NEAR] for r in range(len(chosen))]
    return np.concatenate([chosen, *near])


def _children(parents: Array, count: int, random: np.random.Generator) -> Array:
    """New signals of three kinds.

    A parent changed in a few coordinates, by much or by little; a parent moved by the difference of
    two others in half of its coordinates; random ones.
    """
    changed, moved_on = (count * kind // sum(_KINDS) for kind in _KINDS[:2])
    size = parents.shape[1]
    x = parents[np.arange(changed) % len(parents)]
    few = random.uniform(size=x.shape) < _CHANGED / size
    low, high = np.log(_SPREAD)
    spread = np.exp(random.uniform(low, high, size=(changed, 1)))
    x = x + few * spread * random.standard_normal(x.shape)
    a, b, c = parents[random.integers(len(parents), size=(3, moved_on))]
    half = random.uniform(size=a.shape) < 0.5
    y = a + half * random.uniform(*_STEP, size=(moved_on, 1)) * (b - c)
    fresh = random.uniform(size=(count - changed - moved_on, size))
    folded = np.abs(np.concatenate([x, y, fresh])) % 2.0
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
            values = _in_place(pool, scale, chosen, place)
            chosen = [*chosen[:place], int(np.argmax(values)), *chosen[place + 1 :]]
            value = float(values.max())
        if chosen == before:
            break
    return np.array(chosen), value


def _in_place(pool: Expected, scale: Array, chosen: list[int], place: int) -> Array:
    """Value (N,) with each signal of the pool in place of one of the chosen."""
    others = chosen[:place] + chosen[place + 1 :]
    sums = Expected(*(x + x[:, others].sum(1, keepdims=True) for x in pool))
    return information(sums, scale)


def information(sums: Expected, scale: Array) -> Array:
    """Smallest eigenvalue of the scaled information at the worst level, (N,) for (L, N, P, P)."""
    covariance = covariances(sums) / (scale[:, None] * scale)
    blind = ~np.isfinite(covariance).all(axis=(-2, -1))
    safe = np.where(blind[..., None, None], 0.0, covariance)
    largest = np.linalg.eigvalsh(safe)[..., -1]
    return np.where(blind, 0.0, 1.0 / np.maximum(largest, 1e-300)).min(axis=0)


def scales(experiment: Experiment, pool: Expected, sines: Expected) -> Array:
    """Standard errors (P,) that count as one.

    Friction's are the least that one plain sine gives, if it tells of them at all, base parameters'
    the least of one recording of the pool, LOOSE for them. So each parameter counts by how far it
    is from what can be done for it alone, not by a guess of its size [Dette1997]. Where all are
    blind, its size has to do.
    """
    p = np.abs(experiment.plant.p)
    sizes = np.concatenate([experiment.friction.theta.ravel(), np.where(p > 0, p, p.max())])
    best, plain = (_least(each) for each in (pool, sines))
    best = np.where(np.isfinite(best), best, sizes)
    friction = np.arange(len(sizes)) < len(sizes) - len(p)
    return np.where(friction, np.minimum(plain, POOR * best), LOOSE * best)


def _least(each: Expected) -> Array:
    """Least standard error (P,) by one recording, infinite where there is none that tells."""
    variances = np.diagonal(covariances(each), axis1=-2, axis2=-1).max(axis=0)
    return np.asarray(np.sqrt(variances.min(axis=0, initial=np.inf)))
