"""Networks in shooting: on NumPy arrays, and as laws of the combinations that change the motion.

The motion depends on a network through its torque alone, and few combinations of its weights
change that by more than rounding: the right singular vectors V_r of the torque's Jacobian J (N, P)
with the largest singular values. Torques are far from linear in the weights, the motion is nearly
linear in the torques. So a step c of the combinations is taken as the change J V_r c of the
torques, the weights are fitted to the changed torques, and the combinations are computed again.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.data.integrals import pieces_of
from frictionid.data.plants import Calibration, calibrated_plant
from frictionid.dynamics.law_derivatives import FreeTheta, SmoothedLaw, TensorLaw
from frictionid.dynamics.state import Instant, State
from frictionid.errors import needs
from frictionid.friction import Friction, Inputs, LawParameter, Memory
from frictionid.mechanics import Mechanism

from ..parameter_block import (
    Estimate,
    Parameter,
    ParameterBlock,
    Values,
)
from ..parameters import FrictionBlock
from .network_curves import curve_of, distance, has_curve, network_of
from .sample_intervals import Intervals


@dataclass(frozen=True, eq=False, repr=False)
class CombinationLaw(SmoothedLaw):
    """A law of the numbers origin + directions theta, theta (n, r).

    origin : (n, P); directions : (n, P, r)
    """

    origin: Array
    directions: Array

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        names = (f"combination {k + 1}" for k in range(self.directions.shape[-1]))
        return tuple(LawParameter(name, "1", -float("inf")) for name in names)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((0.0,) * self.directions.shape[-1],)

    def numbers(self, theta: Array) -> Array:
        """The law's own numbers (..., n, P)."""
        return self.origin + (self.directions @ np.asarray(theta)[..., None])[..., 0]

    def passed_on(self, theta: Array, x: Inputs) -> tuple[Array, Inputs]:
        return self.numbers(theta), x

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return self._combined(self.inner.gradient(self.numbers(theta), x))

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory] | None:
        parts = self.inner.slopes(self.numbers(theta), x, memory)
        return None if parts is None else (self._combined(parts[0]), parts[1])

    def _combined(self, gradient: Array) -> Array:
        """Derivatives (K, n, r) in the combinations, of those (K, n, P) in the law's numbers."""
        return np.swapaxes(np.swapaxes(gradient, 0, 1) @ self.directions, 0, 1)


@dataclass(frozen=True, eq=False, repr=False)
class CurveCombinations(CombinationLaw):
    """Combinations of the changes of a `CurveLaw`, by which a network's curve stands in a fit.

    network : the friction whose curve it is where all combinations are zero
    """

    network: Friction = field()

    @property
    def free(self) -> FreeTheta:
        """Combinations of the curve's scales, as far as these change them, and of its levels."""
        law: Any = self.inner
        first, levels = len(law.scales), np.arange(self.directions.shape[1])
        changed = self.directions.any(axis=-1) | (levels >= first)
        joint, place = np.nonzero(changed)
        order = np.argsort(place >= first, kind="stable")
        joint, place, terms = joint[order], place[order], law.degree + 1
        runs = int((place >= first).sum()) // terms
        return FreeTheta(joint, place, self.directions[joint, place], runs, terms)

    def curve(self, friction: Friction) -> Friction:
        """The friction as that of coefficients."""
        return replace(friction, law=self.inner, theta=self.numbers(friction.theta))


_COUNT = 500
_LINK = 9  # samples through which a memory is followed


@dataclass(frozen=True, eq=False)
class TorqueSamples:
    """N samples of a motion.

    path : inputs (N, n) at successive samples, the last of them those of the sample itself; the
        memory starts at the first
    dt : (N, 1) [s] between them
    """

    path: tuple[Inputs, ...]
    dt: Array

    def memory(self, friction: Friction) -> Memory:
        """What friction remembers, (N, n) each."""
        z = friction.law.start(friction.theta, self.path[0])
        for x in self.path[1:]:
            z = friction.law.advance(friction.theta, x, z, self.dt)
        return z

    def torque(self, friction: Friction) -> Array:
        """Torques (N, n) [N m]."""
        return friction.law.torque(friction.theta, self.path[-1], self.memory(friction))

    def slopes(self, friction: Friction) -> Array:
        """Their derivatives (N, n, P) in each joint's own numbers."""
        theta = friction.theta
        law: Any = friction.law  # of `on_arrays`, which gives it the derivatives asked for here
        if not law.has_memory:
            return np.asarray(law.gradient(theta, self.path[0]))
        if law.reads_window:
            return np.asarray(law.slopes(theta, self.path[-1], self.memory(friction))[0])
        z = law.start(theta, self.path[0])
        return np.asarray(law.gradient_along(theta, self.path, z, self.dt))


def torque_samples(
    friction: Friction,
    mechanism: Mechanism,
    calibration: Calibration,
    intervals: Intervals,
    use: Array,
) -> TorqueSamples:
    """Some samples of the intervals in use (K,), as inputs of the law."""
    K = len(intervals.dt)
    run = np.arange(K) - np.maximum.accumulate(np.where(intervals.joined, 0, np.arange(K)))
    link = min(_LINK, int(run.max())) if friction.law.has_memory else 0
    usable = np.flatnonzero((run >= link) & use)
    rows = usable[np.unique(np.linspace(0, len(usable) - 1, _COUNT).astype(int))]
    plant = calibrated_plant(intervals.dataset, calibration)
    driven = mechanism.motors
    path = []
    for at in (rows - back for back in range(link, -1, -1)):
        start = intervals.time[at]
        edges = np.stack([start, start + intervals.dt[at]], axis=1) - calibration.delay
        logged = pieces_of(intervals.torque, intervals.recording[at], edges).mean[0]
        u = (calibration.gain * logged + calibration.bias) * driven
        state = State(intervals.q[at] - calibration.offset, intervals.w[at])
        path.append(Instant(plant[intervals.recording[at]], friction, state, u).inputs)
    return TorqueSamples(tuple(path), intervals.dt[rows][:, None])


_ASTRAY = 1e-3  # of the level
_MOST = 20  # combinations of a joint
_DEVIATION = 1.0  # standard deviation of the prior of a joint's weights, relative to their size
_ITERATIONS = 12  # Gauss-Newton iterations towards wanted torques
_RIDGE = (1e-4, 10.0)  # of the largest singular value, and its growth after a step too far


def on_arrays(friction: Friction) -> Friction:
    """The friction on NumPy arrays, with slopes by reverse mode where its law has none to give."""
    law, theta = friction.law, friction.theta
    if not hasattr(theta, "detach"):
        differentiable = law.reads_window or not law.has_memory
        if not law.is_network or (law.has_gradient and differentiable):
            return friction
        with needs("networks"):
            from torch import as_tensor  # late: who has no such law need not wait for torch

        theta = as_tensor(np.array(theta, dtype=float))
    like = theta.detach().double()
    law = TensorLaw(law, law.width, law.shape, like)
    return replace(friction, law=law, theta=like.cpu().numpy().copy())


def as_given(friction: Friction, start: Friction) -> Friction:
    """The friction with the law and the kind of numbers that were given."""
    theta = friction.theta
    if isinstance(friction.law, CombinationLaw):
        theta = friction.law.numbers(theta)
    if isinstance(friction.law, CurveCombinations):
        theta = network_of(friction.law.curve(friction), friction.law.network).theta
    like = start.theta
    if hasattr(like, "detach"):
        theta = namespace(like).asarray(theta, dtype=like.dtype, device=like.device)
    return replace(friction, law=start.law, theta=theta, constraints=None)


def goes_astray(friction: Friction, network: Friction) -> bool:
    """Whether a curve is none of the network's, which has the nearest weights."""
    law = friction.law
    if not isinstance(law, CurveCombinations):
        return False
    return distance(law.curve(friction), replace(network, theta=np.array(network.theta))) > _ASTRAY


def with_combinations(
    friction: Friction, samples: TorqueSamples, blocks: Sequence[ParameterBlock], curves: bool
) -> tuple[Friction, tuple[ParameterBlock, ...]]:
    """A network as a law of the combinations that change the motion, and the block of these.

    Weights with bounds, the scales of inputs and outputs, stay as they are.

    curves : whether the curve of a static network may stand for it
    """
    law = friction.law
    block = next((b for b in blocks if isinstance(b, FrictionBlock)), None)
    fixed = law.names if block is None else block.fixed
    pairs = zip(law.names, law.bounds, strict=True)
    free = np.array([name not in fixed and not np.isfinite(ends).any() for name, ends in pairs])
    deviation = _DEVIATION if block is None or block.prior is None else block.prior
    few = CombinationBlock(
        begin=np.array(friction.theta),
        samples=samples,
        free=free,
        deviation=deviation,
        count=min(_MOST, int(free.sum())),
    )
    combined: Any = few.combined(friction)
    if curves and has_curve(law, free):
        few = CurveBlock(**vars(few))
        curve, directions = curve_of(friction, combined.law.directions)
        parts = (curve.law, law.width, law.shape, curve.theta, directions, friction)
        combined = replace(combined, law=CurveCombinations(*parts))
    return combined, tuple(few if b is block else b for b in blocks)


@dataclass(frozen=True, eq=False, kw_only=True)
class CombinationBlock(ParameterBlock):
    """Combinations of a network's weights, in units of the standard deviation of their prior.

    begin : (n, P), the weights that the fit begins with
    samples : of the motion, at which torques are compared
    free : (P,), weights that may move
    deviation : standard deviation of the prior, relative to the size of all the weights
    count : combinations of a joint
    """

    begin: Array
    samples: TorqueSamples
    free: Array
    deviation: float
    count: int
    name, enters = "friction", "friction"

    def combined(self, friction: Friction, before: Array | None = None) -> Friction:
        """The friction as a law of the combinations that change its torques most, all zero.

        before : (n, P, r), directions that are to stay what they were, nearly
        """
        law, theta = friction.law, friction.theta
        slopes = self.samples.slopes(friction) * self.free
        directions = np.zeros((*theta.shape, self.count))
        for j in range(friction.n):
            _, _, right = np.linalg.svd(slopes[:, j], full_matrices=False)
            columns = self._scale[j] * right[: self.count].T
            if before is not None:
                left, _, right = np.linalg.svd(columns.T @ before[j])
                columns = columns @ (left @ right)
            directions[j] = columns
        few = CombinationLaw(law, law.width, law.shape, theta, directions)
        theta = np.zeros((friction.n, self.count))
        return replace(friction, law=few, theta=theta, constraints=None)

    @property
    def _scale(self) -> Array:
        """Length (n,) of the directions."""
        return self.deviation * np.sqrt((self.begin[:, self.free] ** 2).mean(axis=-1))

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        friction, joints = estimate.friction, estimate.mechanism.friction_names
        value = self.numbers(estimate)
        for j, joint in enumerate(joints):
            for k, (name, unit) in enumerate(
                zip(friction.law.names, friction.units_at(j), strict=True)
            ):
                words, number = f"{name} of {joint}", float(value[j, k])
                yield Parameter(self.name, words, unit, number, tolerance=1.0, place=(j, k))

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        law: Any = estimate.friction.law  # a CombinationLaw, of `combined`
        step = -self.numbers(estimate)
        for parameter, value in values:
            step[parameter.place] += value
        here = replace(estimate.friction, law=law.law, theta=law.origin)
        change = (law.directions @ step[..., None])[..., 0]
        turn = (self.samples.slopes(here) * change).sum(axis=-1)
        moved = self._moved(here, change, self.samples.torque(here) + turn)
        return estimate._replace(friction=self.combined(moved, law.directions))

    def numbers(self, estimate: Estimate) -> Array:
        """Combinations (n, r) of the weights' distance from where they began."""
        law: Any = estimate.friction.law
        directions, off = law.directions, law.numbers(estimate.friction.theta) - self.begin
        return np.einsum("np,npr->nr", off, directions) / self._scale[:, None] ** 2

    def _moved(self, friction: Friction, change: Array, wanted: Array) -> Friction:
        """The friction with weights fitted to wanted torques (N, n).

        By damped Gauss-Newton steps, the first of them the given change (n, P).
        """
        theta, (ridge, growth) = friction.theta, _RIDGE
        off = wanted - self.samples.torque(friction)
        damping = np.full(friction.n, ridge)
        for _ in range(_ITERATIONS):
            stepped = theta + change
            left = wanted - self.samples.torque(replace(friction, theta=stepped))
            better = (left**2).sum(axis=0) < (off**2).sum(axis=0)
            theta = np.where(better[:, None], stepped, theta)
            off = np.where(better, left, off)
            damping = np.where(better, damping / growth, damping * growth)
            slopes = self.samples.slopes(replace(friction, theta=theta)) * self.free
            parts = [_solved(slopes[:, j], off[:, j], damping[j]) for j in range(friction.n)]
            change = np.stack(parts)
        return replace(friction, theta=theta)


@dataclass(frozen=True, eq=False, kw_only=True)
class CurveBlock(CombinationBlock):
    """Combinations of the changes of a curve, the same all through a fit."""

    numbers, with_numbers = FrictionBlock.numbers, FrictionBlock.with_numbers
    with_values = ParameterBlock.with_values


def _solved(slopes: Array, off: Array, damping: float) -> Array:
    """Damped least-squares solution (P,) of slopes (N, P) @ change = off (N,)."""
    left, size, right = np.linalg.svd(slopes, full_matrices=False)
    return right.T @ (size / (size**2 + (damping * size[0]) ** 2) * (left.T @ off))
