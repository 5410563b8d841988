"""Friction curves of any shape, linear in their parameters: a table of levels, and a spline.

A table is straight between levels at speeds, for each direction: compensation by such tables is as
old as that by laws [Armstrong1994]. The spline is one of the speed:

Tf = level(|w|) sgn(w),   level(s) = level + sum_i rise_i S_i(s)

S_i climbs from 0 to 1 over a few knots: it is the sum of the B-splines from one on, an I-spline
[Ramsay1988]. So a rise that the data do not reach is zero, and the curve goes on as it was. The
curve begins level: the data hardly show where it would go at rest, and with a slope of its own
there, the break-away level is anything (zero instead of 0.083 N m on `acrobot_clean`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, LawParameter, Memory

from .levels import LOAD, SIDES, Speeds, above_zero, by_side, check_increasing, on_side


@dataclass(frozen=True)
class Table(Law):
    """Tf = level(|w|) sgn(w), the level interpolated between its values at `speeds` [rad/s].

    `up` values hold for w > 0, `down` ones for w < 0. Below the first speed and beyond the last one
    the level stays as it is there. Levels are not negative: friction does not drive.

    >>> import numpy as np
    >>> from frictionid.friction import Friction
    >>> law = Table((1.0, 3.0))
    >>> law.names
    ('up_1', 'up_3', 'down_1', 'down_3')
    >>> tf = Friction(law, np.array([[0.1, 0.2, 0.3, 0.4]]))
    >>> tf.curve(np.array([-9.0, -2.0, 0.5, 2.0]))[:, 0]
    array([-0.4 , -0.35,  0.1 ,  0.15])
    """

    speeds: Speeds = (0.3, 1.0, 3.0, 10.0)
    width: float = 0.02
    shape: str = "tanh"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_increasing("Table: speeds", self.speeds)

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        names = (f"{side}_{v:g}" for side in ("up", "down") for v in self.speeds)
        return tuple(LawParameter(name, "N m") for name in names)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = before = self._value(theta, x, 0)
        # speed by speed: all of them at once, for all folds along all nodes, are gigabytes
        for i, climbed in enumerate(self._climbed(x), 1):
            value = self._value(theta, x, i)
            level = level + (value - before) * climbed
            before = value
        return level * self.sign(x.w)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        sign = self.sign(x.w)
        edges = [1.0 + 0.0 * x.w, *self._climbed(x), 0.0 * x.w]
        shares = [(a - b) * sign for a, b in zip(edges[:-1], edges[1:], strict=True)]
        up, down = zip(*(by_side(x.w, share) for share in shares), strict=True)
        zero = 0.0 * (theta[..., 0] + x.w)
        return xp.stack([part + zero for part in (*up, *down)], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._value(theta, x, 0)

    def _value(self, theta: Array, x: Inputs, i: int) -> Array:
        return on_side(x.w, theta[..., i], theta[..., len(self.speeds) + i])

    def _climbed(self, x: Inputs) -> Iterator[Array]:
        """Part (..., n) of each step between speeds that lies below |w|."""
        xp = namespace(x.w)
        speed = xp.abs(x.w)
        for low, high in pairwise(self.speeds):
            share = (speed - low) / (high - low)
            yield xp.minimum(xp.maximum(share, 0.0 * share), 1.0 + 0.0 * share)


KNOTS = (0.5, 1.0, 2.0, 4.0, 8.0)


@dataclass(frozen=True)
class Spline(Law):
    """Tf = level(|w|) sgn(w), the level a spline of `knots` [rad/s] and a polynomial `degree`.

    `level` is that at rest, the break-away level; each `rise` is what the level gains, or loses,
    from one part of the curve to the next, all of them together up to the last knot. Beyond it the
    curve goes on straight. Zero is always a knot. A negative level counts as zero: friction does
    not drive. A rise that the data do not tell stays at zero.

    symmetric : false gives each direction a level of its own, w > 0 first
    loaded : true adds `load_coefficient` load to the level, before it counts as zero
    """

    knots: Speeds = KNOTS
    degree: Annotated[int, Field(ge=1, le=3)] = 2
    width: float = 0.02
    shape: str = "tanh"
    symmetric: bool = True
    loaded: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check_increasing("Spline: knots", self.knots)

    @property
    def _size(self) -> int:
        """Number of parameters of a side."""
        return len(self.knots) + self.degree - 1

    @property
    def _sides(self) -> tuple[str, ...]:
        """Endings of the names of each level."""
        return ("",) if self.symmetric else SIDES

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        rises = (
            LawParameter(f"rise_{i}", "N m", -float("inf"), size=1.0) for i in range(1, self._size)
        )
        rows = (LawParameter("level", "N m"), *rises)
        sides = (p._replace(name=f"{p.name}{side}") for side in self._sides for p in rows)
        return (*sides, *((LOAD,) if self.loaded else ()))

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether the level grows with the load."""
        return self.loaded

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        steps = _steps(namespace(x.w).abs(x.w), self.knots, self.degree)
        sums = (self._with_load(_sum(part, steps), theta, x) for part in self._parts(theta))
        return on_side(x.w, *map(above_zero, sums)) * self.sign(x.w)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        steps = _steps(namespace(x.w).abs(x.w), self.knots, self.degree)
        sign = self.sign(x.w)
        columns: list[Array] = []
        by_load = 0.0 * (theta[..., 0] + x.w)
        signs = by_side(x.w, sign, len(self._sides))
        for part, side in zip(self._parts(theta), signs, strict=True):
            counts = (self._with_load(_sum(part, steps), theta, x) >= 0) * side
            columns += [counts * step for step in steps]
            by_load = by_load + counts * x.load
        columns += [by_load] * self.loaded
        return namespace(theta, x.w).stack(columns, axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = on_side(x.w, *(part[..., 0] for part in self._parts(theta))) + 0.0 * x.w
        return self._with_load(level, theta, x)

    def _with_load(self, level: Array, theta: Array, x: Inputs) -> Array:
        return level + theta[..., -1] * x.load if self.loaded else level

    def _parts(self, theta: Array) -> list[Array]:
        """Parameters of each side."""
        n = self._size
        return [theta[..., i * n : (i + 1) * n] for i in range(len(self._sides))]


def _steps(speed: Array, knots: tuple[float, ...], degree: int) -> list[Array]:
    """1 and the functions S_i that climb from 0 to 1, each like the speed."""
    xp = namespace(speed)
    upper = list(reversed(_b_splines(xp, speed, knots, degree)))
    steps = [upper[0]]
    for part in upper[1:-2]:  # without the first two: level at rest
        steps.append(steps[-1] + part)
    # beyond the last knot only the last step climbs, and all splines but the last two are over
    slope = degree / (knots[-1] - (0.0, *knots)[-2])
    steps[0] = steps[0] + slope * xp.maximum(speed - knots[-1], 0.0 * speed)
    return [1.0 + 0.0 * speed, *reversed(steps)]


def _b_splines(xp: Any, speed: Array, knots: tuple[float, ...], degree: int) -> list[Array]:
    """B-splines of the speed, by recursion over the degree; beyond the last knot as there.

    B_i,d = (s - t_i)/(t_i+d - t_i) B_i,d-1 + (t_i+d+1 - s)/(t_i+d+1 - t_i+1) B_i+1,d-1
    """
    last = knots[-1]
    t = [0.0] * (degree + 1) + list(knots) + [last] * degree
    s = xp.minimum(speed, last + 0.0 * speed)
    unity, zero = 1.0 + 0.0 * speed, 0.0 * speed
    parts = []
    for a, b in zip(t[:-1], t[1:], strict=True):
        inside = (s >= a) & ((s < b) if b < last else (s <= b))
        parts.append(xp.where(inside, unity, zero) if a < b else zero)
    for d in range(1, degree + 1):
        parts = [
            _share(s - t[i], t[i + d] - t[i]) * parts[i]
            + _share(t[i + d + 1] - s, t[i + d + 1] - t[i + 1]) * parts[i + 1]
            for i in range(len(parts) - 1)
        ]
    return parts


def _share(part: Array, whole: float) -> Array:
    return part / whole if whole else 0.0 * part


def _sum(theta: Array, steps: Sequence[Array]) -> Array:
    total: Any = sum(theta[..., i] * step for i, step in enumerate(steps))
    return total
