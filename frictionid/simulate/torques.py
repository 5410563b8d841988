"""Torque commands of the simulated drive: wave forms, tables, and a position controller.

`values` of a wave form or table are the command at increasing times (T,) [s], shape (T,) [N m].

Under the controller torque follows from the motion: a robot's drives sample the angles, compute

    u = u_nominal(reference) + kp (q_reference - q) + kd (w_reference - w)

and hold it until the next sample.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from frictionid.arrays import times
from frictionid.config import NotNegative, Positive, validated
from frictionid.data.readers.table import read_table, signal_of
from frictionid.data.signals import Array, sample
from frictionid.errors import InputError
from frictionid.files import read_bytes
from frictionid.mechanics import Plant
from frictionid.progress import report_step

from .integrate import TrueSystem, advance, modes_after_jump, next_modes


@validated
class Sine:
    """offset + amplitude sin(2 pi frequency t + phase); [N m], [Hz], [rad].

    >>> generator = np.random.default_rng(0)
    >>> Sine(0.1, frequency=0.25).values(np.arange(4.0), generator).round(6) + 0.0
    array([ 0. ,  0.1,  0. , -0.1])
    """

    amplitude: float
    frequency: Positive
    phase: float = 0.0
    offset: float = 0.0
    kind: Literal["sine"] = "sine"

    def values(self, time: Array, generator: np.random.Generator) -> Array:  # noqa: ARG002
        wave = np.sin(2 * np.pi * self.frequency * time + self.phase)
        return self.offset + self.amplitude * wave


@validated
class Chirp:
    """Sine whose frequency [Hz] changes linearly from the first to the last sample.

    >>> Chirp(0.1, 1.0, 2.0).values(np.array([0.0, 1.0]), np.random.default_rng(0)).round(6) + 0.0
    array([0., 0.])
    """

    amplitude: float
    start_frequency: Positive
    stop_frequency: Positive
    kind: Literal["chirp"] = "chirp"

    def values(self, time: Array, generator: np.random.Generator) -> Array:  # noqa: ARG002
        since = time - time[0]
        growth = (self.stop_frequency - self.start_frequency) / max(since[-1], 1e-9)
        turns = (self.start_frequency + 0.5 * growth * since) * since
        return self.amplitude * np.sin(2 * np.pi * turns)


@validated
class Steps:
    """Levels drawn evenly from -amplitude to amplitude, each held for `hold` [s].

    >>> generator = np.random.default_rng(0)
    >>> len(set(Steps(0.1, hold=0.5).values(np.linspace(0.0, 0.9, 10), generator)))
    2
    """

    amplitude: NotNegative
    hold: Positive
    kind: Literal["steps"] = "steps"

    def values(self, time: Array, generator: np.random.Generator) -> Array:
        # a sample at a change belongs to the new level, also after rounding
        number = np.floor((time - time[0]) / self.hold + 1e-9).astype(int)
        levels: Array = generator.uniform(-self.amplitude, self.amplitude, number[-1] + 1)
        return levels[number]


@validated
class Multisine:
    """Sines of equal height and random phase at some frequencies [Hz], with the amplitude as peak.

    >>> generator = np.random.default_rng(0)
    >>> float(abs(Multisine(0.1, (1.0, 2.5)).values(np.linspace(0, 3, 99), generator)).max())
    0.1
    """

    amplitude: NotNegative
    frequencies: Annotated[tuple[Positive, ...], Field(min_length=1)]
    kind: Literal["multisine"] = "multisine"

    def values(self, time: Array, generator: np.random.Generator) -> Array:
        phases = generator.uniform(0.0, 2 * np.pi, len(self.frequencies))
        turns = np.outer(time, self.frequencies)
        wave: Array = np.sin(2 * np.pi * turns + phases).sum(axis=1)
        return wave * (self.amplitude / np.abs(wave).max())


@validated
class Noise:
    """White noise between two frequencies [Hz] with half the amplitude as deviation, cut off at it.

    >>> generator = np.random.default_rng(0)
    >>> float(abs(Noise(0.1, (0.5, 2.0)).values(np.linspace(0, 9, 99), generator)).max())
    0.1
    """

    amplitude: NotNegative
    band: tuple[float, float]
    kind: Literal["noise"] = "noise"

    def __post_init__(self) -> None:
        if not 0 <= self.band[0] < self.band[1]:
            raise InputError(f"band must be two increasing frequencies, not {list(self.band)}")

    def values(self, time: Array, generator: np.random.Generator) -> Array:
        low, high = self.band
        white = np.fft.rfft(generator.standard_normal(len(time)))
        frequency = np.fft.rfftfreq(len(time), (time[-1] - time[0]) / (len(time) - 1))
        # second-order edges: sharp ones would ring through the whole recording
        shape = 1.0 / np.sqrt(1.0 + (frequency / high) ** 4)
        shape[1:] /= np.sqrt(1.0 + (low / frequency[1:]) ** 4)
        shape[0] *= low == 0
        wave = np.fft.irfft(white * shape, len(time))
        half = 0.5 * self.amplitude / max(float(wave.std()), 1e-300)
        return np.clip(half * wave, -self.amplitude, self.amplitude)


@validated
class Table:
    """Torque of a table with `time` [s], as `frictionid suggest` writes it.

    Each value is held to the next; after the last there is none.

    file : of the table, from the folder of the rig.toml; column : [N m]
    """

    file: str
    column: str = "u1"
    kind: Literal["table"] = "table"

    def values(self, time: Array, generator: np.random.Generator) -> Array:  # noqa: ARG002
        table = read_table(read_bytes(Path(self.file)), self.file, ["time", self.column])
        torque = signal_of(table, "time", [self.column], hold="previous")
        # times may be rounded in the table
        return sample(torque, time + 1e-6)[:, 0] * (time < torque.time[-1] + 1e-6)


AnyCommand = Annotated[
    Sine | Chirp | Steps | Multisine | Noise | Table, Field(discriminator="kind")
]


@validated
class Fourier:
    """Periodic reference of one joint's position [Swevers1997].

        q = offset + sum_k (sines[k] sin(k W t) - cosines[k] cos(k W t)) / (k W)
        W = 2 pi frequency

    sines, cosines : amplitudes of the velocity's harmonics [rad/s]; frequency [Hz]

    >>> Fourier((1.0,), (0.0,), frequency=1 / (2 * np.pi)).motion(np.array([0.0, np.pi / 2]))[0]
    array([0., 1.])
    """

    sines: Annotated[tuple[float, ...], Field(min_length=1)]
    cosines: tuple[float, ...]
    frequency: Positive
    offset: float = 0.0

    def __post_init__(self) -> None:
        if len(self.sines) != len(self.cosines):
            raise InputError(
                f"a Fourier reference needs as many sines as cosines, not {len(self.sines)} and "
                f"{len(self.cosines)}"
            )

    def motion(self, time: Array) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration at times (T,), (T,) each."""
        rate = 2 * np.pi * self.frequency * np.arange(1, len(self.sines) + 1)
        s, c = np.sin(np.multiply.outer(time, rate)), np.cos(np.multiply.outer(time, rate))
        a, b = np.array(self.sines), np.array(self.cosines)
        q = self.offset + s @ (a / rate) - c @ (b / rate)
        return q, c @ a + s @ b, c @ (b * rate) - s @ (a * rate)


@validated
class Controller:
    """Position controller: stiffness kp [N m/rad] and damping kd [N m s/rad] of each joint."""

    kp: tuple[Positive, ...]
    kd: tuple[NotNegative, ...]


Command = Callable[[int, Array], Array]


def tracking(
    system: TrueSystem,
    nominal: Plant,
    controller: Controller,
    references: Sequence[Sequence[Fourier]],
    time: Array,
) -> tuple[Command, Array]:
    """What the controller commands, and start (3, R, n) of R recordings side by side.

    As `sampled_loop` takes them. A reference for each joint of each recording.

    nominal : the model in the controller
    time : (T,) [s], evenly spaced samples of the controller

    >>> from frictionid.mechanics import pendulum
    >>> from frictionid.simulate.true_friction import Curve, Stribeck
    >>> machine = pendulum(mass=1.0, length=0.5)
    >>> nominal = Plant.from_parameters(machine, {})
    >>> system = TrueSystem(machine, nominal.p, Stribeck(Curve((0.5,), (0.5,), (0.1,))))
    >>> wanted, time = Fourier((1.0,), (0.0,), 0.5), np.arange(500) * 0.002
    >>> command = tracking(system, nominal, Controller((400.0,), (20.0,)), [[wanted]], time)
    >>> states, _ = sampled_loop(system, *command, time)
    >>> bool(np.abs(states[:, 0, 0, 0] - wanted.motion(time)[0]).max() < 0.003)
    True
    """
    motions = [[joint.motion(time) for joint in run] for run in references]
    wanted = np.moveaxis(np.array(motions), (0, 1, 2, 3), (2, 3, 1, 0))  # (T, 3, R, n)
    M, h = nominal.dynamics(wanted[:, 0], wanted[:, 1])
    forward = times(M, wanted[:, 2]) - h
    kp, kd, motors = np.array(controller.kp), np.array(controller.kd), system.mechanism.motors
    start = np.stack([*wanted[0, :2], system.friction.start(wanted[0, 1])])

    def command(k: int, y: Array) -> Array:
        off = wanted[k, :2] - y[:2]
        return motors * (forward[k] + kp * off[0] + kd * off[1])

    return command, start


def sampled_loop(
    system: TrueSystem,
    command: Command,
    start: Array,
    time: Array,
    *,
    delay: float = 0.0,
    gain: float = 1.0,
    substeps: int = 4,
) -> tuple[Array, Array]:
    """Motion of R machines side by side under torques that a controller commands at samples.

    States (T, 3, R, n) at the samples, and the torques (T, R, n) commanded at them [N m].

    Parameters
    ----------
    system : TrueSystem
    command : function of sample k and true states (3, R, n) to torques (R, n) [N m]
        They are held until the next sample.
    start : array, shape (3, R, n)
        Angles, velocities and memory of friction, see `TrueFriction.start`.
    time : (T,) [s], evenly spaced samples
    delay : [s], by which a command acts later; gain : by which it acts stronger
    substeps : steps of the integration between two samples
    """
    width = float(time[1] - time[0])
    late, rest = divmod(delay / width, 1.0)
    y = start
    states, torque = np.empty((len(time), *y.shape)), np.empty((len(time), *y.shape[1:]))
    mode = next_modes(system, y, 0.0 * y[0])
    for k in range(len(time)):
        states[k] = y
        torque[k] = command(k, y)
        for share, at in ((rest, k - int(late) - 1), (1.0 - rest, k - int(late))):
            if share > 1e-9 and k < len(time) - 1:
                u = gain * torque[max(at, 0)]
                mode = modes_after_jump(system, y, u, mode)
                count = max(1, round(share * substeps))
                for _ in range(count):
                    y, mode = advance(system, y, u, mode, share * width / count)
        if k % 100 == 0:
            report_step("simulating", len(time) - k)
    return states, torque
