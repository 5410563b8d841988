"""Intervals of recordings that a servo drives: torque follows from voltage and predicted motion.

u = (kt/R) V - (kt^2/R) w while the motor is connected, else zero. The first term is a torque like
any other, of a logged V with the gain kt/R; the second acts like a friction, with `BackEMF`. So the
inner intervals are those of another track and another law, which know both as free, and what kt and
R change follows by the chain rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import applied_voltage
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.shooting.back_emf import BackEMF, sharpened
from frictionid.shooting.intervals import Track
from frictionid.shooting.linearise import Intervals, Lines, intervals_of, parts_of
from frictionid.shooting.parameters.actuator import MOTOR
from frictionid.shooting.parameters.friction import FrictionBlock
from frictionid.shooting.parameters.parameter_block import Block, Guess
from frictionid.shooting.parameters.voltage import VoltageBlock
from frictionid.shooting.settings import Settings


@dataclass(frozen=True, eq=False)
class Driven(Intervals):
    """Intervals that a servo drives. `inner`: those of its voltage, with gain and back-EMF free."""

    inner: Intervals

    def lines(self, guess: Guess, nodes: Array, rows: Array) -> Lines:
        """Ends and derivatives of some intervals that begin at nodes (K, s)."""
        K, size = nodes.shape
        out = Lines(
            np.zeros_like(nodes),
            np.zeros((K, size, size)),
            np.zeros((K, size, self.count)),
            self._angle(),
        )
        connected = self.connected(guess)
        for pattern in np.unique(connected[rows], axis=0):
            some = rows[(connected[rows] == pattern).all(axis=1)]
            own = self.inner.lines(_inside(guess, pattern), nodes, some)
            out.end[some], out.by_start[some] = own.end[some], own.by_start[some]
            out.by[some] = own.by[some] @ self.chain(guess, pattern)
        return out

    def connected(self, guess: Guess) -> Array:
        """Whether (K, n) the motor of a joint is connected in the middle of an interval: 1 or 0."""
        track = self.track
        out = np.zeros((len(track.dt), track.n))
        middle = track.time + track.dt / 2 - float(guess.calibration.delay)
        driven = np.array(guess.mechanism.description.driven, dtype=float)
        for r, recording in enumerate(track.dataset.recordings):
            if recording.servo is not None:
                own = track.recording == r
                out[own] = recording.servo.connected(middle[own]) * driven
        return out

    def chain(self, guess: Guess, connected: Array) -> Array:
        """Derivatives (D', D) of the inner parameters in the free ones, by joints' connection."""
        kt, R = (float(x) for x in np.asarray(guess.calibration.motor))
        by_motor = {
            "gain": {"kt": 1 / R, "R": -kt / R**2},
            "back_emf": {"kt": 2 * kt / R, "R": -((kt / R) ** 2)},
        }
        entries = [e for part in self.parts for e in part.entries]
        column = {(e.block, e.name): k for k, e in enumerate(entries)}
        out = np.zeros((self.inner.count, self.count))
        last = len(guess.friction.law.names)
        for row, e in enumerate(e for part in self.inner.parts for e in part.entries):
            if (e.block, e.name) in column:
                out[row, column[e.block, e.name]] = 1.0
                continue
            emf = e.block == "friction" and e.place[1] == last
            share = connected[e.place[0]] if emf else 1.0
            for name in MOTOR:
                if ("actuator", name) in column:
                    slope = by_motor["back_emf" if emf else "gain"][name]
                    out[row, column["actuator", name]] = share * slope
        return out


def _inside(guess: Guess, connected: Array) -> Guess:
    """The guess as the inner intervals see it, with the motors (n,) that are connected."""
    kt, R = (float(x) for x in np.asarray(guess.calibration.motor))
    friction, n = guess.friction, guess.mechanism.n
    theta = np.asarray(friction.theta, dtype=float)
    emf = (kt**2 / R * connected)[:, None]
    law = BackEMF(sharpened(friction.law))
    friction = replace(friction, law=law, theta=np.concatenate([theta, emf], axis=-1))
    calibration = replace(guess.calibration, gain=np.full(n, kt / R), motor=None)
    return guess._replace(friction=friction, calibration=calibration)


def has_actuator(blocks: Sequence[Block]) -> bool:
    """Whether torque is to follow from a servo's voltage."""
    return any(b.name == "actuator" for b in blocks)


def motored(guess: Guess, dataset: Dataset) -> Guess:
    """The guess with motor constants: those that the friction brings, or the recordings'.

    Raises
    ------
    InputError
        Where no recording knows its servo, some do not, or they have different motors.
    """
    if guess.calibration.motor is not None:
        return guess
    own = guess.friction.parameters
    found = {(r.servo.kt, r.servo.R) for r in dataset.recordings if r.servo is not None}
    where = f"data set {dataset.name!r}, block 'actuator'"
    way = "leave the block out, and free 'gain' for a wrong torque constant"
    if not found:
        raise InputError(f"{where}: no recording knows the servo that drives it: {way}")
    for r in dataset.recordings:
        if r.servo is None and np.any(r.torque.value):
            raise InputError(
                f"{where}: recording {r.name!r} has a torque and no servo: leave it out, or {way}"
            )
    if len(found) > 1:
        raise InputError(
            f"{where}: the recordings have {len(found)} different motors (kt, R): fit those of "
            "each motor alone"
        )
    motor = np.array([own.get("kt") or 0.0, own.get("R") or 0.0])
    motor = motor if (motor > 0).all() else np.array(found.pop())
    return guess._replace(calibration=replace(guess.calibration, motor=motor))


def driven_of(track: Track, guess: Guess, blocks: Sequence[Block], settings: Settings) -> Driven:
    """Intervals of a track whose torque follows from the voltage of its servos.

    Raises
    ------
    InputError
        For blocks that no data, or not these, can tell apart.
    """
    law = guess.friction.law
    if hasattr(guess.friction.theta, "detach") or law.sample_time is not None:
        raise InputError(
            f"block 'actuator': {law} learns by reverse mode, which knows no voltages: leave the "
            "block out"
        )
    own = next((b for b in blocks if b.enters == "friction"), None)
    friction = FrictionBlock(law.names if own is None else getattr(own, "fixed", ()))
    others = [b for b in blocks if b.name not in ("actuator", "friction")]
    volts = replace(
        track.dataset, recordings=tuple(_as_voltage(r) for r in track.dataset.recordings)
    )
    outer = parts_of(blocks, guess)
    inner = intervals_of(
        replace(track, dataset=volts),
        _inside(guess, np.ones(track.n)),
        (friction, *others, VoltageBlock()),
        settings,
    )
    driven = Driven(track, outer, settings, inner.seen, inner)
    _check(driven, guess)
    return driven


def _as_voltage(recording: Recording) -> Recording:
    """The recording with the voltage [V] of its motors in the place of their torque."""
    if recording.servo is None:
        return recording
    volts: Signal = applied_voltage(recording.servo, recording.angle)
    return replace(recording, torque=volts)


def _check(driven: Driven, guess: Guess) -> None:
    """Complain about what these recordings cannot tell of motor, machine and friction together."""
    entries = {part.block.name: part.entries for part in driven.parts}
    free = {e.name for e in entries["actuator"]}
    known = any(np.isfinite(e.prior) for own in entries.values() for e in own)
    way = "fix actuator.kt or actuator.R, or give a prior of the block"
    if "gain" in entries:
        raise InputError(
            "blocks 'gain' and 'actuator': a gain of the torque is one of kt/R: leave one out"
        )
    everything = len(guess.mechanism.base_names)
    scale = len(entries.get("inertia", ())) == everything and entries.get("friction")
    if scale and "R" in free and not known:
        raise InputError(
            "blocks 'actuator' and 'inertia' with all base parameters free: a smaller R with "
            "larger inertias and friction gives the same motion: fix actuator.R, or one base "
            f"parameter that you are sure of, such as {guess.mechanism.base_names[-1]!r}, or give "
            "a prior"
        )
    viscous = any(e.name.startswith("viscous") for e in entries.get("friction", ()))
    rows = driven.connected(guess)
    passive = bool((rows == 0).all(axis=1).any())
    if free == set(MOTOR) and viscous and not (known or passive or driven.seen.u):
        raise InputError(
            "block 'actuator': while the motor is connected only kt/R and the sum of viscous "
            f"friction and kt^2/R show in the motion: {way}, or add recordings in which it is "
            "disconnected"
        )
