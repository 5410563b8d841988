"""The momentum observer: the torque that model and friction leave, sample by sample.

With the momentum p = M(q) w and the generalised force f = dL/dq + B u - A' Tf(A w), the torque from
outside is what makes the momentum differ from the force, through a filter of first order
[DeLuca2003], [Haddadin2017]:

    r' = K (p' - f - r)

Angles and torques pass the same quick filter of second order first, which gives the velocity; so
all lag alike, and by little where they enter the mechanics. The observer's filter is of second
order, too. Filters are integrated exactly: angles are joined by lines, torques held.
Beside the observer of the fit, members with other parameters run on the same samples: what they
differ by is what the fit's covariance makes of the torque.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.plants import Calibration
from frictionid.errors import InputError
from frictionid.fitting.fit import estimates_of
from frictionid.friction import Friction, Inputs, Memory
from frictionid.friction.coordinates import at_places
from frictionid.friction.provenance import Estimate
from frictionid.mechanics import Mechanism, Plant
from frictionid.programs.machine_code import compiled

from .pooled_models import place_of

SETTLING = 12.0  # over the rate [s]: what the filters forget of their start by
_QUICK = 6.0  # times the rate, that of the first filter
_GAP = 6.0  # over the rate [s]: between samples farther apart nothing is known
# An angle jumps, as where an encoder is set anew, that moves so many times faster than
# ever before, and so far in one interval [rad or m].
_JUMP, _FAR = 10.0, 0.1


class Members(NamedTuple):
    """Parameters of S members, the fit's first.

    theta (S, m, P); base (S, nb); gain, bias, offset (S, n); delay (S,) [s]
    """

    theta: Array
    base: Array
    gain: Array
    bias: Array
    offset: Array
    delay: Array


class State(NamedTuple):
    """What a stream remembers: the last sample, and the filters.

    time : of the last sample [s]; angle (n,) there
    begin : of the stream, after the last gap or jump [s]; fastest : (n,) so far, without jumps
    first, second : (2 n,), filters of angles and torques; momentum, force : (S, n)
    stick : (n,), share of friction that rest leaves open; memory : of the friction's law
    slower, torque : (S + 2, n), the observer's filter, of the members' torques, of `stick`, and of
        `opposing`
    """

    time: float
    angle: Array
    begin: float
    fastest: Array
    first: Array
    second: Array
    momentum: Array
    force: Array
    stick: Array
    memory: Memory
    slower: Array
    torque: Array


class Observed(NamedTuple):
    """What the observer says of K samples.

    time (K,); torque (K, n) [N m] by the fit; spread (K, n) [N m], of the members about it
    stick (K, n) [N m]; M (K, n, n) [kg m^2], which makes torques of the angles' noise
    opposing (K, n) [N m], what the level of friction does where a joint slides
    begin (K,) of the stream, after the last gap or jump [s]; settled (K,) of bool
    """

    time: Array
    torque: Array
    spread: Array
    stick: Array
    M: Array
    begin: Array
    settled: Array
    opposing: Array


class MomentumObserver(NamedTuple):
    """Settings of a momentum observer.

    Attributes
    ----------
    friction : Friction
        Its law; parameters are those of the members.
    plant : Plant
        Of the machine as it is; base parameters are those of the members.
    members : Members
    rate : float
        K [1/s], of the observer's filter; that of the first one is six times as high.
    slow : array, shape (m,)
        Speed below which friction may be anything up to `level` [rad/s]; about a reversal, what
        the filters' lag makes of the velocity comes on top.
    level : array, shape (m,)
        Friction there [N m].
    """

    friction: Friction
    plant: Plant
    members: Members
    rate: float
    slow: Array
    level: Array

    def start(self, time: float, angle: Array, torque: Array) -> State:
        """State at the first sample: at rest, with its torque (n,)."""
        S, n = self.members.gain.shape
        held = np.concatenate([angle, torque])
        nothing, out = np.zeros((S, n)), np.zeros((S + 2, n))
        x = self._inputs(held[None], np.zeros((1, n)))
        memory = self.friction.law.start(self.members.theta, x)
        zero = nothing[0]
        filters = held, held, nothing, nothing, zero, memory, out, out
        state = State(time, angle, time, zero, *filters)
        momentum, force, stick, *_ = self._forces(held[None], held[None], state, np.zeros(1))
        return state._replace(momentum=momentum[0], force=force[0], stick=stick[0])

    def advance(
        self, state: State, time: Array, angle: Array, torque: Array
    ) -> tuple[State, Observed]:
        """The state after more samples, and what they say.

        Parameters
        ----------
        state : State
        time, angle : arrays, shapes (K,) and (K, n)
            Of the samples after the last one.
        torque : array, shape (K, n)
            Mean of the logged torque over the interval before each sample.

        Raises
        ------
        InputError
            Where time does not increase.
        """
        dt = np.diff(np.concatenate([[state.time], time]))
        if not (dt > 0).all():
            k = int(np.argmax(~(dt > 0)))
            raise InputError(
                f"time = {time[k]:g} s comes after {time[k] - dt[k]:g} s: it must increase"
            )
        last = np.concatenate([state.angle[None], angle[:-1]])
        ends = np.column_stack([last, torque]), np.column_stack([angle, torque])
        first, second = _filtered(*ends, dt, self.quick, state.first, state.second)
        momentum, force, stick, M, memory = self._forces(first, second, state, dt)
        before = np.concatenate([state.momentum[None], momentum[:-1]])
        mean = (np.concatenate([state.force[None], force[:-1]]) + force) / 2
        left = (momentum - before) / dt[:, None, None] - mean
        open_share = (np.concatenate([state.stick[None], stick[:-1]]) + stick) / 2
        w, A = self.quick * (first - second)[:, : angle.shape[1]], self.plant.mechanism.friction_map
        opposing = -(self.level * np.sign(w @ A.T)) @ A
        both = np.concatenate([left, open_share[:, None], opposing[:, None]], axis=1)
        slower, out = _filtered(both, both, dt, self.rate, state.slower, state.torque)
        jumps, fastest = _jumps(np.abs(angle - last), dt, state.fastest)
        anew = jumps | (dt > _GAP / self.rate)
        begin = np.maximum.accumulate(np.where(anew, time, state.begin))
        settled = time - begin >= SETTLING / self.rate
        after = State(
            float(time[-1]),
            angle[-1],
            float(begin[-1]),
            fastest,
            first[-1],
            second[-1],
            momentum[-1],
            force[-1],
            stick[-1],
            memory,
            slower[-1],
            out[-1],
        )
        spread = np.sqrt(((out[:, 1:-2] - out[:, :1]) ** 2).sum(axis=1))
        said = Observed(time, out[:, 0], spread, out[:, -2], M, begin, settled, out[:, -1])
        return after, said

    @property
    def quick(self) -> float:
        """Rate of the first filter [1/s]."""
        return _QUICK * self.rate

    def _forces(
        self, first: Array, second: Array, state: State, dt: Array
    ) -> tuple[Array, Array, Array, Array, Memory]:
        """Momentum and force (K, S, n), friction (K, n) left open, M (K, n, n), and the memory."""
        n, members = len(state.angle), self.members
        w, rising = np.split(self.quick * (first - second), [n], axis=1)
        M, momentum, slope = self._momentum(second[:, :n], w)
        logged = second[:, None, n:] - members.delay[:, None] * rising[:, None]
        motors = self.plant.mechanism.motors
        driven = (members.gain * logged + members.bias) * motors
        x = self._inputs(second, w)
        Tf, memory = self._friction(x, state.memory, dt)
        A = self.plant.mechanism.friction_map
        last = self.quick * (state.first - state.second)[None, :n]
        change = np.abs(np.diff(np.concatenate([last, w]), axis=0)) @ np.abs(A).T
        within = self.slow + change / (self.quick * np.maximum(dt, 1e-9))[:, None]
        stick = (self.level * np.exp(-((x.w / within) ** 2))) @ np.abs(A)
        return momentum, slope + driven - Tf @ A, stick, M, memory

    def _momentum(self, q: Array, w: Array) -> tuple[Array, Array, Array]:
        """M (K, n, n) of the fit, momentum and dL/dq (K, S, n); the same machines share these."""
        members, mechanism = self.members, self.plant.mechanism
        machines = np.column_stack([members.base, members.offset])
        different, which = np.unique(machines, axis=0, return_inverse=True)
        nb = members.base.shape[1]
        p, offset = different[None, :, :nb], different[None, :, nb:]
        at = q[:, None] - offset
        terms = mechanism.terms(p, at, np.broadcast_to(w[:, None], at.shape))
        which = np.ravel(which)
        M = np.broadcast_to(terms.M, (*at.shape, at.shape[-1]))[:, which[0]]
        return M, terms.momentum[:, which], terms.dLdq[:, which]

    def _inputs(self, second: Array, w: Array) -> Inputs:
        """What friction depends on, (K, m): by the fit's calibration."""
        n, members, plant = w.shape[1], self.members, self.plant
        q = second[:, :n] - members.offset[0]
        u = (members.gain[0] * second[:, n:] + members.bias[0]) * plant.mechanism.motors
        load = plant.load(q, w, u) if self.friction.law.uses_load else u
        return at_places(plant.mechanism, Inputs(q, w, u, load))

    def _friction(self, x: Inputs, memory: Memory, dt: Array) -> tuple[Array, Memory]:
        """Friction (K, S, m) along samples, and the memory after them."""
        law, theta = self.friction.law, self.members.theta
        if not law.has_memory:
            return law.torque(theta, x.each(lambda values: values[:, None]), ()), ()
        out = []
        for k, step in enumerate(dt):
            now = x.each(lambda values, k=k: values[k : k + 1])  # (1, m), for all members
            memory = law.advance(theta, now, memory, np.full((1, 1), step)) if step > 0 else memory
            out.append(law.torque(theta, now, memory))
        return np.stack(out), memory


def _jumps(step: Array, dt: Array, fastest: Array) -> tuple[Array, Array]:
    """In which intervals (K,) an angle jumps, by steps (K, n), and the fastest speed (n,) then."""
    jumps = np.zeros(len(dt), dtype=bool)
    for k, speed in enumerate(step / dt[:, None]):
        jump = (step[k] > _FAR) & (speed > _JUMP * fastest)
        jumps[k] = jump.any()
        fastest = np.where(jump, fastest, np.maximum(fastest, speed))
    return jumps, fastest


def _filtered(
    begin: Array, end: Array, dt: Array, rate: float, x: Array, y: Array
) -> tuple[Array, Array]:
    """Both stages (K, ...) of a critically damped filter, under inputs linear over each dt.

    begin, end : inputs (K, ...) at the ends of each interval; x, y : both stages (...) before
    """
    flat = (np.ascontiguousarray(a).reshape(len(dt), -1) for a in (begin, end))
    out = _stages(*flat, np.exp(-rate * dt), rate * dt, x.ravel(), y.ravel())
    return out[0].reshape(begin.shape), out[1].reshape(begin.shape)


@compiled
def _stages(begin: Array, end: Array, decay: Array, step: Array, x: Array, y: Array) -> Array:
    """Stages (2, K, m) of the filter, sample by sample, from those before, x and y (m,)."""
    out = np.empty((2, *begin.shape))
    for k in range(len(begin)):
        for i in range(len(x)):
            a, b = begin[k, i], end[k, i]
            before = (x[i], y[i]) if k == 0 else (out[0, k - 1, i], out[1, k - 1, i])
            lag = (b - a) / step[k]
            off = before[0] - a + lag
            out[0, k, i] = b - lag + decay[k] * off
            out[1, k, i] = b - 2.0 * lag + decay[k] * (before[1] - a + 2.0 * lag + step[k] * off)
    return out


# --- Members: the fit, and one for each direction of its covariance -------------------------------

_SENSORS = ("gain", "bias", "offset", "delay")


def members_of(friction: Friction, mechanism: Mechanism, base: Array) -> Members:
    """The fit's parameters first, then those a standard deviation off, in independent directions.

    Directions are of the covariance of a fit by shooting or inverse dynamics, of the intervals of
    one in one step, and of the masses' tolerances where the fit held these.

    Parameters
    ----------
    friction : Friction, theta (n, P)
    mechanism : Mechanism
    base : array, shape (nb,)
        Base parameters of the machine, by the fit's calibration.
    """
    c = friction.calibration or Calibration.ideal(mechanism.n)
    numbers = (friction.theta, base, c.gain, c.bias, c.offset, c.delay)
    middle = Members(*(np.asarray(x, dtype=float) for x in numbers))
    every = [middle, *_off(middle, friction, mechanism)]
    members = Members(*(np.stack(column) for column in zip(*every, strict=True)))
    low, high = np.array(friction.law.bounds, dtype=float).reshape(-1, 2).T
    return members._replace(theta=np.clip(members.theta, low, high))


def _off(middle: Members, friction: Friction, mechanism: Mechanism) -> Iterator[Members]:
    """Members that are off by a standard deviation in each direction."""
    estimates, root = _directions(friction)
    for row in root.T:
        off = Members(*(np.array(values, dtype=float) for values in middle))
        for e, size in zip(estimates, row, strict=True):
            place = place_of(friction, e.block, e.parameter, e.joint)
            if place is not None:
                off.theta[place] += size
            elif e.block == "inertia":
                off.base[mechanism.base_names.index(e.name)] += size
            elif e.block in _SENSORS:  # those of servos change no torque that is logged
                values = getattr(off, e.block)
                values[() if e.joint is None or values.ndim == 0 else e.joint] += size
        yield off
    if not any(e.block == "inertia" for e in estimates):
        tolerances = mechanism.base_tolerances()
        for i in np.flatnonzero(np.isfinite(tolerances)):
            heavier = middle.base.copy()
            heavier[i] += tolerances[i]
            yield middle._replace(base=heavier)


def _directions(friction: Friction) -> tuple[Sequence[Estimate], Array]:
    """Estimates that have an error, and a root (D, k) of their covariance."""
    estimates, refined = estimates_of(friction), friction.provenance.refined
    covariance = np.diag([e.error**2 for e in estimates]).reshape(2 * [len(estimates)])
    if refined is not None and len(refined.parameters) == len(estimates):
        covariance = refined.square(refined.covariance)
    finite = np.isfinite(covariance).all(axis=1) & (np.diag(covariance) > 0)
    value, vector = np.linalg.eigh(covariance[np.ix_(finite, finite)])
    keep = value > 0
    kept = [e for e, k in zip(estimates, finite, strict=True) if k]
    return kept, vector[:, keep] * np.sqrt(value[keep])
