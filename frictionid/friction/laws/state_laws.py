"""Acceleration without physics, of all that is measured: sparse sums of monomials, and networks.

Tf_j = -sum_i theta_ji f_i(q, w, u of all joints)

after SINDy with inputs [Brunton2016]. The variables of each joint are sin q and cos q (q itself
where it slides), w, a smooth sign of w, and u, in which the sum is linear, as machines are.
Recurrent networks read them sample by sample [Hochreiter1997].
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement
from typing import Any, ClassVar, NamedTuple

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, LawParameter, Memory

from ..law import smooth_sign
from .layers import Hidden, outputs
from .levels import no_limit
from .library import written_sums
from .network_law import Features, NetworkLaw

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
    >>> import numpy as np
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
    is_sparse = True
    limit = no_limit

    def __post_init__(self) -> None:
        super().__post_init__()
        size = math.comb(len(_variables(self)) + self.degree, self.degree)
        if size > 10 * _LARGEST or len(_monomials(self)) > _LARGEST:
            raise InputError(
                f"state_library: degree = {self.degree} of {self.joints} joints has more than "
                f"{_LARGEST} candidates: lower it"
            )

    @cached_property
    def parameters(self) -> tuple[LawParameter, ...]:
        rows = ((_name(self, m), _unit(self, m)) for m in _monomials(self))
        return tuple(LawParameter(name, unit, -math.inf) for name, unit in rows)

    def features(self, x: Inputs) -> Array:
        """Values (..., P) of all monomials, the same for every joint."""
        xp, values = namespace(x.w), [value[..., 0] for value in _values(self, x)]
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

    def equation(
        self, theta: Array, half: Array | None = None, position_units: Sequence[str] = ()
    ) -> list[str]:
        """One line for each joint: its acceleration in SI units."""
        terms = ["" if name == "1" else name for name in self.names]
        return written_sums("dw{}/dt = ", theta, half, [terms] * len(theta))


@lru_cache(maxsize=16)
def _variables(law: StateLibrary) -> tuple[Variable, ...]:
    variables = []
    for j in range(law.joints):
        place = [("sin", "", False), ("cos", "", True)] if law.turning else [("q", "/rad", False)]
        rest = [("w", "s/rad", False), ("s", "", True), ("u", "/(N m)", True)]
        variables += [Variable(what, j, unit, once) for what, unit, once in (*place, *rest)]
    return tuple(variables)


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


def _values(
    law: Any, x: Inputs, speed: Array | float = 1.0, torque: Array | float = 1.0
) -> list[Array]:
    """Place, w / speed, s(w), u / torque of each joint that a law knows; zero where it is none.

    Each is the same for all joints, (..., n).
    """
    xp, n = namespace(x.w), x.w.shape[-1]
    zero = 0.0 * (x.w + x.q + x.u + speed)
    out: list[Array] = []
    for j in range(law.joints):
        if j >= n:
            out += [zero] * (4 + law.turning)
            continue
        q, w, u = (part[..., j : j + 1] for part in (x.q, x.w, x.u))
        out += [xp.sin(q), xp.cos(q)] if law.turning else [q]
        out += [w / speed, smooth_sign(w, law.width), u / torque]
    return [value + zero for value in out]


def _name(law: StateLibrary, m: tuple[int, ...]) -> str:
    v = _variables(law)
    powers = [(v[i].name, m.count(i)) for i in dict.fromkeys(m)]
    return "*".join(name if k == 1 else f"{name}^{k}" for name, k in powers) or "1"


def _unit(law: StateLibrary, m: tuple[int, ...]) -> str:
    v = _variables(law)
    return " ".join(["rad/s^2", *(v[i].unit for i in m if v[i].unit)])


_SCALES = (
    LawParameter("acceleration", "rad/s^2", 1e-9, initial=(10.0,)),
    LawParameter("speed", "rad/s", 1e-9, initial=(5.0,)),
    LawParameter("torque", "N m", 1e-9, initial=(1.0,)),
)


@dataclass(frozen=True)
class StateMLP(NetworkLaw):
    """Tf = -acceleration f(q, w, u of all joints), f a network with `hidden` tanh units.

    Its inputs are the place, w, a smooth sign of w, and u of each of `joints`. Place is sin q and
    cos q, or q where the joints slide. Joints beyond `joints` are left out, those that there are
    not are zero.

    joints : whose state it sees
    turning : whether the joints turn, or slide
    width : of the smooth sign of w that is one of its inputs [rad/s]
    """

    joints: Count = 2
    hidden: Hidden = (32, 32)
    turning: bool = True
    width: float = 0.1
    shape = ""  # of an input, not of friction
    scales: ClassVar = _SCALES
    limit = no_limit

    @property
    def measured(self) -> int:
        """Number of inputs that are measured."""
        return self.joints * (4 + self.turning)

    @property
    def sizes(self) -> tuple[int, ...]:
        return (self.measured + self.cells, *self.hidden, 1)

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        values = _values(self, x, theta[..., 1], theta[..., 2])
        z = namespace(theta, x.w).stack(values, axis=-1)
        none = 0.0 * z[..., 0]
        return Features(z, none, none - 1.0)

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Acceleration (..., n) [rad/s^2]."""
        return theta[..., 0] * outputs(self.layer_weights(theta), z, self.sizes)[..., 0]


@dataclass(frozen=True)
class StateLSTM(StateMLP):
    """Tf = -acceleration f(q, w, u of all joints, cells), the cells reading a sample each time.

    cells : that read samples `sample_time` [s] apart; they begin empty
    hidden : tanh units between what is measured, the cells, and the acceleration
    joints, turning, width : as in `StateMLP`
    """

    cells: Count = 8
    sample_time: Positive = 1 / 60
    hidden: Hidden = (32,)

    @property
    def gate_sizes(self) -> tuple[int, int]:
        return (self.measured + self.cells, 4 * self.cells)

    def read(self, theta: Array, x: Inputs) -> Array:
        return self.features(theta, x).z
