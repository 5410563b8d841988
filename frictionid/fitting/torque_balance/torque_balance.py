"""Balance of torques over short windows of recordings, linear in the base parameters.

The momentum balance over a window from a to b, divided by its length T,

    Y p + mean Tf = mean u,    Y p = (M w|b - M w|a - integral of dL/dq dt) / T    [N m]

needs no acceleration. Each joint has its own row, in which only its own friction stands and that of
parts that turn with it. Six more rows are of a floating base whose wrench is known, as in flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, rms, usual_step
from frictionid.data.integrals import (
    SignalIntegrals,
    integrals_of,
    moving_average,
    pieces_of,
    window_means,
)
from frictionid.data.joint_scales import are_mixed
from frictionid.data.plants import on_recorded_base, plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import sample
from frictionid.data.state_estimators import States, slowest_speeds
from frictionid.errors import InputError
from frictionid.friction import Inputs, Nodes, joined
from frictionid.friction.coordinates import recorded_inputs, with_places
from frictionid.mechanics import Plant
from frictionid.mechanics.plant import base_motion_of, with_base_motion, with_midpoints
from frictionid.mechanics.rigid_body.rigid_body_tree import WRENCH, RigidBodyTree, with_free_base

from ..one_step.residual import GAP, IN_TURN, Problem, stiction_mask

_SLOW_ROWS = 0.01  # of the rows of a joint: so many may be slower than the slowest speed
_NODES = 4000  # whose regressor is computed at a time,
_NUMBERS = 20_000_000  # and parameters of these
_NO_WRENCH = 1e-9  # of the largest singular value


class BaseWrench(NamedTuple):
    """Balance of forces and moments on a floating base: six rows that have no friction in them.

    With the base's own ten parameters, and with what the joints' torques do not tell of the bodies,
    the momentum of all bodies and the known wrench balance over each of K windows,

        Y p + Z b = wrench.

    b is eliminated, so that the rows only add to what is known of the base parameters p.

    regressor : Y (K, 6, nb); nuisance : Z (K, 6, B); wrench : (K, 6), mean of each window
    """

    regressor: Array
    nuisance: Array
    wrench: Array

    def left(self, base: Array) -> Array:
        """What base parameters (K, nb) leave of the known wrench, (K, 6)."""
        return self.wrench - np.einsum("kib,kb->ki", self.regressor, base)

    def eliminated(self, use: Array) -> "BaseWrench":
        """The rows of windows in use (K,), others are zero, with b eliminated.

        In units of what the bodies usually need, (6,).
        """
        K = int(use.sum())
        size = np.sqrt((self.regressor[use] ** 2).sum(axis=2).mean(axis=0))[:, None] + 1e-300
        rows = np.concatenate([self.regressor, self.wrench[..., None]], axis=2)[use] / size
        U, s, _ = np.linalg.svd((self.nuisance[use] / size).reshape(6 * K, -1), full_matrices=False)
        Q, flat = U[:, s > _NO_WRENCH * s.max(initial=0.0)], rows.reshape(6 * K, -1)
        out = np.zeros((len(use), 6, rows.shape[2]))
        out[use] = (flat - Q @ (Q.T @ flat)).reshape(rows.shape)
        return BaseWrench(out[..., :-1], self.nuisance[..., :0], out[..., -1])


@dataclass(frozen=True, eq=False)
class TorqueBalance:
    """Rows of K windows and n joints.

    dataset; nodes : where friction acts; stencil (K, m) and coefficients (m,) of the windows' means
    regressor : Y (K, n, nb), torques for each base parameter
    base : (K, nb), what a recording's own parameters add to the base parameters
    recording, start, stop : (K,), start and stop in [s]
    slides : (K, n), whether the joint moves one way, fast enough, all the time: others do not count
    slowest : (R, m) [rad/s], slowest speeds that the rows of each recording resolve
    use : (K,), windows that may be used
    slow : moving averages of the logged torques over the length of a window; fast (K, n) : means
        of what these torques have beyond them
    wrench : rows of the base, or None
    """

    dataset: Dataset
    nodes: Nodes
    stencil: Array
    coefficients: Array
    regressor: Array
    base: Array
    recording: Array
    start: Array
    stop: Array
    slides: Array
    slowest: Array
    use: Array
    slow: SignalIntegrals
    fast: Array
    wrench: BaseWrench | None = None

    def logged(self, delay: Array) -> tuple[Array, Array]:
        """Means (K, n) of the torque logged `delay` [s] before, and derivatives by the delay.

        A delay shifts moving averages: the noise of the samples at both ends of a window would
        be in the derivatives as it is in the means, and make delays too short.
        """
        edges = np.stack([self.start, self.stop], axis=1) - delay
        slow = pieces_of(self.slow, self.recording, edges)
        return self.fast + slow.mean[0], slow.mean_later[0]

    @property
    def problem(self) -> Problem:
        """The windows as a problem whose residual is the negative mean of friction [N m]."""
        return self.problem_of(np.zeros(self.slides.shape))

    def problem_of(self, needed: Array) -> Problem:
        """The windows as a problem of friction that needs mean torques (K, n) [N m]."""
        K, n = self.slides.shape
        eye = np.broadcast_to(np.eye(n), (K, n, n))
        needed, G = with_places(self.dataset.mechanism, needed, eye)
        rows = (self.recording, self.start, self.stop - self.start)
        return Problem(
            *(self.nodes, needed, G, self.stencil, self.coefficients, *rows), slowest=self.slowest
        )

    def sliding_problem(self, needed: Array) -> Problem:
        """`problem_of` with the rows of joints at rest projected out.

        Where some joints turn and others slide, rows are in units of their joint's usual torque.
        """
        problem = self.problem_of(np.where(self.slides, needed, 0.0))
        G, r, n = np.array(problem.G), np.array(problem.r), self.slides.shape[1]
        G[:, :n] *= self.slides[:, :, None]
        if are_mixed(self.dataset.mechanism.position_units):
            usual = rms(r[:, :n], axis=0)
            usual = np.where(usual > 0, usual, 1.0)
            r[:, :n], G[:, :n] = r[:, :n] / usual, G[:, :n] / usual[:, None]
        return replace(problem, r=r, G=G, masked=True)

    def resolving(self, use: Array) -> "TorqueBalance":
        """The balance of windows in use (K,), with the slowest speeds that these resolve.

        What only the base shows is eliminated from its rows.
        """
        wrench = self.wrench and self.wrench.eliminated(use)
        slowest = _slowest(self, self.slides & use[:, None])
        return replace(self, use=use, slowest=slowest, wrench=wrench)

    def with_loads(self, base: Array) -> "TorqueBalance":
        """The balance with the loads of gears by base parameters (nb,)."""
        dataset, inputs, first = self.dataset, self.nodes.inputs, self.nodes.first
        plant, n, parts = plant_of(dataset), dataset.mechanism.n, []
        plant = replace(plant, p=base + plant.p - dataset.mechanism.nominal_base)
        for i, rows in enumerate(map(slice, first[:-1], first[1:])):
            q, w, u = (x[rows, :n] for x in (inputs.q, inputs.w, inputs.u))
            time = self.nodes.time[rows]
            machine = on_recorded_base(plant[i], dataset.recordings[i], time)
            temperature = dataset.recordings[i].temperature_at(time, dataset.mechanism.joints)
            parts.append(recorded_inputs(machine, time, q, w, u, temperature))
        return replace(self, nodes=self.nodes._replace(inputs=joined(parts)))

    def where(self, keep: Array) -> "TorqueBalance":
        """The balance of some of the windows, (K,)."""
        names = (
            "stencil",
            "regressor",
            "base",
            "recording",
            "start",
            "stop",
            "slides",
            "fast",
            "use",
        )
        return replace(self, **{name: getattr(self, name)[keep] for name in names})

    @property
    def counts(self) -> Array:
        """Rows (K, n), or (K, n + 6), that count."""
        rows = self.slides & self.use[:, None]
        if self.wrench is None:
            return rows
        return np.concatenate([rows, np.repeat(self.use[:, None], len(WRENCH), axis=1)], axis=1)


def torque_balance(
    dataset: Dataset, states: Sequence[States], window: float, node_time: float
) -> TorqueBalance:
    """Balance of torques of a data set along its smoothed states.

    window : [s], length of the windows; node_time : [s], shortest time between samples in use

    Raises
    ------
    InputError
        Where no recording is as long as a window.
    """
    plant = plant_of(dataset)
    counts = [_counts(s, window, node_time) for s in states]
    most = max((count for _, count in counts), default=1)
    parts = [
        _part(plant[i], s, recording, step, most)
        for i, (s, recording, (step, _)) in enumerate(
            zip(states, dataset.recordings, counts, strict=True)
        )
    ]
    inputs, time, stencils, regressors, start, stop, wrenches = zip(*parts, strict=True)
    if not any(map(len, start)):
        raise InputError(
            f"data set {dataset.name!r}: no recording is as long as a window of {window:g} s: "
            "shorten the window"
        )
    first = np.cumsum([0, *map(len, time)])
    stencil = np.concatenate([s + f for s, f in zip(stencils, first[:-1], strict=True)])
    recording = np.repeat(np.arange(len(parts)), list(map(len, start)))
    windows = recording, np.concatenate(start), np.concatenate(stop)
    nominal, torques = plant.mechanism.nominal_base, [r.torque for r in dataset.recordings]
    slow = integrals_of([moving_average(torque, window) for torque in torques])
    balance = TorqueBalance(
        dataset,
        Nodes(joined(inputs), np.concatenate(time), first, 2),
        stencil,
        _simpson(most),
        np.concatenate(regressors),
        (plant.p - nominal)[recording],
        *windows,
        np.zeros((len(stencil), plant.n), dtype=bool),
        np.stack([slowest_speeds(s) for s in states]) @ np.abs(plant.mechanism.friction_map).T,
        np.ones(len(stencil), dtype=bool),
        slow,
        window_means(integrals_of(torques), *windows) - window_means(slow, *windows),
        _joined_wrenches(wrenches),
    )
    resting = stiction_mask(balance.problem, None, IN_TURN)
    slides = ~(resting @ (plant.mechanism.friction_map != 0))
    balance = replace(balance, slides=slides, slowest=_slowest(balance, slides))
    # what rests shows nothing, but to the base
    return balance if balance.wrench else balance.where(slides.any(axis=1))


def _slowest(balance: TorqueBalance, counts: Array) -> Array:
    """Slowest speeds (R, m) that each recording resolves in the rows that count (K, n).

    What sets in below the speeds of these rows leaves no trace: friction that falls off there would
    be of any size. Of a part they are no less than those of all but 1 % of its rows.
    """
    least = np.abs(balance.nodes.inputs.w[balance.stencil]).min(axis=1)
    shows = counts @ (balance.dataset.mechanism.friction_map != 0).T
    out = np.array(balance.slowest)
    for i, k in np.ndindex(*out.shape):
        speeds = least[(balance.recording == i) & shows[:, k], k]
        out[i, k] = max(out[i, k], np.quantile(speeds, _SLOW_ROWS)) if len(speeds) else out[i, k]
    return out


def _counts(states: States, window: float, node_time: float) -> tuple[int, int]:
    """Samples from one node to the next, and such steps in a window."""
    dt = usual_step(states.time)
    step = max(1, int(node_time / dt + 1e-9))
    return step, max(1, round(window / (step * dt)))


def _simpson(count: int) -> Array:
    """Coefficients (2 count + 1,) of the mean over equal steps with a midpoint each."""
    c = np.tile([2.0, 4.0], count + 1)[: 2 * count + 1]
    c[0] = c[-1] = 1.0
    return c / c.sum()


def _part(
    plant: Plant, states: States, recording: Recording, step: int, count: int
) -> tuple[Inputs, Array, Array, Array, Array, Array, BaseWrench | None]:
    """Nodes of a recording, and its windows of `count` steps from each to the next.

    Inputs and times of the nodes; stencil, regressor, start, stop and wrench of the windows.
    """
    at = np.arange(0, len(states.time), step)
    time, q, w = with_midpoints(states.time[at], states.q[at], states.w[at])
    plant = on_recorded_base(plant, recording, time)
    temperature = recording.temperature_at(time, plant.mechanism.joints)
    u = sample(recording.torque, time)
    inputs = recorded_inputs(plant, time, q, w, u, temperature)
    dt = np.diff(states.time[at])
    broken = np.concatenate([[0], np.cumsum(dt > GAP * np.median(dt))])
    first = np.arange(0, len(at) - count, count)
    first = first[broken[first] == broken[first + count]]
    stencil = 2 * first[:, None] + np.arange(2 * count + 1)
    rows = _regressors(plant, time, q, w, stencil)
    start, stop = time[stencil[:, 0]], time[stencil[:, -1]]
    wrench = None
    if recording.base_wrench is not None and isinstance(plant.mechanism, RigidBodyTree):
        log = integrals_of([recording.base_wrench])
        wrench = _wrench(plant, plant.mechanism, (time, q, w), stencil, log)
    return inputs, time, stencil, rows, start, stop, wrench


def _wrench(
    plant: Plant,
    mechanism: RigidBodyTree,
    motion: tuple[Array, Array, Array],
    stencil: Array,
    log: SignalIntegrals,
) -> BaseWrench:
    """Rows of the base of a recording, with the logged wrench on it."""
    time, free = motion[0], with_free_base(mechanism)
    q, w = (np.pad(x, ((0, 0), (len(WRENCH), 0))) for x in motion[1:])
    whole = Plant(free, {}, np.zeros(len(free.base_names)))
    whole = whole.on_base(base_motion_of(plant.p, len(mechanism.base_names)))
    edges = time[stencil[:, [0, -1]]]
    mean = pieces_of(log, np.zeros(len(edges), dtype=int), edges).mean[0]
    rows, reduction = _regressors(whole, time, q, w, stencil)[:, : len(WRENCH)], mechanism.reduction
    leading = rows[..., 10 + reduction.leading]
    nuisance = rows.copy()
    nuisance[..., 10:] -= leading @ reduction.regrouping
    return BaseWrench(leading, nuisance, mean)


def _joined_wrenches(parts: Sequence[BaseWrench | None]) -> BaseWrench | None:
    """Rows of all recordings; None unless all have them."""
    whole = [part for part in parts if part is not None]
    if len(whole) < len(parts):
        return None
    return BaseWrench(*map(np.concatenate, zip(*whole, strict=True)))


def _regressors(plant: Plant, time: Array, q: Array, w: Array, stencil: Array) -> Array:
    """Y (k, n, nb) of all windows, some at a time."""
    count = len(plant.mechanism.base_names)
    rows = [np.zeros((0, plant.n, count))]
    nodes = min(_NODES, _NUMBERS // count**2)
    for part in np.array_split(stencil, max(1, stencil.size // nodes)):
        rows += [_regressor(plant, time, q, w, part)] if len(part) else []
    return np.concatenate(rows)


def _regressor(plant: Plant, time: Array, q: Array, w: Array, stencil: Array) -> Array:
    """Y (k, n, nb) of some windows that follow each other."""
    low, high = stencil[0, 0], stencil[-1, -1] + 1
    count = len(plant.mechanism.base_names)
    motion = base_motion_of(plant.p, count)
    motion = None if motion is None else motion[low:high]
    each = with_base_motion(np.eye(count)[:, None], motion)
    terms = plant.mechanism.terms(each, q[low:high], w[low:high])
    first, last = stencil[:, 0] - low, stencil[:, -1] - low
    change = terms.momentum[:, last] - terms.momentum[:, first]
    mean = np.einsum("m,bkmn->bkn", _simpson(stencil.shape[1] // 2), terms.dLdq[:, stencil - low])
    length = (time[stencil[:, -1]] - time[stencil[:, 0]])[:, None]
    return np.moveaxis(change / length - mean, 0, -1)
