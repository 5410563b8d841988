"""Friction as a sum of candidate functions: the law of sparse identification, linear in theta.

Tf = sum_i theta_i f_i(w, q, load),   theta_i = 0 for all candidates that friction does not have

after SINDy [Brunton2016]. Every candidate opposes the motion where its coefficient is positive, but
for ripple and `offset` (which make a level differ by angle and direction) and for `other`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, LawParameter, Memory, units_of

from ..law import smooth_sign
from .levels import above_zero, on_side, stribeck_factor


def written_sums(
    head: str, theta: Array, half: Array | None, terms: Sequence[Sequence[str]]
) -> list[str]:
    """A line for each joint: a head with its number, and the `written_sum` of its terms."""
    rows = np.asarray(theta)
    halves = [None] * len(rows) if half is None else half
    lines = (written_sum(*line) for line in zip(rows, halves, terms, strict=True))
    return [head.format(j) + line for j, line in enumerate(lines, start=1)]


def written_sum(coefficients: Array, half: Array | None, terms: Sequence[str]) -> str:
    """Text of the sum of coefficients (P,) times terms, but for those that are zero.

    half : (P,), half widths of intervals, written behind those coefficients where they are finite

    >>> written_sum(np.array([-2.0, 0.0, 0.5]), np.array([0.1, 0.1, np.nan]), ["w", "w^2", ""])
    '-(2 +- 0.1) w + 0.5'
    """
    half = np.full(len(terms), np.nan) if half is None else half
    parts = [
        ("-" if value < 0 else "+", f"{_number(abs(value), wide)} {term}".rstrip())
        for value, wide, term in zip(coefficients, half, terms, strict=True)
        if value != 0
    ]
    text = " ".join(f"{sign} {part}" for sign, part in parts) or "+ 0"
    return text.removeprefix("+ ") if text[0] == "+" else f"-{text[2:]}"


def _number(value: float, half: float) -> str:
    return f"({value:.4g} +- {half:.2g})" if np.isfinite(half) else f"{value:.4g}"


_FALLEN = 1.5  # times its velocity: there a tenth of a peak is left


class Candidate(NamedTuple):
    """A function of one joint's inputs.

    `formula` is how equations write it. `level` is what it adds to the level at rest, for motion in
    the direction of x.w; None where that is nothing. It shows at speeds of `fast` [rad/s] and more.
    """

    parameter: LawParameter
    family: str
    formula: str
    value: Callable[[Inputs], Array]
    level: Callable[[Inputs], Array] | None = None
    fast: float = 0.0


@dataclass(frozen=True)
class Library(Law):
    """Sum of candidates: signs, powers of w, Stribeck peaks; on request ripple, load and others.

    width, shape : of the sharpest smooth sign s(w) [rad/s], by which peaks are multiplied too
    widths : of more smooth signs [rad/s]
    powers : k of the candidates w |w|^(k - 1)
    velocities : ws of the candidates exp(-(w/ws)^2) s(w) [rad/s]
    harmonics : k of the candidates cos(k gear q) s(w) and sin(k gear q) s(w)
    gear : turns of what makes the ripple for one of the joint
    load : whether the bearing load times s(w) is a candidate
    direction : whether levels, peaks and w may differ with the direction (`offset`)
    other : whether the sum of the other joints' velocities is a candidate

    Coefficients of zero are out; shooting leaves them so.

    Examples
    --------
    >>> law = Library(powers=(1, 3), velocities=(2.0,), widths=())
    >>> law.names
    ('coulomb', 'viscous', 'cubic', 'peak_2')
    >>> print("; ".join(law.equation(np.array([[0.1, 0.02, 0.0, 0.03]]))))
    Tf1 = 0.1 N m s(w) + 0.02 N m s/rad w + 0.03 N m exp(-(w/2)^2) s(w)
    """

    width: float = 0.02
    shape: str = "tanh"
    widths: tuple[Positive, ...] = (0.3, 1.0)
    powers: tuple[Count, ...] = (1, 2, 3)
    velocities: tuple[Positive, ...] = (0.3, 0.45, 0.7, 1.0, 1.5, 2.3, 3.4, 5.0, 7.5, 11.0)
    harmonics: tuple[Count, ...] = ()
    gear: Positive = 1.0
    load: bool = False
    direction: bool = False
    other: bool = False
    is_sparse = True

    def __post_init__(self) -> None:
        super().__post_init__()
        _check(self)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All functions, in the order of theta."""
        return _candidates(self)

    @property
    def conflicts(self) -> Array:
        """Pairs (P, P) of candidates that exclude each other.

        Friction has one member of a family (signs, peaks), and no candidate with a level at rest
        beside a sign that goes through zero, as all but the sharpest do.
        """
        kind = np.array([c.family for c in self.candidates])
        soft = np.array([c.family == "sign" and c.level is None for c in self.candidates])
        firm = np.array([c.level is not None for c in self.candidates])
        both = soft[:, None] & firm
        return (kind[:, None] == kind) | both | both.T

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        return tuple(c.parameter for c in self.candidates)

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        return self.load

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        zero = 0.0 * (theta[..., 0] + x.w)
        return sum((theta[..., i] * c.value(x) for i, c in _active(self, theta)), start=zero)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        zero = 0.0 * (theta[..., 0] + x.w)
        columns = [c.value(x) + zero for c in self.candidates]
        return namespace(theta, x.w).stack(columns, axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        zero = 0.0 * (theta[..., 0] + x.w)
        active = ((i, c.level) for i, c in _active(self, theta) if c.level is not None)
        level = sum((theta[..., i] * at_rest(x) for i, at_rest in active), start=zero)
        return above_zero(level)

    def equation(
        self, theta: Array, half: Array | None = None, position_units: Sequence[str] = ()
    ) -> list[str]:
        formulas = [candidate.formula for candidate in self.candidates]
        positions = position_units or ("rad",) * len(theta)
        each = (units_of(self, position) for position in positions)
        terms = [[" ".join(pair) for pair in zip(u, formulas, strict=True)] for u in each]
        return written_sums("Tf{} = ", theta, half, terms)


@lru_cache(maxsize=64)  # each step of a rollout asks for them
def _candidates(law: Library) -> tuple[Candidate, ...]:
    return (
        *_signs(law),
        *_powers(law),
        *_peaks(law),
        *_ripples(law),
        *_loads(law),
        *_offsets(law),
        *_others(law),
    )


def _active(law: Library, theta: Array) -> list[tuple[int, Candidate]]:
    """Candidates that some entry of the batch has: the others cost nothing."""
    return [(i, c) for i, c in enumerate(law.candidates) if _any_active(theta[..., i])]


def _any_active(values: Array) -> bool:
    """Whether some value is not zero, or is not known yet: where a program is written."""
    try:
        return bool((values != 0).any())
    except NotImplementedError:
        return True


def _free(name: str, unit: str) -> LawParameter:
    return LawParameter(name, unit, -math.inf)


def _signs(law: Library) -> list[Candidate]:
    def sign(width: float, name: str, formula: str) -> Candidate:
        # only the sharpest is a level at rest, the others pass through zero
        level = _unity if name == "coulomb" else None

        def value(x: Inputs) -> Array:
            return smooth_sign(x.w, width, law.shape)

        return Candidate(LawParameter(name, "N m"), "sign", formula, value, level)

    wider = [sign(w, f"sign_{w:g}", f"s(w; {w:g})") for w in law.widths]
    return [sign(law.width, "coulomb", "s(w)"), *wider]


def _unity(x: Inputs) -> Array:
    return 1.0 + 0.0 * x.w


_POWERS = {1: "viscous", 2: "drag", 3: "cubic"}


def _powers(law: Library) -> list[Candidate]:
    def power(k: int) -> Candidate:
        def value(x: Inputs) -> Array:
            return x.w * namespace(x.w).abs(x.w) ** (k - 1)

        exponent = "" if k == 1 else f"^{k}"
        name = _POWERS.get(k, f"power_{k}")
        parameter = LawParameter(name, f"N m s{exponent}/rad{exponent}")
        formula = {1: "w", 2: "w |w|"}.get(k, f"w^{k}" if k % 2 else f"w |w|^{k - 1}")
        return Candidate(parameter, name, formula, value)

    return [power(k) for k in law.powers]


def _rubbing(
    law: Library,
    parameter: LawParameter,
    family: str,
    factor: str,
    level: Callable[[Inputs], Array],
) -> Candidate:
    """A candidate level(x) s(w)."""

    def value(x: Inputs) -> Array:
        return level(x) * smooth_sign(x.w, law.width, law.shape)

    return Candidate(parameter, family, f"{factor} s(w)", value, level)


def _peaks(law: Library) -> list[Candidate]:
    def peak(ws: float) -> Candidate:
        def left(x: Inputs) -> Array:
            return stribeck_factor(x.w, ws)

        parameter, factor = LawParameter(f"peak_{ws:g}", "N m"), f"exp(-(w/{ws:g})^2)"
        falling = _rubbing(law, parameter, "peak", factor, left)
        return falling._replace(level=_unity, fast=_FALLEN * ws)

    return [peak(ws) for ws in law.velocities]


def _ripples(law: Library) -> list[Candidate]:
    def ripple(k: int, wave: str) -> Candidate:
        def level(x: Inputs) -> Array:
            return getattr(namespace(x.q), wave)(k * law.gear * x.q)

        name, factor = f"{wave}_{k}", f"{wave}({k * law.gear:g} q)"
        return _rubbing(law, _free(name, "N m"), name, factor, level)

    return [ripple(k, wave) for k in law.harmonics for wave in ("cos", "sin")]


def _loads(law: Library) -> list[Candidate]:
    parameter = LawParameter("load", "N m/N")
    candidate = _rubbing(law, parameter, "load", "load", lambda x: 1.0 * x.load)
    return [candidate] if law.load else []


def _offsets(law: Library) -> list[Candidate]:
    """The even twin of each level, of each peak and of w: what both directions differ by."""

    def direction(x: Inputs) -> Array:
        return on_side(x.w, _unity(x), -_unity(x))

    def even(twin: Candidate) -> Candidate:
        return Candidate(
            _free(f"offset_{twin.parameter.name}", twin.parameter.unit),
            f"offset_{twin.family}",
            f"sgn(w) {twin.formula}",
            lambda x: direction(x) * twin.value(x),
            None if twin.level is None else direction,
            twin.fast,
        )

    viscous = [c for c in _powers(law) if c.family == "viscous"]
    twins = [_signs(law)[0], *viscous, *_peaks(law)]
    return [even(twin) for twin in twins] if law.direction else []


def _others(law: Library) -> list[Candidate]:
    def value(x: Inputs) -> Array:
        return namespace(x.w).sum(x.w, axis=-1, keepdims=True) - x.w

    candidate = Candidate(_free("other", "N m s/rad"), "other", "w of the others", value)
    return [candidate] if law.other else []


def _check(law: Library) -> None:
    """Refuse candidates that stand there twice."""
    for name in ("widths", "powers", "velocities", "harmonics"):
        values = getattr(law, name)
        if len({f"{value:g}" for value in values}) < len(values):
            raise InputError(f"Library: {name} = {list(values)} must differ")
    if law.width in law.widths:
        raise InputError(f"Library: widths = {list(law.widths)} repeat width = {law.width}")
