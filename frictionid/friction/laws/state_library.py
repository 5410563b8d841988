"""Acceleration as a sum of monomials of all that is measured: sparse dynamics without physics.

Tf_j = -sum_i theta_ji f_i(q, w, u of all joints)

after SINDy with inputs [Brunton2016]. The variables of each joint are sin q and cos q (q itself
where it slides), w, a smooth sign of w, and u, in which the sum is linear, as machines are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.config import Count
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import Range
from frictionid.friction.laws.library import written_sum
from frictionid.friction.laws.network_law import Scale
from frictionid.friction.smooth_sign import smooth_sign

_FREE = (-math.inf, math.inf)
_LARGEST = 2000


class Variable(NamedTuple):
    """A variable of a joint (from 0): what it is, its unit, and whether it only comes once."""

    what: str
    joint: int
    unit: str
    once: bool

    @property
    def name(self) -> str:
        return f"{self.what}{self.joint + 1}"


@dataclass(frozen=True)
class StateLibrary(Law):
    """All monomials up to a degree; of sin^2 + cos^2 = 1 and s^2 = 1 one side only.

    joints : whose state it knows; others count as none, missing ones as zero
    degree : of the monomials, at most
    turning : whether the joints turn, or slide
    width : of the smooth sign s(w) [rad/s]

    Examples
    --------
    >>> law = StateLibrary(joints=1, degree=1)
    >>> law.names
    ('1', 'sin1', 'cos1', 'w1', 's1', 'u1')
    >>> print(*law.equation(np.array([[0.0, -20.0, 0.0, -0.5, 0.0, 8.0]])))
    dw1/dt = -20 sin1 - 0.5 w1 + 8 u1
    """

    joints: Count = 2
    degree: Count = 3
    turning: bool = True
    width: float = 0.1
    shape = ""  # of an input, not of friction
    is_linear = True
    is_sparse = True

    def __post_init__(self) -> None:
        super().__post_init__()
        size = math.comb(len(_variables(self)) + self.degree, self.degree)
        if size > 10 * _LARGEST or len(_monomials(self)) > _LARGEST:
            raise InputError(
                f"state_library: degree = {self.degree} of {self.joints} joints has more than "
                f"{_LARGEST} candidates: lower it"
            )

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(_name(self, m) for m in _monomials(self))

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(_unit(self, m) for m in _monomials(self))

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (_FREE,) * len(_monomials(self))

    def features(self, x: Inputs) -> Array:
        """Values (..., P) of all monomials, the same for every joint."""
        xp, values = namespace(x.w), _values(self, x)
        columns = [1.0 + 0.0 * values[0]]
        for parent, last in _chain(self)[1:]:
            columns.append(columns[parent] * values[last])
        return xp.stack(columns, axis=-1)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        xp, f = namespace(theta, x.w), self.features(x)
        if theta.ndim > 2 and theta.shape[-3] == 1 and f.ndim > 1:  # one theta for many points
            return -xp.matmul(f, xp.swapaxes(theta[..., 0, :, :], -1, -2))
        return -xp.matmul(theta, f[..., None])[..., 0]

    def gradient(self, theta: Array, x: Inputs) -> Array:
        f = self.features(x)
        return -(f[..., None, :] + 0.0 * (theta[..., :1] + x.w[..., None]))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)

    def equation(
        self, theta: Array, half: Array | None = None, position_units: Sequence[str] = ()
    ) -> list[str]:
        """One line for each joint: its acceleration in SI units."""
        terms = ["" if name == "1" else name for name in self.names]
        rows = np.asarray(theta)
        halves = [None] * len(rows) if half is None else half
        sums = [written_sum(row, own, terms) for row, own in zip(rows, halves, strict=True)]
        return [f"dw{j}/dt = {text}" for j, text in enumerate(sums, start=1)]


@lru_cache(maxsize=16)
def _variables(law: StateLibrary) -> tuple[Variable, ...]:
    found = []
    for j in range(law.joints):
        place = [("sin", "", False), ("cos", "", True)] if law.turning else [("q", "/rad", False)]
        rest = [("w", "s/rad", False), ("s", "", True), ("u", "/(N m)", True)]
        found += [Variable(what, j, unit, once) for what, unit, once in (*place, *rest)]
    return tuple(found)


@lru_cache(maxsize=16)
def _monomials(law: StateLibrary) -> tuple[tuple[int, ...], ...]:
    """Variables of each monomial, in rising order; none for the constant."""
    v = _variables(law)

    def allowed(m: tuple[int, ...]) -> bool:
        once = all(m.count(i) == 1 for i in m if v[i].once)
        return once and sum(v[i].what == "u" for i in m) < 2

    degrees = range(law.degree + 1)
    every = (m for d in degrees for m in combinations_with_replacement(range(len(v)), d))
    return tuple(m for m in every if allowed(m))


@lru_cache(maxsize=16)
def _chain(law: StateLibrary) -> tuple[tuple[int, int], ...]:
    """Of each monomial the one that lacks its last variable, and that variable."""
    place = {m: i for i, m in enumerate(_monomials(law))}
    return tuple((place[m[:-1]], m[-1]) if m else (0, 0) for m in place)


def _values(law: StateLibrary, x: Inputs) -> list[Array]:
    """Values (...) of the variables; zero for joints that there are not."""
    xp, n = namespace(x.w), x.w.shape[-1]
    zero: Any = 0.0 * sum(part[..., 0] for part in (x.q, x.w, x.u))
    out: list[Array] = []
    for v in _variables(law):
        if v.joint >= n:
            out.append(zero)
            continue
        q, w, u = (part[..., v.joint] for part in (x.q, x.w, x.u))
        known: dict[str, Any] = {"q": q, "w": w, "u": u}
        if v.what in ("sin", "cos"):
            known[v.what] = getattr(xp, v.what)(q)
        elif v.what == "s":
            known["s"] = smooth_sign(w, law.width, "tanh")
        out.append(known[v.what] + zero)
    return out


def _name(law: StateLibrary, m: tuple[int, ...]) -> str:
    v = _variables(law)
    powers = [(v[i].name, m.count(i)) for i in dict.fromkeys(m)]
    return "*".join(name if k == 1 else f"{name}^{k}" for name, k in powers) or "1"


def _unit(law: StateLibrary, m: tuple[int, ...]) -> str:
    v = _variables(law)
    return " ".join(["rad/s^2", *(v[i].unit for i in m if v[i].unit)])


_ABOVE: Range = (1e-9, float("inf"))
SCALES = (
    Scale("acceleration", "rad/s^2", _ABOVE, 10.0),
    Scale("speed", "rad/s", _ABOVE, 5.0),
    Scale("torque", "N m", _ABOVE, 1.0),
)


def width_of(joints: int, turning: bool) -> int:
    """Number of features.

    >>> width_of(2, True), width_of(1, False)
    (10, 4)
    """
    return joints * (4 + turning)


def state_features(theta: Array, x: Inputs, joints: int, turning: bool, width: float) -> Array:
    """Features (..., n, a), alike for all n joints: place, w, its smooth sign, and u of each.

    Place is sin q and cos q, or q where the joints slide. Joints beyond `joints` are left out,
    those that there are not are zero.
    """
    xp, n = namespace(theta, x.w), x.w.shape[-1]
    speed, torque = theta[..., 1], theta[..., 2]
    zero = 0.0 * (x.w + x.q + x.u + speed)
    out = []
    for j in range(joints):
        if j >= n:
            out += [zero] * (4 + turning)
            continue
        q, w, u = (part[..., j : j + 1] for part in (x.q, x.w, x.u))
        out += [xp.sin(q), xp.cos(q)] if turning else [q]
        out += [w / speed, smooth_sign(w, width, "tanh"), u / torque]
    return xp.stack([f + zero for f in out], axis=-1)
