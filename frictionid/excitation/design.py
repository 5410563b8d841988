"""Design of an experiment: a search for torque signals, their motion, and what it identifies.

The search has a pool of random signals, Fedorov exchange of recordings, and refinement. Its
criterion is the smallest eigenvalue of the expected information, the inverse of the covariance
of all parameters, each in units of the standard error by a plain sine (E-optimality [Walter1997],
standardised [Dette1997]). Friction counts more than the base parameters, which are identified with
it. Information adds up over recordings, so that the best set of motions that are simulated once is
found by exchange [Fedorov1972]. New signals come from the best and nearly best ones, by small
changes and by differences between two of them [Storn1997].
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from frictionid.arrays import Array
from frictionid.config import Count, validated
from frictionid.errors import InputError
from frictionid.progress import Done, say_nothing

from .experiment import Experiment
from .information import (
    Concatenated,
    Information,
    Motions,
    covariances,
    equations,
    expected_information,
    jerk_decades,
    predict_motions,
    smoothed_states,
)

# Standard errors that count as one, over the best of any single recording: of base parameters, and
# at most of friction (plain sines may be worse).
BASE_SCALE, FRICTION_SCALE = 10.0, 4.0
_SWEEPS = 5
_SINES = 10  # one of so many signals of the first pool is a plain sine
_NEAR = 6  # signals kept as parents for each recording
_SPREAD = (0.003, 0.3)  # of a change, in the unit cube: motions are sensitive
_CHANGED = 4.0  # coordinates, on average
_STEP = (0.2, 0.8)  # of a difference between two parents
_KINDS = (4, 3, 3)  # of ten children: changed ones, differences, and fresh ones
_TRIES = 3


@validated
class Search:
    """Effort of the search: random signals, then generations of refined ones; seed of the draws."""

    pool: Count = 600
    generations: Annotated[int, Field(ge=0)] = 12
    children: Count = 200
    seed: Annotated[int, Field(ge=0)] = 0


class Pool(NamedTuple):
    """Signals x (N, size) that keep the limits, and the expected information of each."""

    x: Array
    information: Information

    def joined(self, other: "Pool") -> "Pool":
        """Both pools as one."""
        pairs = zip(self.information, other.information, strict=True)
        both = Information(*(np.concatenate(pair, axis=1) for pair in pairs))
        return Pool(np.concatenate([self.x, other.x]), both)


def search_signals(experiment: Experiment, search: Search, done: Done) -> tuple[Array, Array]:
    """Signals x (R, size) of the experiment's recordings, and the criterion after each stage.

    `done` is called with a line of text after each of the `generations + 1` stages.

    Raises
    ------
    InputError
        Where no signal of the pool keeps the limits, or none shows friction and inertia.
    """
    random = np.random.default_rng(search.seed)
    sines, pool = _first(experiment, search, random)
    recordings = experiment.recordings
    scale = scales(experiment, pool.information, pool.information.pick(slice(sines)))
    chosen, value = exchange(pool.information, scale, recordings)
    if not value > 0.0:
        raise InputError(
            "no signal within the limits shows all of friction and inertia: check the parameters "
            "of the mechanism, or widen the limit of the torque or the length of the recordings"
        )
    values = [value]
    done(f"{len(pool.x)} signals keep the limits")
    for _ in range(search.generations):
        near = (_in_place(pool.information, scale, [*chosen], r) for r in range(recordings))
        parents = np.concatenate([chosen, *(np.argsort(-values)[:_NEAR] for values in near)])
        x = _children(pool.x[parents], search.children, random)
        children = simulated(experiment, x, search.seed)
        pool = pool if children is None else pool.joined(children)
        chosen, value = exchange(pool.information, scale, recordings, chosen)
        values.append(value)
        done(f"{100 * np.sqrt(values[0] / value):.0f} % of the first standard errors")
    return pool.x[chosen], np.array(values)


def simulated(experiment: Experiment, x: Array, seed: int) -> Pool | None:
    """Pool of the signals that keep the limits, None where none does."""
    torque, start = experiment.torque_of(x), experiment.start_of(x)
    motions = predict_motions(experiment, torque, start, quick=True)
    kept = np.flatnonzero(motions.within(experiment))
    if not kept.size:
        return None
    return Pool(x[kept], expected_information(experiment, motions.pick(kept), seed))


def _first(experiment: Experiment, search: Search, random: np.random.Generator) -> tuple[int, Pool]:
    """The first pool, and how many plain sines it begins with."""
    # those at a resonance are hard to find by chance, and hard to beat
    sines = experiment.sines(search.pool // _SINES)
    for _ in range(_TRIES):
        x = random.uniform(size=(search.pool - len(sines), experiment.size))
        pool = simulated(experiment, np.concatenate([sines, x]), search.seed)
        if pool is not None:
            return int((pool.x[:, None] == sines).all(-1).any(-1).sum()), pool
    limits = experiment.limits
    raise InputError(
        f"none of {_TRIES * search.pool} signals keeps the limits, velocity "
        f"{limits.velocity.tolist()} and angle {limits.angle.tolist()}: shorten the recordings, "
        "raise the frequencies, widen the limits, or give start angles at which the machine rests"
    )


def _children(parents: Array, count: int, random: np.random.Generator) -> Array:
    """New signals of three kinds.

    A parent changed in a few coordinates, by much or by little; a parent moved by the difference of
    two others in half of its coordinates; random ones.
    """
    changed, moved = (count * kind // sum(_KINDS) for kind in _KINDS[:2])
    size = parents.shape[1]
    x = parents[np.arange(changed) % len(parents)]
    few = random.uniform(size=x.shape) < _CHANGED / size
    low, high = np.log(_SPREAD)
    spread = np.exp(random.uniform(low, high, size=(changed, 1)))
    x = x + few * spread * random.standard_normal(x.shape)
    a, b, c = parents[random.integers(len(parents), size=(3, moved))]
    half = random.uniform(size=a.shape) < 0.5
    y = a + half * random.uniform(*_STEP, size=(moved, 1)) * (b - c)
    fresh = random.uniform(size=(count - changed - moved, size))
    folded = np.abs(np.concatenate([x, y, fresh])) % 2.0
    return np.minimum(folded, 2.0 - folded)  # reflected at both ends


def exchange(
    pool: Information, scale: Array, recordings: int, initial: Sequence[int] | Array = ()
) -> tuple[Array, float]:
    """Indices (R,) of the recordings with the best joint information, and their criterion.

    Fedorov exchange: one after the other is replaced by the best until nothing improves.
    """
    chosen, value = list(initial), 0.0
    for _ in range(_SWEEPS):
        before = list(chosen)
        for place in range(recordings):
            values = _in_place(pool, scale, chosen, place)
            chosen = [*chosen[:place], int(np.argmax(values)), *chosen[place + 1 :]]
            value = float(values.max())
        if chosen == before:
            break
    return np.array(chosen), value


def _in_place(pool: Information, scale: Array, chosen: list[int], place: int) -> Array:
    """Criterion (N,) with each signal of the pool in place of one of the chosen."""
    others = chosen[:place] + chosen[place + 1 :]
    sums = Information(*(x + x[:, others].sum(1, keepdims=True) for x in pool))
    return e_criterion(sums, scale)


def e_criterion(information: Information, scale: Array) -> Array:
    """Smallest eigenvalue of the scaled information, (N,), at the worst of L friction scales.

    information (L, N, P, P) ; scale (P,) : standard errors that count as one
    """
    covariance = covariances(information) / (scale[:, None] * scale)
    singular = ~np.isfinite(covariance).all(axis=(-2, -1))
    safe = np.where(singular[..., None, None], 0.0, covariance)
    largest = np.linalg.eigvalsh(safe)[..., -1]
    return np.where(singular, 0.0, 1.0 / np.maximum(largest, 1e-300)).min(axis=0)


def scales(experiment: Experiment, pool: Information, sines: Information) -> Array:
    """Standard errors (P,) that count as one.

    For friction the least of one plain sine, at most FRICTION_SCALE times the least of any
    recording of the pool; for base parameters BASE_SCALE times the latter. So each parameter counts
    by its distance from the best that is possible for it alone, not by a prior of its size
    [Dette1997]. Where no recording identifies it, its size is used.
    """
    p = np.abs(experiment.plant.p)
    sizes = np.concatenate([experiment.friction.theta.ravel(), np.where(p > 0, p, p.max())])
    least, plain = (_least(each) for each in (pool, sines))
    least = np.where(np.isfinite(least), least, sizes)
    friction = np.arange(len(sizes)) < len(sizes) - len(p)
    return np.where(friction, np.minimum(plain, FRICTION_SCALE * least), BASE_SCALE * least)


def _least(each: Information) -> Array:
    """Least standard error (P,) by one recording, infinite where none identifies a parameter."""
    variances = np.diagonal(covariances(each), axis1=-2, axis2=-1).max(axis=0)
    return np.sqrt(variances.min(axis=0, initial=np.inf))


DRAWS = 80  # a standard deviation is then known to 8 %


class MonteCarlo(NamedTuple):
    """Deviations of D fits from the truth: of friction alone (D, F), and with free p (D, P)."""

    friction: Array
    everything: Array

    def errors(self, *, inertia: bool) -> Array:
        """Standard errors of friction (F,), with `inertia` of friction and base parameters (P,)."""
        return np.std(self.everything if inertia else self.friction, axis=0, ddof=1)

    def bias(self, *, inertia: bool) -> Array:
        """Mean deviations: the error of smoothing, whatever the noise."""
        return (self.everything if inertia else self.friction).mean(axis=0)


def monte_carlo(
    experiment: Experiment, motions: Motions, seed: int, draws: int = DRAWS
) -> MonteCarlo:
    """Deviations of fits to `draws` noisy repetitions of N recordings, all fitted together.

    motions : at the prior friction (L = 1)
    """
    images, _, N, n = motions.q.shape
    dt = 1.0 / experiment.camera_rate
    noise = np.random.default_rng(seed).normal(0.0, experiment.noise, (images, draws, N, n))
    q, w = smoothed_states(motions.q + noise, jerk_decades(motions.q + noise, dt), dt)
    H, g = [], []
    for d in range(draws):
        drawn = motions._replace(q=q[:, d : d + 1], w=w[:, d : d + 1])
        fit = Concatenated.at_level(experiment, drawn, 0)
        A, gradient = equations(fit, fit.projector, fit.problem)
        A = A[fit.used]
        H.append(np.einsum("kip,kiq->pq", A, A))
        g.append(gradient[fit.used].sum(0))
    count = experiment.friction.theta.size
    both = np.array(H), np.array(g)
    return MonteCarlo(_fitted(both[0][:, :count, :count], both[1][:, :count]), _fitted(*both))


def _fitted(H: Array, g: Array) -> Array:
    """-H^-1 g (D, P); infinite where some parameter has no effect."""
    scale = np.sqrt(np.einsum("dii->di", H))
    if not np.all(scale > 0):
        return np.full(g.shape, np.inf)
    scaled = H / (scale[:, :, None] * scale[:, None, :])
    return -np.linalg.solve(scaled, (g / scale)[..., None])[..., 0] / scale


OTHER_SCALES = (0.5, 2.0)  # of the prior friction, at which the signals are simulated as well


@dataclass(frozen=True)
class Design:
    """Torque signals to apply, and what is expected of them.

    experiment, search : settings of the design
    x (R, size) : the signals; torque (K + 1, R, n) [N m] and start angles (R, n) that they mean
    motions, monte_carlo : at the prior friction (L = 1)
    others : the same motions with half and twice that friction (L = 2)
    values : smallest eigenvalue of the scaled information after each stage of the search
    """

    experiment: Experiment
    search: Search
    x: Array
    torque: Array
    start: Array
    motions: Motions
    monte_carlo: MonteCarlo
    others: Motions
    values: Array


def design_signals(experiment: Experiment, search: Search, done: Done = say_nothing) -> Design:
    """Best signals of a search, with their expected motion and standard errors.

    `done` is called with a line of text after each stage of the search.

    Measured against plain sines of the same length at the torque limit, on an acrobot with four
    recordings of 5 s: at 1.125, 1.5 and 2 Hz the standard errors of friction are at most 0.48 of
    those of the sine. At the resonance, 1.25 Hz, they are so, too, but for Coulomb friction of the
    joint without motor, 0.60 with free inertia (0.37 with known inertia): there a sine swings that
    joint about as far and as often as the motor can.
    """
    x, values = search_signals(experiment, search, done)
    torque, start = experiment.torque_of(x), experiment.start_of(x)
    nominal = replace(experiment, friction_scales=(1.0,))
    motions = predict_motions(nominal, torque, start)
    others = predict_motions(replace(nominal, friction_scales=OTHER_SCALES), torque, start)
    repeated = monte_carlo(nominal, motions, search.seed)
    return Design(experiment, search, x, torque, start, motions, repeated, others, values)
