"""The protocol of `Mechanism` as a check, for one's own and for the built-in ones."""

import pickle
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, times

from .mechanism import Mechanism

_SAMPLES = 20
_STEP = 1e-5  # of differences: their errors are 1e-10 by curvature, 1e-11 by rounding


def check_mechanism(mechanism: Mechanism, *, tolerance: float = 1e-6, seed: int = 0) -> None:
    """Raises AssertionError if the equations of motion of a mechanism contradict each other.

    The mechanism is tried at random states with its given values, or the defaults.

    Parameters
    ----------
    mechanism : Mechanism
    tolerance : float
        Largest difference of what should be equal, relative to the largest number of its kind,
        where derivatives by differences take part; all else must agree to 1e-9.
    seed : int
        Of the states.

    Raises
    ------
    AssertionError
        With one sentence that names the broken rule.

    Examples
    --------
    >>> from frictionid.mechanics import acrobot
    >>> check_mechanism(acrobot(m4=0.1))
    """
    rng = np.random.default_rng(seed)
    revolute = np.array([unit == "rad" for unit in mechanism.position_units])
    shape = (_SAMPLES, mechanism.n)
    q = rng.uniform(-1.0, 1.0, shape) * np.where(revolute, np.pi, 1.0)
    w = rng.uniform(-1.0, 1.0, shape) * np.where(revolute, 5.0, 1.0)
    a = rng.normal(size=shape) * 10.0
    values = mechanism.with_defaults().nominal()
    p = np.asarray(mechanism.base(values))
    for holds, rule in _Check(mechanism, values, p, q, w, a, tolerance).rules():
        if not holds:
            raise AssertionError(f"{mechanism.kind}: {rule}")


Rules = Iterator[tuple[Any, str]]  # whether each holds, and its sentence


def _equal(actual: Any, expected: Any, rule: str, tolerance: float = 1e-9) -> tuple[bool, str]:
    """The rule that two arrays are equal, to within a share of the largest number."""
    actual, expected = np.asarray(actual), np.asarray(expected)
    if actual.shape != expected.shape:
        return False, f"{rule}: shapes are {actual.shape} and {expected.shape}"
    off = float(np.max(np.abs(actual - expected), initial=0.0))
    size = float(np.max(np.abs(expected), initial=0.0))
    holds = off <= tolerance * max(size, 1e-12)
    return holds, f"{rule}, but they differ by {off:.1g} of {size:.1g}"


class _Check(NamedTuple):
    """The rules of the protocol, one method each, at states q, w and accelerations a."""

    mechanism: Mechanism
    values: dict[str, float]
    p: Array
    q: Array
    w: Array
    a: Array
    tolerance: float

    def rules(self) -> Rules:
        """All rules, one after the other."""
        yield from self.facts()
        yield from self.base_parameters()
        yield from self.inertia()
        yield from self.parts()
        yield from self.lagrangian()
        yield from self.partials()
        yield from self.linear()
        yield from self.batches()
        yield from self.load()
        yield from self.pickles()

    def facts(self) -> Rules:
        """Names are unique, and there is one entry for each joint and base parameter."""
        m = self.mechanism
        parameters = tuple(p.name for p in m.parameters)
        several = {"joints": m.joints, "base_names": m.base_names, "parameters": parameters}
        for label, names in several.items():
            yield len(set(names)) == len(names), f"{label} must be different: {names}"
        for label in ("position_units", "velocity_units", "torque_units", "driven"):
            entries = getattr(m, label)
            yield len(entries) == m.n, f"{label} must have one entry per joint: {entries}"
        valid = set(m.position_units) <= {"rad", "m"}
        yield valid, f'position_units must be "rad" or "m", not {m.position_units}'
        for label in ("base_units", "base_meanings"):
            same = len(getattr(m, label)) == len(m.base_names)
            yield same, f"{label} must have one entry per base parameter"
        idle = np.asarray(m.B)[:, ~np.array(m.driven)]
        yield np.shape(m.B) == (m.n, m.n), f"B must be ({m.n}, {m.n}), not {np.shape(m.B)}"
        yield not idle.any(), "columns of B must be zero where no motor drives the joint"

    def base_parameters(self) -> Rules:
        """`base` gives one number per name, takes batches, and fills in what is not given."""
        m, nb = self.mechanism, len(self.mechanism.base_names)
        yield self.p.shape == (nb,), f"base must give ({nb},), not {self.p.shape}"
        twice = m.base({name: np.array([value, value]) for name, value in self.values.items()})
        yield _equal(
            twice, np.stack([self.p, self.p]), "base of a batch must be that of each entry"
        )
        filled = m.with_values(self.values).base({})
        yield _equal(filled, self.p, "base must take given values where none is passed")

    def inertia(self) -> Rules:
        """M is symmetric and positive definite, and the same from each method."""
        M = np.asarray(self.mechanism.inertia(self.p, self.q))
        yield _equal(M, np.swapaxes(M, -1, -2), "M must be symmetric", 1e-12)
        least = float(np.linalg.eigvalsh(M).min())
        yield (least > 0, f"M must be positive definite; its smallest eigenvalue is {least:.3g}")

    def parts(self) -> Rules:
        """`dynamics` and `inertia` are parts of `terms`."""
        m, t = self.mechanism, self.mechanism.terms(self.p, self.q, self.w)
        for name, value in zip("Mh", m.dynamics(self.p, self.q, self.w), strict=True):
            yield _equal(value, getattr(t, name), f"dynamics and terms must have the same {name}")
        yield _equal(m.inertia(self.p, self.q), t.M, "inertia and terms must have the same M")
        yield _equal(t.B, m.B, "terms must have the mechanism's B")
        yield _equal(t.momentum, times(t.M, self.w), "momentum must be M w")

    def lagrangian(self) -> Rules:
        """Momentum and dL/dq are derivatives of L = T - V, and h follows from them."""
        m, p, q, w = self.mechanism, self.p, self.q, self.w
        t = m.terms(p, q, w)

        def energy(w: Array) -> Array:
            return m.terms(p, q, w).energy

        def lagrangian(q: Array) -> Array:
            other = m.terms(p, q, w)
            return (other.momentum * w).sum(-1) - other.energy

        rule = "momentum must be the derivative of the energy by velocity"
        yield _equal(t.momentum, _slope(energy, w), rule, self.tolerance)
        rule = "dLdq must be the derivative of T - V by position"
        yield _equal(t.dLdq, _slope(lagrangian, q), rule, self.tolerance)
        change = _slope(lambda q: times(m.inertia(p, q), w), q)
        rule = "h must be dLdq less d(M w)/dq w"
        yield _equal(t.h, t.dLdq - times(change, w), rule, self.tolerance)

    def partials(self) -> Rules:
        """Partial derivatives are those of M a - h, and the regressor times p gives it."""
        m, p, q, w, a = self.mechanism, self.p, self.q, self.w, self.a

        def torque(q: Array, w: Array) -> Array:
            M, h = m.dynamics(p, q, w)
            return times(M, a) - h

        by_q, by_w, by_p = m.partials(p, q, w, a)
        slope_q, slope_w = _slope(lambda q: torque(q, w), q), _slope(lambda w: torque(q, w), w)
        yield _equal(by_q, slope_q, "partials by q must be derivatives of M a - h", self.tolerance)
        yield _equal(by_w, slope_w, "partials by w must be derivatives of M a - h", self.tolerance)
        yield _equal(times(by_p, p), torque(q, w), "the regressor times p must be M a - h")

    def linear(self) -> Rules:
        """M and h are linear in p: unit vectors of p add up to them."""
        bases = self.p, np.eye(len(self.p))[:, None]
        both = (self.mechanism.dynamics(p, self.q, self.w) for p in bases)
        for name, whole, each in zip("Mh", *both, strict=True):
            total = np.tensordot(self.p, each, 1)
            yield _equal(total, whole, f"{name} must be linear in the base parameters")

    def batches(self) -> Rules:
        """A batch of states and base parameters gives what each gives alone."""
        m, q, w, a = self.mechanism, self.q, self.w, self.a
        p = np.stack([self.p, 1.1 * self.p])
        terms, partials = m.terms(p[:, None], q, w), m.partials(p[:, None], q, w, a)
        for i in (0, 1):
            for k in (0, _SAMPLES - 1):
                alone: Any = m.terms(p[i], q[k], w[k]), m.partials(p[i], q[k], w[k], a[k])
                for together, single in zip((terms, partials), alone, strict=True):
                    for name, value in single._asdict().items():
                        whole = getattr(together, name)
                        picked = whole if name == "B" else whole[i, k]
                        yield _equal(picked, value, f"{name} of a batch must be that of each entry")

    def load(self) -> Rules:
        """Bearing loads are finite and not negative, alone as in a batch."""
        m, u = self.mechanism, self.a * self.mechanism.motors
        load = np.asarray(m.load(self.values, self.q, self.w, u))
        yield load.shape == self.q.shape, f"load must be {self.q.shape}, not {load.shape}"
        good = np.isfinite(load).all() and (load >= 0).all()
        yield good, "load must be finite and not negative"
        alone = m.load(self.values, self.q[3], self.w[3], u[3])
        yield _equal(load[3], alone, "load of a batch must be that of each entry")

    def pickles(self) -> Rules:
        """A pickled copy is equal and computes the same."""
        m = self.mechanism
        try:
            copy = pickle.loads(pickle.dumps(m))
        except Exception as error:
            message = f"{m.kind}: it must pickle ({error}): other processes compute with it"
            raise AssertionError(message) from None
        yield copy == m, "a pickled copy must be equal"
        h, again = (x.dynamics(self.p, self.q, self.w)[1] for x in (m, copy))
        yield np.array_equal(h, again), "a pickled copy must compute the same"


def _slope(f: Callable[[Array], Array], x: Array) -> Array:
    """df/dx by central differences, shape of f plus (n,)."""
    steps = _STEP * np.eye(x.shape[-1])
    return np.stack([(f(x + step) - f(x - step)) / (2 * _STEP) for step in steps], axis=-1)
