"""Prediction in closed loop: a servo's controller acts on the predicted motion.

Its torque is piecewise linear in the motion, see `Controller`. In each piece of a sample interval

    u = A - K q - B w

where the motion that is expected in the middle says what a limit holds; the command is that of the
targets there. K and B are the feedback of the physics step.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, times
from frictionid.data.integrals import integrals_of, pieces_of
from frictionid.data.servo import Controller, Linear, Servo
from frictionid.friction import Friction
from frictionid.friction.coordinates import resting_parts, turns_of
from frictionid.mechanics import Plant

from .rollout import MANY, ahead, begin, frozen, masked, sampled
from .state import Instant, State
from .step_size import StepSize, step_size_of
from .torque_balance import inverse_of_free

_PIECE = 4e-3  # [s], in which a limit holds or does not
_VARIES = ("command", "share", "scale")  # of a controller with time


class Controllers(NamedTuple):
    """Servos that drive S motions in pieces of T sample intervals, P pieces in all.

    owner (P,) : interval of each piece; dt (P, S) [s]; controller : arrays (P, S, n), or (1, S, n)
    of what stays the same, its command the mean of a piece; moment (P, S, n) : of the command, see
    `pieces_of`; delay (S, 1) [s]; play (S, n) [rad] : by which encoders lag at first; half (S, n) :
    of the backlash
    """

    owner: Array
    dt: Array
    controller: Controller
    moment: Array
    delay: Array
    play: Array
    half: Array

    def linear(self, k: int, q: Array, w: Array) -> Linear:
        """Torques (S, n) of a piece at a motion as encoders show it."""
        arrays = map(np.asarray, self.controller)
        return Controller(*(x[k % len(x)] for x in arrays)).linear(q, w)

    @property
    def stiffest(self) -> Array:
        """Largest feedback (2, n) at any time."""
        free = self.controller._replace(limit=np.inf, most=np.inf, stall=np.inf)
        zero = 0.0 * self.moment
        K, B = np.moveaxis(np.abs(free.linear(zero, zero).feedback), -2, 0)
        B = np.maximum(B, self.controller.scale * self.controller.slope)
        return np.stack([K.max(axis=(0, 1)), B.max(axis=(0, 1))])


def controllers_of(servos: Sequence[Servo], time: Array, play: Array | None = None) -> Controllers:
    """Controllers of the servos of S motions whose samples are at times (T + 1, S) [s].

    play : (S, n) [rad] by which their encoders lag at first, in the middle of the backlash if None
    """
    dt = np.diff(time, axis=0)
    count = np.maximum(np.ceil(dt.max(axis=1) / _PIECE - 1e-9), 1.0).astype(int)
    owner = np.repeat(np.arange(len(dt)), count)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)) / count[owner]
    edges = np.concatenate([time[owner] + dt[owner] * share[:, None], time[-1:]])
    n = servos[0].goal.value.shape[1]
    shape = len(servos), n
    moment = np.empty((len(owner), *shape))
    fields = [np.empty((len(owner) if x in _VARIES else 1, *shape)) for x in Controller._fields]
    for servo in {id(s): s for s in servos}.values():
        rows = np.flatnonzero([s is servo for s in servos])
        along, moment[:, rows] = _along(servo, edges[:, rows])
        for whole, part in zip(fields, along, strict=True):
            whole[:, rows] = part
    half = np.array([s.backlash / 2 + np.zeros(n) for s in servos])
    delay = np.array([[s.delay] for s in servos])
    play = np.zeros_like(half) if play is None else play
    part = np.diff(edges, axis=0)
    return Controllers(owner, part, Controller(*fields), moment, delay, play, half)


def _along(servo: Servo, edges: Array) -> tuple[Controller, Array]:
    """Controller between edges (P + 1, k) [s], and the moment (P, k, n) of its command."""
    then = edges - servo.delay
    middle = (then[1:] + then[:-1]) / 2
    (P, k), n = middle.shape, servo.goal.value.shape[1]
    mean, moment = np.zeros((2, P, k, n))
    for factor, target in servo.targets:
        log = integrals_of([target._replace(time=target.time + servo.target_delay)])
        pieces = pieces_of(log, np.zeros(k, dtype=int), then.T)
        mean, moment = mean + factor * pieces.mean, moment + factor * pieces.moment
    at = servo.at(middle.ravel())
    share, scale = (
        np.reshape(x, (P, k, -1)) if np.ndim(x) == 2 else x for x in (at.share, at.scale)
    )
    return at._replace(command=mean, share=share, scale=scale), moment


# State, the state a piece before, and the play (S, n) of encoders.
_Motion = tuple[State, State, Array]


def closed_loop(
    plant: Plant,
    friction: Friction,
    start: State,
    controllers: Controllers,
    temperature: Array | None = None,
    base_motion: Array | None = None,
) -> State:
    """Motion from start states (S, n) under servos that act on it; NaN after a divergence.

    plant, friction : with one entry for each start, or one for all
    temperature : (T, S, m) [degC] of parts with friction in each interval, for laws that need it
    base_motion : (T, S, 9) of a floating base in each interval, see `Plant.on_base`
    """
    first = np.searchsorted(controllers.owner, np.arange(controllers.owner[-1] + 2)).tolist()
    stiffest = replace(plant, feedback=controllers.stiffest)
    T = temperature  # the coldest and the hottest
    T = None if T is None else np.stack([T.min(axis=0), T.max(axis=0)])
    size = step_size_of(stiffest, friction.at_temperature(T), float(controllers.dt.max()))
    state, before, play = start, start, controllers.play
    alive, q, w = None, [start.q], [start.w]
    for k, pieces in enumerate(pairwise(first)):
        there = friction if temperature is None else friction.at_temperature(temperature[k])
        plant = plant if base_motion is None else plant.on_base(base_motion[k])
        with np.errstate(all="ignore"):  # a diverging motion overflows before it is frozen
            state, before, play = _after_sample(
                plant, there, controllers, range(*pieces), (state, before, play), size
            )
        state, alive = frozen(plant, state, alive)
        q.append(masked(state.q, alive))
        w.append(masked(state.w, alive))
    return State(np.stack(q), np.stack(w))


def _after_sample(
    plant: Plant,
    friction: Friction,
    drive: Controllers,
    pieces: range,
    motion: _Motion,
    size: StepSize,
) -> _Motion:
    """Motion after the pieces of a sample interval, whose end a memory of samples takes in."""
    state, before, play = motion
    many = len(drive.dt) * len(state.q) >= MANY
    for piece in pieces:
        dt = drive.dt[piece]
        loop, u, moment = _loop_at(plant, drive, piece, (state, before, play))
        now = Instant(loop, friction, state, u)
        before = begin(now, dt)
        state = ahead(now._replace(state=before), dt, size, many)
        state = _displaced(loop, state, moment, dt[:, None])
        play = np.clip(play + state.q - before.q, -drive.half, drive.half)
    since = drive.dt[pieces.start : pieces.stop].sum(axis=0)
    return sampled(now._replace(state=state), since[:, None]), before, play


def _loop_at(
    plant: Plant, drive: Controllers, piece: int, motion: _Motion
) -> tuple[Plant, Array, Array]:
    """The plant with the feedback of a piece, its torque A, and the moment (S, n) of that."""
    state, before, play = motion
    w = state.w + (state.w - before.w) / 2  # those expected in the middle
    q = state.q + w * drive.dt[piece][:, None] / 2
    at = drive.linear(piece, q - play - drive.delay * w, w)
    motors = plant.mechanism.motors
    K, B = np.moveaxis(at.feedback * motors, -2, 0)
    B = B - drive.delay * K
    u = at.torque * motors + K * q + B * w
    loop = replace(plant, feedback=np.stack([K, B], axis=-2))
    return loop, u, at.by_command * motors * drive.moment[piece]


def _displaced(plant: Plant, state: State, moment: Array, dt: Array) -> State:
    """The state after dt (S, 1) moved by M^-1 moment (S, n), as A varies about its mean.

    The feedback acts on that, too: its impulse is that of (B + K dt/2) on the way.
    """
    if plant.feedback is None or not moment.any():
        return state
    turns = turns_of(plant.mechanism, state.q)
    M = plant.mechanism.inertia(plant.p, state.q)
    inner = inverse_of_free(M, resting_parts(state.w, turns) == 0.0, turns)
    way = times(inner, moment)
    K, B = np.moveaxis(plant.feedback, -2, 0)
    return state._replace(q=state.q + way, w=state.w - times(inner, (B + K * dt / 2) * way))
