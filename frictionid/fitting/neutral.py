"""Parameters of a law that the data do not tell: they stay at the law's neutral values.

A parameter is not identified where its standard error between recordings exceeds half of its usual
size, and its interval holds the neutral value; one of friction also where it is ten sizes off. It
is held there, and the others are fitted on, as long as that does not make the fit clearly worse:
the deviance counts samples as independent, and is divided by the ratio of the parameter's variance
between recordings to that by the curvature [Ribatet2012].
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.friction.provenance import Dropped

from .covariance import grouped_covariance, least_significant
from .fit import Covariance
from .gauss_newton import box_step
from .one_step.recipe import CLEAR, KNOWN
from .parameter_block import (
    IDEAL,
    Key,
    Parameter,
    ParameterBlock,
    limits_of,
)
from .parameters import FrictionBlock
from .sandwich import Groups, solve_scaled

F = TypeVar("F")
S = TypeVar("S", "tuple[Unknown, ...]", Array)
_LISTED = 3  # base parameters
_BASE = 0.2  # of the nominal value: usual deviation of a base parameter
_FAR = 10.0  # sizes from neutral, which is hardly plausible
_BLIND = 1e-13  # of the largest information
_DAMPING = 1e-8  # of unit diagonals
_ROUNDING = 1e-9  # of a size
OWN = 1e-6  # of a parameter's information that no other one shares, or it is no question


class Unknown(NamedTuple):
    """A parameter that the data do not tell: itself, its neutral value, size, excess, and off.

    The neutral value of a base parameter is the nominal one, its size a fifth of that.

    excess : its variance between recordings over that by the curvature
    off : how far it is from neutral [sizes]
    """

    parameter: Parameter
    neutral: float
    size: float
    excess: float
    off: float

    @property
    def sentence(self) -> str:
        """What was done, for people."""
        p = self.parameter
        value = f"{self.neutral:.3g} {p.unit}".removesuffix(" 1")
        return f"{p.name} is not identified by these data, and stays at {value}."

    def shown(self, rise: float) -> bool:
        """Whether the cost, in squares of the noise, is clearly higher by a rise after holding it.

        The farther from neutral it is, in units of its size, the more it takes to believe it.
        """
        return rise > (CLEAR + self.off**2) * self.excess


def sentences_of(held: Sequence[Unknown]) -> tuple[str, ...]:
    """What was done with parameters that the data do not tell: of many base parameters in one."""
    base = [u.parameter.name for u in held if u.parameter.block == "inertia"]
    if len(base) <= _LISTED:
        return tuple(u.sentence for u in held)
    names = f"{', '.join(base[:_LISTED])} and {len(base) - _LISTED} more"
    others = (u.sentence for u in held if u.parameter.block != "inertia")
    return (*others, f"{names} are not identified by these data, and stay as they were.")


def parts_of(several: S) -> Iterator[S]:
    """All of them together, or else the first half, and so on down to the first."""
    count = len(several)
    while count:
        yield several[:count]
        count //= 2


def at_neutral(
    blocks: Sequence[ParameterBlock], friction: Friction, unknown: Sequence[Unknown]
) -> tuple[tuple[ParameterBlock, ...], Friction]:
    """The blocks without parameters that are held, and friction (n, P) with these at neutral."""
    theta = np.asarray(friction.theta, dtype=float).copy()
    held = [u for u in unknown if u.parameter.block == "friction"]
    for u in held:
        for place in u.parameter.places:
            theta[place] = u.neutral
    places = {place for u in held for place in u.parameter.places}
    names = tuple(u.parameter.name for u in unknown if u.parameter.block != "friction")
    new = []
    for block in blocks:
        if isinstance(block, FrictionBlock):
            block = _without(block, theta, places) if places else block
        elif block.enters == "base":
            block = replace(block, fixed=(*block.fixed, *names))
        new.append(block)
    return tuple(new), replace(friction, theta=theta)


def _without(block: FrictionBlock, theta: Array, places: set[tuple[int, ...]]) -> FrictionBlock:
    free = block.support
    if free is None:
        free = tuple((int(j), int(i)) for j, i in np.ndindex(*theta.shape))
    return replace(block, support=tuple(place for place in free if place not in places))


Idle = tuple[tuple[Unknown, ...], tuple[Dropped, ...]]


def followed(friction: Friction, held: Sequence[Unknown]) -> tuple[Unknown, ...]:
    """Held parameters with what is neutral beside the others of a friction now."""
    if friction.constraints is None:
        return tuple(held)
    neutral = friction.law.neutral(np.asarray(friction.theta), friction.constraints.neutral)
    return tuple(
        u._replace(neutral=float(neutral[u.parameter.place]))
        if u.parameter.block == "friction"
        else u
        for u in held
    )


class LocalCost(NamedTuple):
    """A fit's cost about its end, a quadratic in the parameters (D,): what holding some would do.

    parameters, values (D,) at its minimum, groups of rows; friction (n, P) there, and the blocks
    rise : of the cost by what is held, in squares of the noise
    """

    parameters: tuple[Parameter, ...]
    values: Array
    groups: Groups
    friction: Friction
    blocks: tuple[ParameterBlock, ...]
    rise: float = 0.0

    @property
    def covariance(self) -> Covariance:
        """Covariance of the parameters between recordings."""
        return grouped_covariance(self.parameters, self.values, self.friction, self.groups)

    def unknown(self, tried: Sequence[Key]) -> tuple[Unknown, ...]:
        """All not tried that can be held before the fit is clearly worse, one after the other."""
        cost, held = self, list[Unknown]()
        while unknown := cost._least_known(tried):
            after = cost._at_neutral(unknown)
            if held and any(u.shown(after.rise) for u in (*held, unknown)):
                break
            cost = after
            held.append(unknown)
        return followed(cost.friction, held)

    def _least_known(self, tried: Sequence[Key]) -> Unknown | None:
        """The parameter that the data tell least, None if they tell all.

        Base parameters only where they are offered: asked for, they are free. Without those that
        were tried before.
        """
        if not self.parameters or self.friction.constraints is None:
            return None
        covariance, curvature = self.covariance, self.groups.H.sum(axis=0)
        information = np.diag(curvature)
        blind = information <= _BLIND * information.max(initial=0.0)
        variance = np.diag(solve_scaled(curvature, np.eye(len(curvature))))
        ratio = np.diag(covariance.matrix) / np.maximum(variance, 1e-300)
        usual = float(np.median(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else 1.0
        worst: tuple[float, Unknown] | None = None
        for k, (neutral, size) in self._neutral_values().items():
            p = self.parameters[k]
            if p.key in tried or (covariance.bound[k] and not blind[k]):
                continue
            error, off = float(covariance.error[k]), abs(float(self.values[k]) - neutral)
            plausible = p.block != "friction" or off <= _FAR * size
            if off == 0.0 or (plausible and error <= max(KNOWN * size, off / 2.0)):
                continue
            excess = max(float(ratio[k]) if np.isfinite(ratio[k]) else usual, 1.0)
            if worst is None or error / size > worst[0]:
                worst = error / size, Unknown(p, neutral, size, excess, off / size)
        return None if worst is None else worst[1]

    def _neutral_values(self) -> dict[int, tuple[float, float]]:
        """Neutral value and size of the parameters that have them, by their place among D."""
        out, limits, parameters = {}, self.friction.constraints, self.parameters
        assert limits is not None
        law, theta = self.friction.law, np.asarray(self.friction.theta)
        neutral = law.neutral(theta, limits.neutral)
        free = {place for p in parameters if p.block == "friction" for place in p.places}
        for k, p in enumerate(parameters):
            if p.block != "friction" or not np.isfinite(p.size):
                continue
            like = law.parameters[p.place[1]].like
            # what others follow does not follow them
            if like not in law.names or (p.place[0], law.names.index(like)) in free:
                out[k] = float(neutral[p.place]), p.size
        for block in (b for b in self.blocks if b.enters == "base" and b.offered):
            places = [k for k, p in enumerate(parameters) if p.block == block.name]
            base = [parameters[k] for k in places]
            for k, p, size in zip(places, base, block.sizes(base), strict=True):
                if not np.isfinite(p.tolerance) and size > 0:
                    out[k] = p.value, _BASE * size
        return out

    def idle(self, tried: Sequence[Key], level: float) -> Idle:
        """All that would be held and dropped, one after the other, each time at the new minimum.

        level : of significance of blocks, 1 to drop none; tried : parameters that are not held
        """
        cost, held, dropped = self, list[Unknown](), list[Dropped]()
        while cost.parameters:
            unknown = cost._least_known(tried)
            block = None if unknown else least_significant(cost.covariance, cost.blocks, level)
            if block is not None:
                dropped.append(block)
                cost = cost._without_block(block.block)
            elif unknown:
                held.append(unknown)
                cost = cost._at_neutral(unknown)
            else:
                break
        return followed(cost.friction, held), tuple(dropped)

    def _at_neutral(self, unknown: Unknown) -> "LocalCost":
        keys = [p.key for p in self.parameters]
        rest = self.holding({keys.index(unknown.parameter.key): unknown.neutral})
        blocks, friction = at_neutral(self.blocks, rest.friction, (unknown,))
        return rest._replace(blocks=blocks, friction=friction)

    def _without_block(self, name: str) -> "LocalCost":
        places = [k for k, p in enumerate(self.parameters) if p.block == name]
        rest = self.holding(dict.fromkeys(places, IDEAL[name]))
        return rest._replace(blocks=tuple(b for b in self.blocks if b.name != name))

    def holding(self, held: Mapping[int, float]) -> "LocalCost":
        """The cost of the other parameters where some are held, at its minimum within bounds."""
        groups, at = self.groups, np.array(list(held), dtype=int)
        keep, limits = np.setdiff1d(np.arange(len(self.values)), at), limits_of(self.parameters)
        step = self._step(held, at, keep)
        values, move = self.values + step, groups.move + step
        g = groups.g - groups.H[:, :, at] @ move[at]
        rise = step @ groups.H.sum(axis=0) @ step - 2.0 * groups.score.sum(axis=0) @ step
        free = (values > limits.low + 1e-12) & (values < limits.high - 1e-12)
        H = groups.H[:, keep[:, None], keep]
        theta = np.asarray(self.friction.theta, dtype=float).copy()
        for p, value in zip(self.parameters, values, strict=True):
            for place in p.places if p.block == "friction" else ():
                theta[place] = value
        return self._replace(
            parameters=tuple(self.parameters[k] for k in keep),
            values=values[keep],
            groups=groups._replace(H=H, g=g[:, keep], move=move[keep], free=free[keep]),
            friction=replace(self.friction, theta=theta),
            rise=self.rise + float(rise),
        )

    def _step(self, held: Mapping[int, float], at: Array, keep: Array) -> Array:
        """Step (D,) to the minimum where parameters `at` some places are held, others `keep` free.

        What a fit that has not settled would gain by itself does not count.
        """
        groups, limits, step = self.groups, limits_of(self.parameters), np.zeros(len(self.values))
        H = groups.H.sum(axis=0) + np.diag(limits.precision)
        step[at] = np.array(list(held.values())) - self.values[at]
        pull = groups.score.sum(axis=0) + limits.precision * (limits.mean - self.values)
        descent = np.where(groups.free, 0.0, pull) - H @ step
        low, high = limits.low - self.values, limits.high - self.values
        descent, low, high = (x[keep][None] for x in (descent, low, high))
        step[keep] = box_step(H[np.ix_(keep, keep)][None], descent, low, high, _DAMPING)[0]
        return step


def holding_unknown(
    fit: F,
    cost: Callable[[F], LocalCost],
    holding: Callable[[F, tuple[Unknown, ...]], F | None],
    tried: tuple[Key, ...] = (),
) -> tuple[F, tuple[Key, ...]]:
    """The fit with parameters held that the data do not tell, and all parameters that were tried.

    As many as go together: what two of them tell together, one tells alone.

    cost : of a fit about its end; holding : a fit with some held, None where it is clearly worse
    """
    while unknown := cost(fit).unknown(tried):
        for several in parts_of(unknown):
            without = holding(fit, several)
            if without is not None:
                fit = without
                break
        tried = (*tried, *(u.parameter.key for u in several))
    return fit, tried


def freed(blocks: Sequence[ParameterBlock], held: Sequence[Unknown]) -> tuple[ParameterBlock, ...]:
    """The blocks with parameters free again that are held."""
    friction = [u.parameter for u in held if u.parameter.block == "friction"]
    places = tuple((j, i) for p in friction for j, i in p.places)
    names = {u.parameter.name for u in held if u.parameter.block != "friction"}
    new = []
    for block in blocks:
        if isinstance(block, FrictionBlock) and block.support is not None:
            block = replace(block, support=(*block.support, *places))
        elif block.enters == "base":
            block = replace(block, fixed=tuple(name for name in block.fixed if name not in names))
        new.append(block)
    return tuple(new)


def at_neutral_bound(covariance: Covariance, friction: Friction) -> list[int]:
    """Places among D of the parameters of friction that ended at a bound, which is neutral."""
    if friction.constraints is None:
        return []
    neutral = friction.law.neutral(np.asarray(friction.theta), friction.constraints.neutral)
    return [
        int(k)
        for k in np.flatnonzero(covariance.bound)
        if (p := covariance.parameters[k]).block == "friction"
        and abs(covariance.values[k] - neutral[p.place]) <= _ROUNDING * p.size < np.inf
    ]


def with_held(
    covariance: Covariance,
    held: Sequence[Unknown],
    pinned: Sequence[int],
    parameters: Sequence[Parameter],
    H: Array,
) -> Covariance:
    """The covariance with parameters at their neutral values, as uncertain as their sizes say.

    The free ones f make up for what those h are off that are held, or `pinned` to a neutral bound;
    and for sensors that were left out as they showed nothing, the `parameters` that are in neither,
    whose sizes are infinite: intervals are not narrower than those beside them.
    With sizes s and the normal matrix H (E, E) of all `parameters`, whose information on h counts
    e times less: by the excess of h, or by the usual one of the covariance over H_ff^-1 if larger.

        A = -H_ff^-1 H_fh,    V = (diag(1/s^2) + e^-1/2 (H_hh + H_hf A) e^-1/2)^-1
        cov(h) = V,    cov(f, h) = A V,    cov(f) grows by A V A'
    """
    H = np.where(np.isfinite(H), H, 0.0)  # a neutral memory may be too fast to be linearised
    keys, count = [p.key for p in parameters], len(held)
    at = [keys.index(p.key) for p in covariance.parameters]
    finite = np.flatnonzero(np.isfinite(covariance.error))
    f, h = [at[k] for k in finite], [keys.index(u.parameter.key) for u in held]
    inverse = solve_scaled(H[np.ix_(f, f)], np.eye(len(f)))
    # what others account for all of, the data do not tell: it is ideal
    tells = np.diag(H - H[:, f] @ inverse @ H[f]) > OWN * np.diag(H)
    sensors = [k for k in range(len(keys)) if k not in {*at, *h} and tells[k]]
    h += [*(at[k] for k in pinned), *sensors]
    size = [*(u.size for u in held), *(covariance.parameters[k].size for k in pinned)]
    size += [np.inf for _ in sensors]
    ratio = covariance.error[finite] ** 2 / np.maximum(np.diag(inverse), 1e-300)
    A = np.zeros((len(at), len(h)))
    A[finite] = -inverse @ H[np.ix_(f, h)]
    excess = max(1.0, float(np.median(ratio))) if len(f) else 1.0
    root = np.sqrt([*(max(u.excess, excess) for u in held), *(excess for _ in h[count:])])
    information = (H[np.ix_(h, h)] + H[np.ix_(h, f)] @ A[finite]) / np.outer(root, root)
    V = np.linalg.inv(np.diag(np.array(size) ** -2.0) + information)
    joint = (A @ V)[:, :count]
    matrix = np.block([[covariance.matrix + A @ V @ A.T, joint], [joint.T, V[:count, :count]]])
    no, yes = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    return replace(
        covariance,
        parameters=(
            *covariance.parameters,
            *(u.parameter._replace(value=u.neutral, tolerance=0.0) for u in held),
        ),
        values=np.append(covariance.values, [u.neutral for u in held]),
        matrix=matrix,
        bound=np.append(covariance.bound, no),
        meaningless=np.append(covariance.meaningless, yes),
    )
