"""Covariance between recordings, what is undetermined, and blocks of sensors that show nothing."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.special import fdtrc  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.friction import Friction, Inputs, Law
from frictionid.friction.provenance import Dropped

from .fit import Covariance, forget
from .parameter_block import IDEAL, Parameter, ParameterBlock, limits_of
from .sandwich import SINGULAR, Groups, sandwich, shown_once, solve_scaled, step_of

_TEMPERATURES = (0.0, 80.0)  # [degC]
_POINTS, _SPEED, _DECADES = 200, 10.0, 4  # [rad/s], and how much slower the slowest is
_CHANGE = 0.3  # of a parameter's value
_NOTHING = 1e-9  # of the largest torque


def meaningless(
    friction: Friction, parameters: Sequence[Parameter], weak: Array, doubtful: Array | None = None
) -> dict[int, tuple[int, ...]]:
    """Entries that do nothing where weak ones (D,), known no better than to be zero, are zero.

    Each with the weak ones that it hangs on. The doubtful ones (D,), all weak ones and maybe more,
    count as weak where others hang on them.
    """
    doubtful = weak if doubtful is None else doubtful
    entries = [k for k, e in enumerate(parameters) if e.block == "friction"]
    levels = [i for i in entries if doubtful[i] and not parameters[i].is_velocity]

    out = {}
    for k in entries:
        joint = parameters[k].place[0]
        others = [i for i in levels if parameters[i].place[0] == joint and i != k]
        if (
            weak[k]
            or _shows(friction, parameters, k, others)
            or not _shows(friction, parameters, k, [])
        ):
            continue
        single = [i for i in others if not _shows(friction, parameters, k, [i])]
        out[k] = tuple(single or others)
    return out


def _shows(
    friction: Friction, parameters: Sequence[Parameter], k: int, zero: Sequence[int]
) -> bool:
    """Whether the torque answers to an entry while others are zero."""
    theta = np.array(friction.theta, dtype=float)
    for i in zero:
        theta[parameters[i].place] = np.clip(0.0, parameters[i].low, parameters[i].high)
    up, down = theta.copy(), theta.copy()
    up[parameters[k].place] *= 1.0 + _CHANGE
    down[parameters[k].place] *= 1.0 - _CHANGE
    here, there = (_torque(friction, t)[:, parameters[k].place[0]] for t in (up, down))
    return bool(np.abs(here - there).max() > _NOTHING * np.abs(here).max())


def _torque(friction: Friction, theta: Array) -> Array:
    """Torque (K, n) at inputs of all kinds, of a memory that has just met them."""
    law, x = friction.law, _inputs(friction.n)
    dt = np.full((_POINTS, 1), law.sample_time or 0.005)
    before = x.each(lambda value: value[::-1])
    memory = law.advance(theta, x, law.start(theta, before), dt)
    return np.asarray(law.torque(theta, x, memory) + 0.0 * x.w)


@cache
def _inputs(n: int) -> Inputs:
    """Inputs (K, n) of all kinds."""
    rng, shape = np.random.default_rng(0), (4, _POINTS, n)
    x = Inputs(*(_SPEED * 10.0 ** rng.uniform(-_DECADES, 0.0, shape) * rng.choice([-1, 1], shape)))
    return x._replace(load=np.abs(x.load), temperature=rng.uniform(*_TEMPERATURES, shape[1:]))


# A peak that is not there is searched for at any velocity: over two decades of it, in which
# velocities a factor of three apart find about independent peaks [Davies1987].
_TRIALS = 5


def grouped_covariance(
    parameters: tuple[Parameter, ...],
    values: Array,
    friction: Friction,
    groups: Groups,
    model_error: Array | float = 0.0,
) -> Covariance:
    """Covariance of any fit that ended at values (D,) of parameters, and at a friction.

    See `covariance_of`; the groups of rows are those of windows, or of stretches of recordings.
    """
    free, limits = groups.free, limits_of(parameters)
    H = groups.H.sum(axis=0) + np.diag(limits.precision)
    singular, lost, words = _undetermined(H, free, parameters)
    once = free & shown_once(H, groups)
    keep = np.flatnonzero(free & ~once)
    D, count = len(parameters), len(np.unique(groups.cluster))
    matrix = np.zeros((D, D))
    matrix[np.ix_(keep, keep)] = sandwich(H, groups._replace(free=free & ~once))
    tolerance = np.array([p.tolerance for p in parameters])
    matrix[np.ix_(keep, keep)] += _by_priors(H, limits.precision, tolerance, keep)
    pull = limits.precision * (limits.mean - (values - groups.move))
    # what one more step would change: where a fit has not settled, an error as good as any other
    left = step_of(H, groups.g.sum(axis=0) + pull, free)
    matrix += np.outer(left, left) + model_error
    unknown = ~free | lost | once
    words += tuple(
        f"only one recording or stretch of it shows {parameters[k].name}"
        for k in np.flatnonzero(once & ~lost)
    )
    forget(matrix, np.flatnonzero(unknown))
    out = Covariance(
        *(parameters, values, matrix, max(count - 1, 1), singular, words, ~free, count),
        meaningless=np.zeros(D, dtype=bool),
    )
    weak = ~out.significant(), ~out.significant(_TRIALS)
    needs = meaningless(friction, parameters, *weak)
    words += tuple(_needs(parameters, k, others) for k, others in needs.items())
    ends = [
        k for k in map(int, np.flatnonzero(~free)) if k not in needs and _at_limit(out, k, friction)
    ]
    words += tuple(_ends(parameters[k], float(values[k])) for k in ends)
    for k in ends:
        forget(matrix, [i for i, p in enumerate(parameters) if _same_joint(p, parameters[k])])
    idle = {k for needed in needs.items() for k in (needed[0], *needed[1])}
    return replace(out, undetermined=words, meaningless=np.isin(np.arange(D), list(idle)))


def _by_priors(H: Array, precision: Array, tolerance: Array, keep: Array) -> Array:
    """Covariance of the parameters `keep` by what priors pull them off the truth.

    The truth scatters about the means by the tolerances T, and moves the fit by H^-1 P of that:
    (H^-1 P) T^2 (H^-1 P)'. With the data's own it is the covariance of both together.
    """
    informed = np.isfinite(tolerance[keep])
    if not informed.any():
        return np.zeros((len(keep), len(keep)))
    pull = solve_scaled(H[np.ix_(keep, keep)], np.diag(precision[keep]))
    off = pull[:, informed] * tolerance[keep][informed]
    return np.asarray(off @ off.T)


def _at_limit(covariance: Covariance, k: int, friction: Friction) -> bool:
    """Whether a parameter of friction ends at a bound that is not its law's own.

    Such a bound says what the data resolve, or was given: beyond it the fit would be better. Unless
    the parameter does nothing, as the velocity of a peak that is held at zero.
    """
    parameters, p = covariance.parameters, covariance.parameters[k]
    if p.block != "friction" or covariance.values[k] in friction.law.bounds[p.place[1]]:
        return False
    ends = [i for i in np.flatnonzero(covariance.bound) if _same_joint(parameters[i], p)]
    return len(ends) > 1 or _shows(friction, parameters, k, [])


def _same_joint(a: Parameter, b: Parameter) -> bool:
    return a.block == b.block == "friction" and a.place[0] == b.place[0]


def _ends(p: Parameter, value: float) -> str:
    slow = value == p.low and p.is_velocity
    end = "the slowest speed that the data resolve, or that was given" if slow else "its bound"
    return (
        f"{p.name} ends at {value:.3g} {p.unit}, {end}: friction of this joint has another shape "
        "than this law can show here, and its parameters have no intervals"
    )


def _needs(parameters: tuple[Parameter, ...], k: int, others: tuple[int, ...]) -> str:
    named = [parameters[i].name for i in others]
    names = named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}"
    return f"{parameters[k].name} means nothing where {names} may be zero"


def _undetermined(
    H: Array, free: Array, parameters: tuple[Parameter, ...]
) -> tuple[Array, Array, tuple[str, ...]]:
    """Singular values, which parameters share in a combination without information, in words."""
    keep = np.flatnonzero(free)
    lost = np.zeros(len(parameters), dtype=bool)
    if not len(keep):
        return np.zeros(0), lost, ()
    inner = H[np.ix_(keep, keep)]
    blind = np.diag(inner) <= 0.0
    scale = np.where(blind, 1.0, np.sqrt(np.maximum(np.diag(inner), 1e-300)))
    value, vector = np.linalg.eigh(inner / np.outer(scale, scale))
    words = []
    for k in np.flatnonzero(value < SINGULAR * value.max()):
        share = vector[:, k] ** 2
        main = np.argsort(-share)[: max(1, int((share > 0.02).sum()))]
        lost[keep[share > 1e-3]] = True
        names = [parameters[keep[i]].name for i in main]
        words.append(
            f"the data do not tell {names[0]}"
            if len(names) == 1
            else f"only a combination of {', '.join(names[:-1])} and {names[-1]} shows in the data"
        )
    return value[::-1], lost, tuple(words)


def without_shared(covariance: Covariance, law: Law) -> Covariance:
    """The covariance without entries of a law beside others that the data do not tell.

    Bristles that bend less pass for their damping: no interval by slopes holds what that may be.
    """
    at = {p.place: k for k, p in enumerate(covariance.parameters) if p.block == "friction"}
    words, matrix, identified = [], covariance.matrix.copy(), covariance.identified
    for (j, i), k in () if law.is_network else at.items():
        names = [p.name for p in law.parameters]
        other = law.parameters[i].beside
        beside = at.get((j, names.index(other))) if other in names else None
        if beside is not None and not identified[beside]:
            forget(matrix, [k])
            a, b = (covariance.parameters[place].name for place in (k, beside))
            words.append(f"{a} has no interval beside {b}, which the data do not tell")
    return replace(covariance, matrix=matrix, undetermined=(*covariance.undetermined, *words))


def least_significant(
    covariance: Covariance, blocks: Sequence[ParameterBlock], level: float
) -> Dropped | None:
    """The block of sensors with the largest p-value above a level, or None.

    Its k parameters d, as deviations from an ideal sensor, have the covariance C:

        d' C^-1 d / k   is distributed as F(k, freedom)   where the sensor is ideal

    A block that the data do not determine has p = 1. Blocks with a prior stay: somebody knows them.
    """
    idle = []
    for name in (b.name for b in blocks if b.name in IDEAL):
        places = [k for k, p in enumerate(covariance.parameters) if p.block == name]
        if places and not any(np.isfinite(covariance.parameters[k].tolerance) for k in places):
            idle.append((_p_value(covariance, places, IDEAL[name]), name))
    p_value, name = max(idle, default=(0.0, ""))
    return Dropped(name, p_value) if p_value > level else None


def _p_value(covariance: Covariance, places: list[int], ideal: float) -> float:
    matrix = covariance.matrix[np.ix_(places, places)]
    if not np.isfinite(matrix).all():
        return 1.0
    off = covariance.values[places] - ideal
    size = float(off @ np.linalg.pinv(matrix, hermitian=True) @ off) / len(places)
    return float(fdtrc(len(places), covariance.freedom, size))
