"""The protocol of `Identifier` as a check, on a small problem with known friction."""

import pickle
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, rms, times
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import States
from frictionid.friction import Friction, along
from frictionid.friction.laws import Stribeck
from frictionid.mechanics import Plant, double_pendulum, pendulum

from ..identifier import Identifier
from ..one_step.residual import Problem, one_step_problem

_RATE = 50.0  # [Hz]
_SAMPLES = 45
_RECORDINGS = 3
_NOISE = 1e-3  # [rad/s]
_TEMPERATURES = (20.0, 40.0)  # [degC]
_PENDULUM = {"mass": 0.5, "length": 0.3}  # [kg], [m]
# coulomb, peak [N m], Stribeck velocity [rad/s], viscous [N m s/rad] of each joint
_TRUTH = np.array([[0.10, 0.04, 1.5, 0.02], [0.05, 0.03, 2.5, 0.01]])


def true_friction(joints: int) -> Friction:
    """True friction of the synthetic problem, of one or two joints."""
    return Friction(Stribeck(), _TRUTH[:joints])


def synthetic_problem(joints: int, noise: float = _NOISE) -> Problem:
    """One-step problem of a pendulum with one or two driven joints: 3 recordings of 40 rows.

    Its motion is a sum of sines. The residual r is that of the true friction, plus `noise` [rad/s].
    Rows have a history of 4 samples.

    >>> problem = synthetic_problem(1, noise=0.0)
    >>> float(abs(problem.residual(along(true_friction(1), problem.nodes))).max())
    0.0
    """
    rng = np.random.default_rng(0)
    mechanism = pendulum() if joints == 1 else double_pendulum((True, True))
    parameters = _PENDULUM if joints == 1 else mechanism.defaults
    plant = Plant.from_parameters(
        mechanism, {k: np.full(_RECORDINGS, v) for k, v in parameters.items()}
    )
    states = [_motion(rng, joints) for _ in range(_RECORDINGS)]
    recordings = [
        Recording(f"{i}", Signal(s.time, s.q), Signal(s.time, np.cos(3 * s.q)))
        for i, s in enumerate(states)
    ]
    problem = _warmed(one_step_problem("integral", plant, recordings, states, history=4))
    torque = along(true_friction(joints), problem.nodes)
    explained = times(problem.G, problem.mean(torque))
    return replace(problem, r=explained + noise * rng.standard_normal(problem.r.shape))


def _warmed(problem: Problem) -> Problem:
    """The problem with a temperature that rises, for laws that ask for one; the truth does not."""
    inputs = problem.nodes.inputs
    rising = np.linspace(*_TEMPERATURES, len(inputs.w))[:, None] + 0.0 * inputs.w
    nodes = problem.nodes._replace(inputs=inputs._replace(temperature=rising))
    return replace(problem, nodes=nodes)


def _motion(rng: np.random.Generator, joints: int) -> States:
    """Smooth motion at up to about 8 rad/s that reverses a few times."""
    time = np.arange(_SAMPLES) / _RATE
    rate = rng.uniform(2.0, 9.0, (3, joints))
    phase = rng.uniform(0.0, 2 * np.pi, (3, joints))
    height = 2.5 / rate
    angle = rate * time[:, None, None] + phase
    return States(time, (height * np.sin(angle)).sum(1), (height * rate * np.cos(angle)).sum(1))


def synthetic_weights(problem: Problem) -> Array:
    """Weights (F, K) that leave out one recording each, of unequal size, with some rows in none."""
    left_out = problem.recording != np.arange(_RECORDINGS)[:, None]
    sizes = 1.0 + 0.5 * np.sin(np.arange(len(problem.r)))
    ignored = np.arange(len(problem.r)) % 10 == 3
    return left_out * sizes * ~ignored


def check_identifier(
    identifier: Identifier, *, joints: Sequence[int] = (1, 2), tolerance: float = 1e-6
) -> None:
    """Raises AssertionError if the identifier violates the protocol on small synthetic problems.

    Parameters
    ----------
    identifier : Identifier
    joints : sequence of 1 or 2
        Numbers of joints to check; published friction fits only its own.
    tolerance : float
        Largest difference of torques that should be equal, relative to their root mean square,
        where the order of summation may differ. The same seed must give exactly the same.

    Raises
    ------
    AssertionError
        With one sentence that names the broken rule.

    Examples
    --------
    >>> from frictionid.fitting.identifiers import LeastSquares
    >>> from frictionid.friction.laws import CoulombViscous
    >>> check_identifier(LeastSquares(CoulombViscous()))
    """
    for n in joints:
        problem = synthetic_problem(n)
        check = _Check(identifier, problem, synthetic_weights(problem), tolerance)
        check.settings()
        friction = check.fit()
        for rule in (check.friction, check.weights, check.folds, check.repetition, check.seeds):
            rule(friction)


class _Check(NamedTuple):
    """The rules of the protocol, one method each, on a problem with training weights (F, K)."""

    identifier: Identifier
    problem: Problem
    training: Array
    tolerance: float

    def require(self, holds: Any, rule: str) -> None:
        if not holds:
            n = self.problem.r.shape[-1]
            raise AssertionError(f"{self.identifier}, on {n} joint{'s' * (n > 1)}: {rule}")

    def copy(self, thing: Any, name: str) -> Any:
        try:
            return pickle.loads(pickle.dumps(thing))
        except Exception as error:
            message = (
                f"{self.identifier}: {name} must pickle ({error}): define its class in a module"
            )
            raise AssertionError(message) from None

    def settings(self) -> None:
        """It is an identifier whose settings are in its repr."""
        self.require(isinstance(self.identifier, Identifier), "it must derive from Identifier")
        same = repr(self.copy(self.identifier, "it")) == repr(self.identifier)
        self.require(same, "its repr must say its settings, because results are known by it")

    def fit(self) -> Friction:
        """Friction of all folds; fitting changes neither its arguments nor the identifier."""
        problem, weights = self.copy(self.problem, "the problem"), self.training.copy()
        before, settings = pickle.dumps(problem), repr(self.identifier)
        friction = self.identifier.fit(problem, weights, 0)
        self.require(pickle.dumps(problem) == before, "fit must not change the problem")
        self.require(np.array_equal(weights, self.training), "fit must not change the weights")
        self.require(repr(self.identifier) == settings, "fit must not change the settings")
        return friction

    def friction(self, friction: Friction) -> None:
        """The result is a Friction of the right shape that predicts and pickles."""
        self.require(isinstance(friction, Friction), "fit must give a Friction")
        F, n = len(self.training), self.problem.r.shape[-1]
        shape, theta = (F, n, len(friction.law.names)), np.asarray(friction.theta)
        self.require(theta.shape == shape, f"theta must have shape {shape}, not {theta.shape}")
        self.require(np.isfinite(theta).all(), "theta must be finite; a failed fit raises")
        x, torque = self.problem.nodes.inputs, self.torque(friction)
        shape = (F, *x.w.shape)
        self.require(
            torque.shape == shape, f"torque must be {shape} along the nodes, not {torque.shape}"
        )
        self.require(np.isfinite(torque).all(), "torque must be finite along the nodes")
        memory = friction.law.start(theta[:, None], x)
        both = np.zeros(shape)
        for sign in (1.0, -1.0):
            limit = friction.law.limit(theta[:, None], x._replace(w=sign + 0.0 * x.w), memory)
            fills = _fills(np.shape(limit), shape)
            self.require(fills, f"limit must be {shape} at the nodes, not {np.shape(limit)}")
            both = both + np.asarray(limit)
        # a torque of position, such as cogging, takes from one what it adds to the other
        self.require(
            (both >= -1e-12).all(), "limit must not be negative, of both directions together"
        )
        copy = self.torque(self.copy(friction, "its friction"))
        self.require(np.array_equal(copy, torque), "pickled friction must give the same torque")

    def folds(self, friction: Friction) -> None:
        """Each fold is the same when it is fitted alone, whatever the recordings it holds out."""
        torque = self.torque(friction)
        for f, weights in enumerate(self.training):
            alone = self.identifier.fit(self.problem, weights[None], 0)
            self.equal(self.torque(alone)[0], torque[f], f"fold {f} must be the same alone")
            blind = self.identifier.fit(_others_changed(self.problem, weights), weights[None], 0)
            rule = f"fold {f} must be blind to the recordings that it holds out"
            self.equal(self.torque(blind)[0], torque[f], rule)

    def weights(self, friction: Friction) -> None:
        """Only ratios of weights count; rows without weight have no influence."""
        torque, seen = self.torque(friction), np.asarray(self.training.any(axis=0))
        twice = self.identifier.fit(self.problem, 2.0 * self.training, 0)
        self.equal(self.torque(twice), torque, "doubling all weights must change nothing")
        r = np.where(seen[:, None], self.problem.r, self.problem.r + 10.0)
        G = np.where(seen[:, None, None], self.problem.G, 3.0 * self.problem.G)
        other = self.identifier.fit(replace(self.problem, r=r, G=G), self.training, 0)
        self.equal(self.torque(other), torque, "rows whose weight is zero must have no influence")

    def seeds(self, friction: Friction) -> None:
        """What declares `seeded = False` does not depend on the seed."""
        if not self.identifier.seeded:
            other = self.identifier.fit(self.problem, self.training, 1)
            same = np.array_equal(self.torque(other), self.torque(friction))
            self.require(same, "with seeded = False another seed must give the same numbers")

    def repetition(self, friction: Friction) -> None:
        """The same seed gives the same numbers."""
        again = self.copy(self.identifier, "it").fit(self.problem, self.training, 0)
        same = np.array_equal(again.theta, friction.theta)
        self.require(same, "the same seed must give the same numbers")

    def torque(self, friction: Friction) -> Array:
        return along(friction, self.problem.nodes)

    def equal(self, actual: Array, expected: Array, rule: str) -> None:
        size = float(rms(expected))
        off = float(np.abs(actual - expected).max()) / max(size, 1e-12)
        self.require(
            off <= self.tolerance, f"{rule}, but torques differ by {off:.1g} of their size"
        )


def _others_changed(problem: Problem, weights: Array) -> Problem:
    """The problem with other numbers in recordings without weight: r, G, motion, torque, load."""
    held = ~np.isin(np.arange(len(problem.nodes.first) - 1), problem.recording[weights > 0])
    rows, nodes = held[problem.recording], np.repeat(held, np.diff(problem.nodes.first))
    inputs = problem.nodes.inputs.each(lambda x: np.where(nodes[:, None], 1.7 * x, x))
    return replace(
        problem,
        r=np.where(rows[:, None], problem.r + 10.0, problem.r),
        G=np.where(rows[:, None, None], 3.0 * problem.G, problem.G),
        nodes=problem.nodes._replace(inputs=inputs),
        slowest=np.where(held[:, None], 2.0 * np.asarray(problem.slowest), problem.slowest),
    )


def _fills(actual: tuple[int, ...], shape: tuple[int, ...]) -> bool:
    """Whether an array of the given shape broadcasts to a shape."""
    try:
        return np.broadcast_shapes(actual, shape) == shape
    except ValueError:
        return False
