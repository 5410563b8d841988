"""The shooting problem: intervals, free parameters, and their linearisation at an estimate."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse
from frictionid.data.integrals import pieces_of
from frictionid.data.plants import calibrated_dataset, calibrated_plant
from frictionid.data.signals import sample
from frictionid.dynamics.end_states import end_states, memory_after_sample
from frictionid.dynamics.law_derivatives import FreeTheta, LawReads, reads_of
from frictionid.dynamics.step_size import halved, step_size_of
from frictionid.dynamics.tangent import MotionModel, MotorTorque
from frictionid.friction import Inputs, Nodes, memory_at_nodes
from frictionid.friction.coordinates import at_places, of_last_joints
from frictionid.friction.law import check_temperature
from frictionid.mechanics import Plant

from ..parameter_block import (
    Estimate,
    FreeBlock,
    FreeParameters,
    Parameter,
    ParameterBlock,
    free_blocks,
    values_of,
)
from .networks import CurveCombinations
from .sample_intervals import Intervals
from .servo import Drive, changes_of, check_servo, drive_of, has_actuator
from .settings import Settings

_PIECE = 0.009  # [s], one at most without a joint near rest: half a sample at 60 Hz
_WHOLE = np.array([0.0, 1.0])  # an interval in one piece
NUMBERS = 1_000_000  # derivatives at a time, for the cache's sake; few rows cost as much as many


class Linearisation(NamedTuple):
    """End states (K, s) of intervals, their derivatives by_start (K, s, s) and by (K, s, D).

    `by` is by the free parameters; `angle` (D, n) : derivatives of the measured angle itself. Rows
    that are not used are zero.
    """

    end: Array
    by_start: Array
    by: Array
    angle: Array

    @staticmethod
    def zeros(nodes: Array, angle: Array) -> "Linearisation":
        """Zeros for intervals that begin at nodes (K, s)."""
        K, s = nodes.shape
        return Linearisation(
            np.zeros((K, s)), np.zeros((K, s, s)), np.zeros((K, s, len(angle))), angle
        )


# Entries (part, place) of theta, and base parameters, by which the step has derivatives.
Directions = tuple[tuple[tuple[int, ...], ...], tuple[int, ...]]


@dataclass(frozen=True, eq=False)
class ShootingProblem(FreeParameters):
    """What does not change while the free parameters are fitted to the intervals.

    directions : those of the free parameters or more, as machine code of others takes seconds
    """

    intervals: Intervals
    blocks: tuple[FreeBlock, ...]
    settings: Settings
    reads: LawReads
    directions: Directions

    @property
    def count(self) -> int:
        """Number of free parameters."""
        return self.blocks[-1].columns.stop if self.blocks else 0

    def without_shapes(self, estimate: Estimate) -> "ShootingProblem":
        """The problem with what shapes levels of friction held: memory, peaks, loads, velocities.

        Memory is not measured where a window begins, and short windows take bristles and peaks to
        where longer ones have no way back from.
        """
        blocks, values = [], values_of(estimate, self.blocks)
        for free in self.blocks:
            pairs = zip(free.parameters, values[free.columns], strict=True)
            held = tuple(
                p._replace(low=value, high=value) if p.is_velocity or np.isfinite(p.size) else p
                for p, value in pairs
            )
            blocks.append(free._replace(parameters=held))
        return replace(self, blocks=tuple(blocks))

    def linearise(self, estimate: Estimate, nodes: Array, rows: Array) -> Linearisation:
        """End states and derivatives of some intervals (k,) that begin at nodes (K, s)."""
        out, intervals = Linearisation.zeros(nodes, self._angle()), self.intervals
        plant = self._plant(estimate)
        drive = drive_of(intervals, estimate.calibration, estimate.mechanism)
        changes = changes_of(intervals, estimate, self.blocks, drive)
        drive = drive._replace(changes=tuple(changes))
        feedback = drive.loop and drive.loop.late
        model = self._model(estimate, plant)
        pieces = self._pieces(estimate, replace(plant, feedback=feedback), rows)
        has_samples = estimate.friction.law.sample_time is not None
        for count in np.unique(pieces):
            alike = rows[pieces == count]
            size = len(alike) * nodes.shape[1] * (nodes.shape[1] + self.count)
            for part in np.array_split(alike, max(1, -(-size // NUMBERS))):
                here = model._replace(plant=self._plant_at(estimate, plant, part, feedback))
                motor = self._motor_torque(estimate, drive, part, int(count))
                longest = float(intervals.dt[part].max()) / count
                parts = halved(longest / self.settings.fine)
                end, by = end_states(here, nodes[part], motor, intervals.dt[part], parts)
                if has_samples:
                    after = self._following(part)
                    later = self._torque_between(estimate, drive, after, _WHOLE)
                    here = model._replace(plant=self._plant_at(estimate, plant, after, feedback))
                    end, by = memory_after_sample(here, end, by, later, intervals.dt[part])
                out.end[part], out.by_start[part] = end, by[..., : nodes.shape[1]]
                by = self._by_parameters(by[..., nodes.shape[1] :])
                out.by[part, :, : by.shape[-1]] = by
        return out

    def refuse_too_steep(self, estimate: Estimate) -> None:
        """Raise NoFitError where the physics step cannot follow the friction of an estimate."""
        self._pieces(estimate, self._plant(estimate), np.arange(1))

    def initial_nodes(self, estimate: Estimate) -> Array:
        """Nodes (K, s) from the smoothed motion."""
        q, w = self.intervals.q - estimate.calibration.offset, self.intervals.w
        return np.concatenate([q, w, *self.initial_memory(estimate)], axis=-1)

    def initial_memory(self, estimate: Estimate) -> tuple[Array, ...]:
        """Memory (K, n) at the start of each interval, from the smoothed motion before it."""
        intervals, friction = self.intervals, estimate.friction
        if not friction.law.has_memory:
            return ()
        first = np.cumsum([0, *(len(s.time) for s in intervals.states)])
        dataset = intervals.dataset
        dataset = calibrated_dataset(dataset, estimate.calibration) if self.reads.u else dataset
        pairs = zip(dataset.recordings, intervals.states, strict=True)
        u = np.concatenate([sample(r.torque, s.time) for r, s in pairs])
        motions = [s.motion for s in intervals.states]
        time, q, w = (np.concatenate(column) for column in zip(*motions, strict=True))
        x = Inputs(q - estimate.calibration.offset, w, u, 0.0 * w)
        x = at_places(dataset.mechanism, x)
        memory = memory_at_nodes(friction, Nodes(x, time, first))
        return tuple(entry[first[intervals.recording] + intervals.index] for entry in memory)

    def _following(self, rows: Array) -> Array:
        """The intervals (k,) behind some, or these where none follows."""
        later = np.minimum(rows + 1, len(self.intervals.dt) - 1)
        return np.where(self.intervals.joined[later], later, rows)

    def _by_parameters(self, by: Array) -> Array:
        """Derivatives by the free parameters, from those in all directions, last axis."""
        theta, base = self.directions
        columns = [[theta.index(at) for at in p.places] for p in _entering(self.blocks, "friction")]
        columns += [[len(theta) + base.index(p.place[0])] for p in _entering(self.blocks, "base")]
        columns += [[k] for k in range(len(theta) + len(base), by.shape[-1])]
        flat = [k for several in columns for k in several]
        if len(columns) == len(flat):
            return by if flat == [*range(by.shape[-1])] else by[..., flat]
        first = np.cumsum([0, *map(len, columns[:-1])])
        return np.asarray(np.add.reduceat(by[..., flat], first, axis=-1))

    def _model(self, estimate: Estimate, plant: Plant) -> MotionModel:
        theta, base = self.directions
        joint, place = np.array(theta, dtype=int).reshape(-1, 2).T
        friction, free = estimate.friction, FreeTheta(joint, place)
        if isinstance(friction.law, CurveCombinations):
            free, friction = friction.law.free, friction.law.curve(friction)
        return MotionModel(plant, friction, free, base, self.reads)

    def _plant(self, estimate: Estimate) -> Plant:
        plant = calibrated_plant(self.intervals.dataset, estimate.calibration)
        # only bearing loads need the physical parameters
        return plant if estimate.friction.law.uses_load else replace(plant, parameters={})

    def _plant_at(
        self, estimate: Estimate, plant: Plant, rows: Array, feedback: Array | None
    ) -> Plant:
        """The plant of some intervals, with their temperature where friction depends on it."""
        plants, motion = plant[self.intervals.recording[rows]], self.intervals.base_motion
        plants = plants if motion is None else plants.on_base(motion[rows])
        if feedback is not None:
            plants = replace(plants, feedback=feedback[rows])
        if self.intervals.temperature is None or not estimate.friction.law.uses_temperature:
            return plants
        return replace(plants, temperature=self.intervals.temperature[rows])

    def _pieces(self, estimate: Estimate, plant: Plant, rows: Array) -> Array:
        """Pieces (k,) of some intervals."""
        longest = float(self.intervals.dt.max())
        friction, T = estimate.friction, self.intervals.temperature
        if friction.law.uses_temperature and T is not None:
            T = of_last_joints(plant.mechanism, np.stack([T.min(axis=0), T.max(axis=0)]))
            friction = friction.at_temperature(T)
        away = step_size_of(plant, friction, longest, longest=_PIECE).pieces / longest
        return rounded_up(np.maximum(np.ceil(self.intervals.dt[rows] * away - 1e-6), 1))

    def _motor_torque(
        self, estimate: Estimate, drive: Drive, rows: Array, pieces: int
    ) -> MotorTorque:
        """Motor torque of some intervals in equal pieces."""
        whole = self._torque_between(estimate, drive, rows, np.arange(pieces + 1) / pieces)

        def finer(part: Array, piece: int, parts: int) -> MotorTorque:
            share = (piece + np.arange(parts + 1) / parts) / pieces
            return self._torque_between(estimate, drive, rows[part], share)

        return whole._replace(finer=finer)

    def _torque_between(
        self, estimate: Estimate, drive: Drive, rows: Array, share: Array
    ) -> MotorTorque:
        """Motor torque of some intervals between shares (S + 1,) of their time."""
        intervals, calibration = self.intervals, estimate.calibration
        recording, driven = intervals.recording[rows], estimate.mechanism.motors
        offset, loop = calibration.offset, drive.loop
        edges = intervals.time[rows, None] + intervals.dt[rows, None] * share
        edges = edges - calibration.delay
        logged = pieces_of(drive.torque, recording, edges)
        commanded, recorded = logged.mean, (logged.mean, logged.mean_later)
        if loop is not None:  # the controller sees angles as they are recorded
            K, B = np.moveaxis(loop.feedback[rows], 1, 0)
            along = logged.mean - K * loop.q[rows] - B * loop.w[rows]
            recorded = along, logged.mean_later + K * loop.w[rows]
            commanded = commanded - K * offset
        u = (calibration.gain * commanded + calibration.bias) * driven
        moment = calibration.gain * logged.moment * driven

        def slope(u: Array, by_delay: Array) -> Array:
            each = (b.block.torque_slope(estimate, b.parameters, u, by_delay) for b in self.blocks)
            return np.concatenate([np.empty((0, *u.shape)), *each])

        by, still = slope(*recorded), 0.0 * moment
        # without what a bias adds: that has no moment
        moment_by = slope(logged.moment, logged.moment_later) - slope(still, still)
        by, moment_by = (np.moveaxis(x * driven, 0, 1) for x in (by, moment_by))
        for above, below, each in drive.changes:
            up, down = (pieces_of(end, recording, edges) for end in (above, below))
            scale = (calibration.gain * driven * each)[:, None]
            by = np.append(by, (up.mean - down.mean)[:, None] * scale, axis=1)
            moment_by = np.append(moment_by, (up.moment - down.moment)[:, None] * scale, axis=1)
        motor = MotorTorque(u, by, moment, moment_by)
        if loop is None:
            return motor
        motor = self._with_offsets(motor, loop.late[rows, 0] * driven)
        return self._damped(estimate, loop.late[rows], motor, rows, edges)

    def _with_offsets(self, motor: MotorTorque, K: Array) -> MotorTorque:
        """The torque of intervals, with derivatives -K (k, n) by free offsets of angles."""
        joints = [p.place[0] for p in _entering(self.blocks, "angle")]
        if not joints:
            return motor
        S, _, k, n = motor.by.shape
        offset = np.broadcast_to(-K * np.eye(n)[joints][:, None], (S, len(joints), k, n))
        still = np.concatenate([motor.moment_by, 0.0 * offset], axis=1)
        return motor._replace(by=np.concatenate([motor.by, offset], axis=1), moment_by=still)

    def _damped(
        self, estimate: Estimate, feedback: Array, motor: MotorTorque, rows: Array, edges: Array
    ) -> MotorTorque:
        """The torque of intervals (k,), less what a feedback (k, 2, n) takes off between edges.

        A varies within a piece of time h, and moves a joint by M^-1 moment further than its mean
        would: the feedback acts on that, too, and takes (B + K h/2) M^-1 moment off its impulse.
        """
        plant = self._plant(estimate)[self.intervals.recording[rows]]
        M = plant.mechanism.inertia(plant.p, self.intervals.q[rows])
        width = np.diff(edges, axis=1).T[..., None]
        K, B = np.moveaxis(feedback, 1, 0)
        share = (B / width + K / 2)[..., None] * inverse(M)
        off = (share @ motor.moment[..., None])[..., 0]
        off_by = (share[:, None] @ motor.moment_by[..., None])[..., 0]
        return motor._replace(u=motor.u - off, by=motor.by - off_by)

    def _angle(self) -> Array:
        out = np.zeros((self.count, self.intervals.n))
        for free in self.blocks:
            if free.block.enters == "angle":
                for k, parameter in enumerate(free.parameters, free.columns.start):
                    out[k, parameter.place[0]] = 1.0
        return out


def rounded_up(counts: Array) -> Array:
    """Counts (K,) rounded up to four binary digits: intervals of one count are computed together.

    >>> rounded_up(np.array([7.0, 15.0, 17.0, 500.0]))
    array([  7,  15,  18, 512])
    """
    unit = 2.0 ** np.maximum(np.floor(np.log2(counts)) - 3, 0)
    return (np.ceil(counts / unit) * unit).astype(int)


def _entering(blocks: Sequence[FreeBlock], enters: str) -> list[Parameter]:
    return [p for free in blocks if free.block.enters == enters for p in free.parameters]


def shooting_problem(
    intervals: Intervals,
    estimate: Estimate,
    blocks: Sequence[ParameterBlock],
    settings: Settings,
    before: ShootingProblem | None = None,
) -> ShootingProblem:
    """The problem of fitting the blocks' free parameters to the intervals.

    before : of the same law, with more free parameters as a rule

    Raises
    ------
    InputError
        For blocks of servos that no data, or not these, can tell apart.
    """
    free, friction = free_blocks(blocks, estimate), estimate.friction
    law = friction.law
    check_temperature(law, intervals.temperature if law.uses_temperature else None)
    q, w = intervals.q[:64], intervals.w[:64]
    x = at_places(estimate.mechanism, Inputs(q, w, 0.0 * q, 0.0 * q))
    reads = reads_of(law, np.asarray(friction.theta), x)
    if has_actuator(blocks):
        check_servo(intervals, estimate, free, reads.u)
    theta = tuple(at for p in _entering(free, "friction") for at in p.places)
    directions = theta, tuple(p.place[0] for p in _entering(free, "base"))
    if before and all(set(x) <= set(y) for x, y in zip(directions, before.directions, strict=True)):
        directions = before.directions
    return ShootingProblem(intervals, free, settings, reads, directions)
