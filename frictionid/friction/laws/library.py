"""Friction as a sum of candidate functions: the law of sparse identification, linear in theta.

Tf = sum_i theta_i f_i(w, q, load),   theta_i = 0 for all candidates that friction does not have

after SINDy [Brunton2016]. Every candidate opposes the motion where its coefficient is positive, but
for ripple and `offset` (which make a level differ by angle and direction) and for `other`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, Memory, units_of
from frictionid.friction.laws.levels import LEVEL, above_zero, on_side, stribeck_factor
from frictionid.friction.smooth_sign import smooth_sign


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


_FREE = (-math.inf, math.inf)
_FALLEN = 1.5  # times its velocity: there a tenth of a peak is left


class Candidate(NamedTuple):
    """A function of one joint's inputs.

    `formula` is how equations write it. `level` is what it adds to the level at rest, for motion in
    the direction of x.w; None where that is nothing. It shows at speeds of `fast` [rad/s] and more.
    """

    name: str
    unit: str
    family: str
    formula: str
    bounds: tuple[float, float]
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
    ('sign', 'viscous', 'cubic', 'peak_2')
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
    is_linear = True
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
    def names(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.candidates)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(c.unit for c in self.candidates)

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return tuple(c.bounds for c in self.candidates)

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
        rows = np.asarray(theta)
        halves = [None] * len(rows) if half is None else half
        units = position_units or ("rad",) * len(rows)
        sums = [
            written_sum(row, own, self._terms(unit))
            for row, own, unit in zip(rows, halves, units, strict=True)
        ]
        return [f"Tf{j} = {text}" for j, text in enumerate(sums, start=1)]

    def _terms(self, position_unit: str) -> list[str]:
        units = units_of(self, position_unit)
        return [f"{unit} {c.formula}" for unit, c in zip(units, self.candidates, strict=True)]


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
    return [(i, c) for i, c in enumerate(law.candidates) if _some(theta[..., i])]


def _some(values: Array) -> bool:
    """Whether some value is not zero, or is not known yet: where a program is written."""
    try:
        return bool((values != 0).any())
    except NotImplementedError:
        return True


def _signs(law: Library) -> list[Candidate]:
    def one(width: float, name: str, formula: str) -> Candidate:
        def value(x: Inputs) -> Array:
            return smooth_sign(x.w, width, law.shape)

        # only the sharpest is a level at rest, the others pass through zero
        level = _one if name == "sign" else None
        return Candidate(name, "N m", "sign", formula, LEVEL, value, level)

    more = [one(w, f"sign_{w:g}", f"s(w; {w:g})") for w in law.widths]
    return [one(law.width, "sign", "s(w)"), *more]


def _one(x: Inputs) -> Array:
    return 1.0 + 0.0 * x.w


_POWERS = {1: "viscous", 2: "drag", 3: "cubic"}


def _powers(law: Library) -> list[Candidate]:
    def one(k: int) -> Candidate:
        def value(x: Inputs) -> Array:
            return x.w * namespace(x.w).abs(x.w) ** (k - 1)

        power = "" if k == 1 else f"^{k}"
        unit = f"N m s{power}/rad{power}"
        name = _POWERS.get(k, f"power_{k}")
        formula = {1: "w", 2: "w |w|"}.get(k, f"w^{k}" if k % 2 else f"w |w|^{k - 1}")
        return Candidate(name, unit, name, formula, LEVEL, value)

    return [one(k) for k in law.powers]


def _peaks(law: Library) -> list[Candidate]:
    def one(ws: float) -> Candidate:
        def value(x: Inputs) -> Array:
            return stribeck_factor(x.w, ws) * smooth_sign(x.w, law.width, law.shape)

        formula = f"exp(-(w/{ws:g})^2) s(w)"
        name = f"peak_{ws:g}"
        return Candidate(name, "N m", "peak", formula, LEVEL, value, _one, _FALLEN * ws)

    return [one(ws) for ws in law.velocities]


def _ripples(law: Library) -> list[Candidate]:
    def one(k: int, wave: str) -> Candidate:
        def level(x: Inputs) -> Array:
            return getattr(namespace(x.q), wave)(k * law.gear * x.q)

        def value(x: Inputs) -> Array:
            return level(x) * smooth_sign(x.w, law.width, law.shape)

        formula = f"{wave}({k * law.gear:g} q) s(w)"
        return Candidate(f"{wave}_{k}", "N m", f"{wave}_{k}", formula, _FREE, value, level)

    return [one(k, wave) for k in law.harmonics for wave in ("cos", "sin")]


def _loads(law: Library) -> list[Candidate]:
    def level(x: Inputs) -> Array:
        return 1.0 * x.load

    def value(x: Inputs) -> Array:
        return x.load * smooth_sign(x.w, law.width, law.shape)

    candidate = Candidate("load", "N m/N", "load", "load s(w)", LEVEL, value, level)
    return [candidate] if law.load else []


def _offsets(law: Library) -> list[Candidate]:
    """The even twin of each level, of each peak and of w: what both directions differ by."""

    def direction(x: Inputs) -> Array:
        return on_side(x.w, _one(x), -_one(x))

    def one(twin: Candidate) -> Candidate:
        def value(x: Inputs) -> Array:
            return direction(x) * twin.value(x)

        formula = f"sgn(w) {twin.formula}"
        level = None if twin.level is None else direction
        name, family = f"offset_{twin.name}", f"offset_{twin.family}"
        return Candidate(name, twin.unit, family, formula, _FREE, value, level, twin.fast)

    twins = [_signs(law)[0], *(c for c in _powers(law) if c.name == "viscous"), *_peaks(law)]
    return [one(twin) for twin in twins] if law.direction else []


def _others(law: Library) -> list[Candidate]:
    def value(x: Inputs) -> Array:
        return namespace(x.w).sum(x.w, axis=-1, keepdims=True) - x.w

    candidate = Candidate("other", "N m s/rad", "other", "w of the others", _FREE, value)
    return [candidate] if law.other else []


def _check(law: Library) -> None:
    """Refuse candidates that stand there twice."""
    for name in ("widths", "powers", "velocities", "harmonics"):
        values = getattr(law, name)
        if len({f"{value:g}" for value in values}) < len(values):
            raise InputError(f"Library: {name} = {list(values)} must differ")
    if law.width in law.widths:
        raise InputError(f"Library: widths = {list(law.widths)} repeat width = {law.width}")
