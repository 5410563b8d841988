"""All intervals of a track, each from its own node: their ends and derivatives in every block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.signals import sample
from frictionid.dynamics.step import State, step_size_of
from frictionid.friction import Inputs, Nodes, memory_along
from frictionid.mechanics import Plant
from frictionid.mechanics.calibration import calibrated_dataset, calibrated_plant
from frictionid.shooting.intervals import Track, pushes
from frictionid.shooting.law_derivatives import Free, Seen, seen_by
from frictionid.shooting.parameters.parameter_block import Block, Entry, Guess
from frictionid.shooting.sampled_memory import remembered
from frictionid.shooting.settings import Settings
from frictionid.shooting.variational import Forces, Scene, ends

_PIECE = 0.009  # [s], one at most without a joint near rest: half a sample at 60 Hz
_ORDER = ("friction", "base", "torque", "angle", "actuator")
_WHOLE = np.array([0.0, 1.0])  # an interval in one piece
ROWS = 10000  # at a time, for the cache's sake; few near rest cost as much as many


class Part(NamedTuple):
    """A block with its free parameters, at `columns` of all parameters."""

    block: Block
    entries: tuple[Entry, ...]
    columns: slice


def parts_of(blocks: Sequence[Block], guess: Guess) -> tuple[Part, ...]:
    """The blocks in the order of the derivatives, with their free parameters."""
    out, first = [], 0
    for block in sorted(blocks, key=lambda b: _ORDER.index(b.enters)):
        entries = block.entries(guess)
        out.append(Part(block, entries, slice(first, first + len(entries))))
        first += len(entries)
    return tuple(out)


def put(guess: Guess, parts: Sequence[Part], values: Array) -> Guess:
    """The guess with other values (D,) of all free parameters."""
    for part in parts:
        guess = part.block.put(guess, part.entries, values[part.columns])
    return guess


def values_of(guess: Guess, parts: Sequence[Part]) -> Array:
    """Values (D,) of all free parameters in a guess."""
    return np.array([entry.value for part in parts for entry in part.block.entries(guess)])


class Lines(NamedTuple):
    """Linearised intervals: ends (K, s), and their derivatives by_start (K, s, s), by (K, s, D).

    `angle` (D, n): derivatives of the measured angle itself. Rows that are not used are zero.
    """

    end: Array
    by_start: Array
    by: Array
    angle: Array


@dataclass(frozen=True, eq=False)
class Intervals:
    """What of a track does not change while its parameters are fitted."""

    track: Track
    parts: tuple[Part, ...]
    settings: Settings
    seen: Seen

    @property
    def count(self) -> int:
        """Number of free parameters."""
        return self.parts[-1].columns.stop if self.parts else 0

    def lines(self, guess: Guess, nodes: Array, rows: Array) -> Lines:
        """Ends and derivatives of some intervals that begin at nodes (K, s)."""
        track, n = self.track, self.track.n
        size, D = nodes.shape[1], self.count
        out = Lines(
            np.zeros_like(nodes),
            np.zeros((len(nodes), size, size)),
            np.zeros((len(nodes), size, D)),
            self._angle(),
        )
        plant = self._plant(guess)
        scene = self._scene(guess, plant)
        pieces = self._pieces(guess, plant)
        for count in np.unique(pieces[rows]):
            alike = rows[pieces[rows] == count]
            for some in np.array_split(alike, max(1, -(-len(alike) // ROWS))):
                start = State(nodes[some, :n], nodes[some, n : 2 * n], self._memory(nodes[some]))
                own = scene._replace(plant=plant[track.recording[some]])
                forces = self._forces(guess, some, int(count))
                fine = int(np.ceil(float(track.dt[some].max()) / count / self.settings.fine))
                end = ends(own, start, forces, track.dt[some], fine)
                if start.memory and guess.friction.law.sample_time is not None:
                    later = self._pushed(guess, self._following(some), _WHOLE)
                    end = remembered(own, end, later, track.dt[some])
                out.end[some] = np.concatenate([end.q, end.w, *end.memory], axis=-1)
                out.by_start[some] = end.by_start
                out.by[some, :, : end.by_parameters.shape[-1]] = end.by_parameters
        return out

    def start(self, guess: Guess) -> Array:
        """Nodes (K, s) from the smoothed motion."""
        q, w = self.track.q - guess.calibration.offset, self.track.w
        return np.concatenate([q, w, *self.warm(guess)], axis=-1)

    def warm(self, guess: Guess) -> tuple[Array, ...]:
        """Memory (K, n) at each interval's begin, from the smoothed motion before it."""
        track, friction = self.track, guess.friction
        if not friction.law.has_memory:
            return ()
        sizes = [len(s.time) for s in track.states]
        first = np.concatenate([[0], np.cumsum(sizes)])
        ideal = (
            calibrated_dataset(track.dataset, guess.calibration) if self.seen.u else track.dataset
        )
        pairs = zip(ideal.recordings, track.states, strict=True)
        u = np.concatenate([sample(r.torque, s.time) for r, s in pairs])
        time, q, w = (np.concatenate(column) for column in zip(*track.states, strict=True))
        x = Inputs(q - guess.calibration.offset, w, u, 0.0 * w)
        steps = memory_along(friction, Nodes(x, time, first))
        at = track.index, track.recording
        return tuple(np.stack([s[m] for s in steps])[at] for m in range(len(steps[0])))

    def _following(self, rows: Array) -> Array:
        """The intervals (k,) behind some, or these where none follows."""
        later = np.minimum(rows + 1, len(self.track.dt) - 1)
        return np.where(self.track.joined[later], later, rows)

    def _memory(self, nodes: Array) -> tuple[Array, ...]:
        n = self.track.n
        return tuple(nodes[:, i : i + n] for i in range(2 * n, nodes.shape[1], n))

    def _scene(self, guess: Guess, plant: Plant) -> Scene:
        free = [e.place for p in self.parts if p.block.enters == "friction" for e in p.entries]
        base = [e.place[0] for p in self.parts if p.block.enters == "base" for e in p.entries]
        joint, place = (np.array([f[i] for f in free], dtype=int) for i in (0, 1))
        return Scene(plant, guess.friction, Free(joint, place), tuple(base), self.seen)

    def _plant(self, guess: Guess) -> Plant:
        plant = calibrated_plant(self.track.dataset, guess.calibration)
        # only bearing loads need the physical parameters
        return plant if guess.friction.law.uses_load else replace(plant, parameters={})

    def _pieces(self, guess: Guess, plant: Plant) -> Array:
        """Pieces (K,) of each interval."""
        longest = float(self.track.dt.max())
        away = step_size_of(plant, guess.friction, longest, longest=_PIECE).pieces / longest
        return np.maximum(np.ceil(self.track.dt * away - 1e-6), 1).astype(int)

    def _forces(self, guess: Guess, rows: Array, pieces: int) -> Forces:
        """Forces of some intervals in equal pieces."""
        whole = self._pushed(guess, rows, np.arange(pieces + 1) / pieces)

        def finer(some: Array, piece: int, parts: int) -> Forces:
            share = (piece + np.arange(parts + 1) / parts) / pieces
            return self._pushed(guess, rows[some], share)

        return whole._replace(finer=finer)

    def _pushed(self, guess: Guess, rows: Array, share: Array) -> Forces:
        """Forces of some intervals between shares (S + 1,) of their time."""
        calibration, felt = guess.calibration, pushes(self.track, guess.calibration, rows, share)
        driven = np.array(guess.mechanism.description.driven, dtype=float)
        u = (calibration.gain * felt.mean + calibration.bias) * driven
        moment = calibration.gain * felt.moment * driven
        by, moment_by = [], []
        for part in self.parts:
            if part.block.enters == "torque" and part.entries:
                slope: Any = getattr(part.block, "slope")  # noqa: B009 (only those blocks have it)
                by.append(slope(guess, part.entries, felt.mean, felt.mean_later) * driven)
                own = slope(guess, part.entries, felt.moment, felt.moment_later)
                # without what a bias adds: that has no moment
                own = own - slope(guess, part.entries, 0.0 * moment, 0.0 * moment)
                moment_by.append(own * driven)
        none = np.empty((0, *u.shape))
        return Forces(
            u,
            np.moveaxis(np.concatenate([none, *by]), 0, 1),
            moment,
            np.moveaxis(np.concatenate([none, *moment_by]), 0, 1),
        )

    def _angle(self) -> Array:
        out = np.zeros((self.count, self.track.n))
        for part in self.parts:
            if part.block.enters == "angle":
                for k, entry in enumerate(part.entries):
                    out[part.columns.start + k, entry.place[0]] = 1.0
        return out


def intervals_of(
    track: Track, guess: Guess, blocks: Sequence[Block], settings: Settings
) -> Intervals:
    """Intervals of a track with the blocks' free parameters."""
    law, theta = guess.friction.law, np.asarray(guess.friction.theta)
    some = slice(0, 64)
    x = Inputs(track.q[some], track.w[some], 0.0 * track.q[some], 0.0 * track.q[some])
    return Intervals(track, parts_of(blocks, guess), settings, seen_by(law, theta, x))
