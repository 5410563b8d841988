"""The protocol of `Mechanism` as a check, for one's own and for the built-in ones."""

import pickle
from collections.abc import Callable
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
    check = _check(mechanism, tolerance, np.random.default_rng(seed))
    for rule in (
        check.facts,
        check.base_parameters,
        check.inertia,
        check.parts,
        check.lagrangian,
        check.partials,
        check.linear,
        check.batches,
        check.load,
        check.pickles,
    ):
        rule()


def _check(mechanism: Mechanism, tolerance: float, rng: np.random.Generator) -> "_Check":
    revolute = np.array([unit == "rad" for unit in mechanism.position_units])
    shape = (_SAMPLES, mechanism.n)
    q = rng.uniform(-1.0, 1.0, shape) * np.where(revolute, np.pi, 1.0)
    w = rng.uniform(-1.0, 1.0, shape) * np.where(revolute, 5.0, 1.0)
    a = rng.normal(size=shape) * 10.0
    values = mechanism.with_defaults().nominal()
    p = np.asarray(mechanism.base(values))
    return _Check(mechanism, values, p, q, w, a, tolerance)


class _Check(NamedTuple):
    """The rules of the protocol, one method each, at states q, w and accelerations a."""

    mechanism: Mechanism
    values: dict[str, float]
    p: Array
    q: Array
    w: Array
    a: Array
    tolerance: float

    def require(self, holds: Any, rule: str) -> None:
        if not holds:
            raise AssertionError(f"{self.mechanism.kind}: {rule}")

    def equal(self, actual: Array, expected: Array, rule: str, tolerance: float = 1e-9) -> None:
        actual, expected = np.asarray(actual), np.asarray(expected)
        self.require(
            actual.shape == expected.shape,
            f"{rule}: shapes are {actual.shape} and {expected.shape}",
        )
        off = float(np.max(np.abs(actual - expected), initial=0.0))
        size = float(np.max(np.abs(expected), initial=0.0))
        self.require(
            off <= tolerance * max(size, 1e-12),
            f"{rule}, but they differ by {off:.1g} of {size:.1g}",
        )

    def facts(self) -> None:
        """Names are unique, and there is one entry for each joint and base parameter."""
        m = self.mechanism
        for label, names in (
            ("joints", m.joints),
            ("base_names", m.base_names),
            ("parameters", tuple(p.name for p in m.parameters)),
        ):
            self.require(len(set(names)) == len(names), f"{label} must be different: {names}")
        for label, entries in (
            ("position_units", m.position_units),
            ("velocity_units", m.velocity_units),
            ("torque_units", m.torque_units),
            ("driven", m.driven),
        ):
            self.require(len(entries) == m.n, f"{label} must have one entry per joint: {entries}")
        valid = set(m.position_units) <= {"rad", "m"}
        self.require(valid, f'position_units must be "rad" or "m", not {m.position_units}')
        for label, texts in (("base_units", m.base_units), ("base_meanings", m.base_meanings)):
            same = len(texts) == len(m.base_names)
            self.require(same, f"{label} must have one entry per base parameter")
        idle = np.asarray(m.B)[:, ~np.array(m.driven)]
        self.require(np.shape(m.B) == (m.n, m.n), f"B must be ({m.n}, {m.n}), not {np.shape(m.B)}")
        self.require(not idle.any(), "columns of B must be zero where no motor drives the joint")

    def base_parameters(self) -> None:
        """`base` gives one number per name, takes batches, and fills in what is not given."""
        m, nb = self.mechanism, len(self.mechanism.base_names)
        self.require(self.p.shape == (nb,), f"base must give ({nb},), not {self.p.shape}")
        twice = m.base({name: np.array([value, value]) for name, value in self.values.items()})
        self.equal(twice, np.stack([self.p, self.p]), "base of a batch must be that of each entry")
        filled = m.with_values(self.values).base({})
        self.equal(filled, self.p, "base must take given values where none is passed")

    def inertia(self) -> None:
        """M is symmetric and positive definite, and the same from each method."""
        M = np.asarray(self.mechanism.inertia(self.p, self.q))
        self.equal(M, np.swapaxes(M, -1, -2), "M must be symmetric", 1e-12)
        least = float(np.linalg.eigvalsh(M).min())
        self.require(
            least > 0, f"M must be positive definite; its smallest eigenvalue is {least:.3g}"
        )

    def parts(self) -> None:
        """`dynamics` and `inertia` are parts of `terms`."""
        m, t = self.mechanism, self.mechanism.terms(self.p, self.q, self.w)
        M, h = m.dynamics(self.p, self.q, self.w)
        self.equal(M, t.M, "dynamics and terms must have the same M")
        self.equal(h, t.h, "dynamics and terms must have the same h")
        self.equal(m.inertia(self.p, self.q), t.M, "inertia and terms must have the same M")
        self.equal(t.B, m.B, "terms must have the mechanism's B")
        self.equal(t.momentum, times(t.M, self.w), "momentum must be M w")

    def lagrangian(self) -> None:
        """Momentum and dL/dq are derivatives of L = T - V, and h follows from them."""
        m, p, q, w = self.mechanism, self.p, self.q, self.w
        t = m.terms(p, q, w)

        def energy(w: Array) -> Array:
            return m.terms(p, q, w).energy

        def lagrangian(q: Array) -> Array:
            other = m.terms(p, q, w)
            return (other.momentum * w).sum(-1) - other.energy

        rule = "momentum must be the derivative of the energy by velocity"
        self.equal(t.momentum, _slope(energy, w), rule, self.tolerance)
        rule = "dLdq must be the derivative of T - V by position"
        self.equal(t.dLdq, _slope(lagrangian, q), rule, self.tolerance)
        change = _slope(lambda q: times(m.inertia(p, q), w), q)
        rule = "h must be dLdq less d(M w)/dq w"
        self.equal(t.h, t.dLdq - times(change, w), rule, self.tolerance)

    def partials(self) -> None:
        """Partial derivatives are those of M a - h, and the regressor times p gives it."""
        m, p, q, w, a = self.mechanism, self.p, self.q, self.w, self.a

        def torque(q: Array, w: Array) -> Array:
            M, h = m.dynamics(p, q, w)
            return times(M, a) - h

        by_q, by_w, by_p = m.partials(p, q, w, a)
        slope_q, slope_w = _slope(lambda q: torque(q, w), q), _slope(lambda w: torque(q, w), w)
        self.equal(by_q, slope_q, "partials by q must be derivatives of M a - h", self.tolerance)
        self.equal(by_w, slope_w, "partials by w must be derivatives of M a - h", self.tolerance)
        self.equal(times(by_p, p), torque(q, w), "the regressor times p must be M a - h")

    def linear(self) -> None:
        """M and h are linear in p: unit vectors of p add up to them."""
        m, (M, h) = self.mechanism, self.mechanism.dynamics(self.p, self.q, self.w)
        units = np.eye(len(self.p))[:, None]
        each_M, each_h = m.dynamics(units, self.q, self.w)
        rule = "{} must be linear in the base parameters"
        self.equal(np.tensordot(self.p, each_M, 1), M, rule.format("M"))
        self.equal(np.tensordot(self.p, each_h, 1), h, rule.format("h"))

    def batches(self) -> None:
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
                        self.equal(picked, value, f"{name} of a batch must be that of each entry")

    def load(self) -> None:
        """Bearing loads are finite and not negative, alone as in a batch."""
        m, u = self.mechanism, self.a * self.mechanism.motors
        load = np.asarray(m.load(self.values, self.q, self.w, u))
        self.require(load.shape == self.q.shape, f"load must be {self.q.shape}, not {load.shape}")
        good = np.isfinite(load).all() and (load >= 0).all()
        self.require(good, "load must be finite and not negative")
        alone = m.load(self.values, self.q[3], self.w[3], u[3])
        self.equal(load[3], alone, "load of a batch must be that of each entry")

    def pickles(self) -> None:
        """A pickled copy is equal and computes the same."""
        m = self.mechanism
        try:
            copy = pickle.loads(pickle.dumps(m))
        except Exception as error:
            message = f"{m.kind}: it must pickle ({error}): other processes compute with it"
            raise AssertionError(message) from None
        self.require(copy == m, "a pickled copy must be equal")
        h, again = (x.dynamics(self.p, self.q, self.w)[1] for x in (m, copy))
        self.require(np.array_equal(h, again), "a pickled copy must compute the same")


def _slope(f: Callable[[Array], Array], x: Array) -> Array:
    """df/dx by central differences, shape of f plus (n,)."""
    steps = _STEP * np.eye(x.shape[-1])
    return np.stack([(f(x + step) - f(x - step)) / (2 * _STEP) for step in steps], axis=-1)
