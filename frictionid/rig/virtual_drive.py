"""Controller of a virtual drive: lines of telemetry with faults, commands with a watchdog.

It plays the torque of a recording until the first command; then it obeys commands. At time t of the
recording the controller's clock shows (t - offset)/(1 + drift).
"""

import math
import re
from collections import deque
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeInt

from frictionid.config import NotNegative, Positive, validated
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Array, Signal, sample
from frictionid.errors import InputError

from .rig_settings import RigSettings, parsed, unframed, written

# A commanded drive that has had no command for SILENCE [s] ramps its torque down within RAMP [s].
SILENCE, RAMP = 0.2, 0.3
_MAX_LINES = 100_000_000


@validated
class Drive:
    """A virtual drive.

        measured(t) = clip(gain command(t - lag) + bias, -limit, limit) + noise

    Attributes
    ----------
    rig : settings of motors and protocol
    torque : measured torque to play, one column per motor [N m]; the commands follow from it
    rate : lines per second [Hz]
    offset [s], drift [1] : of its clock
    gain [1], bias [N m], lag [s], noise [N m] : of the measured torque
    damaged : share of damaged lines
    unplugged, restarts : numbers of unplugged cables, and of restarts
    seed : of faults and noise
    """

    rig: RigSettings
    torque: Signal
    rate: Positive = 1000.0
    offset: float = 0.0
    drift: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    gain: Positive = 1.0
    bias: float = 0.0
    lag: NotNegative = 0.0
    noise: NotNegative = 0.0
    damaged: Annotated[float, Field(ge=0, lt=1)] = 0.0
    unplugged: NonNegativeInt = 0
    restarts: NonNegativeInt = 0
    seed: int = 0

    def __post_init__(self) -> None:
        columns, motors = self.torque.value.shape[1], len(self.rig.motors)
        if columns != motors:
            raise InputError(f"the recording drives {columns} joints, [motor] has {motors} motors")
        if self.lines > _MAX_LINES:
            raise InputError(
                f"rate = {self.rate:g} Hz makes {self.lines} lines of this recording, more than "
                f"{_MAX_LINES}; lower it"
            )

    @property
    def lines(self) -> int:
        """Number of lines until the recording is over."""
        return math.floor(self.torque.duration * self.rate + 1e-9) + 1


class Controller:
    """Lines of a drive, one after the other, under the commands that it has obeyed."""

    def __init__(self, drive: Drive) -> None:
        self.drive, self._form = drive, drive.rig.protocol
        self._time = drive.torque.time[0] + np.arange(drive.lines) / drive.rate
        self._measured = sample(drive.torque, self._time)
        self._commanded = (sample(drive.torque, self._time + drive.lag) - drive.bias) / drive.gain
        generator = np.random.default_rng(drive.seed)
        self._measured += drive.noise * generator.standard_normal(self._measured.shape)
        self._generator = generator
        self._restarts = _moments(drive.restarts, drive.lines, generator)
        self._obeyed: deque[tuple[float, Array]] = deque(maxlen=1024)
        self._heard, self._booted, self.stopped = -math.inf, 0.0, False

    def measured(self, command: Array) -> Array:
        """Noise-free torque (K, m) [N m] under commands (K, m)."""
        drive = self.drive
        most = np.array([m.limit or np.inf for m in drive.rig.motors])
        return np.clip(drive.gain * command + drive.bias, -most, most)

    def line(self, k: int) -> bytes:
        """The line at the k-th moment, undamaged."""
        time = float(self._time[k])
        if self._restarts and k >= self._restarts[0]:
            self._restarts.pop(0)
            self._booted = self._clock(time)
        protocol, clock = self._form, self._clock(time) - self._booted
        values = {"time": _stamp(clock, protocol.unit, protocol.wrap)}
        command, measured = self._commanded[k], self._measured[k]
        if self._obeyed:
            command, late = self._command_at(time), self._command_at(time - self.drive.lag)
            noise = self.drive.noise * self._generator.standard_normal(len(command))
            measured = self.measured(late) + noise
        for motor, c, u in zip(self.drive.rig.motors, command, measured, strict=True):
            values[motor.measured] = f"{u / motor.per_measured:.6f}"
            if motor.command:
                values[motor.command] = f"{c / motor.per_command:.6f}"
        return written(protocol, [values.get(name, "0") for name in protocol.columns])

    def damaged(self, line: bytes) -> bytes | None:
        """The line with a fault, or None where it stays undamaged."""
        if self._generator.random() >= self.drive.damaged:
            return None
        while True:
            broken = broken_line(line, self._generator)
            # some faults leave a line that reads as a good one
            if not parsed(self._form, b"", broken + b"\n").rows:
                return broken

    def obey(self, k: int, line: bytes) -> None:
        """Obey a line that the host sent before the k-th moment; what is no command is ignored."""
        text, protocol = unframed(self._form, line), self._form
        if text is None:
            return
        time = float(self._time[min(k, len(self._time) - 1)])
        if text == protocol.stop:
            self.stopped = True
            self._command(time, np.zeros(len(self.drive.rig.motors)))
        elif protocol.begin and text == protocol.begin:
            self.stopped = False
        elif not self.stopped and (values := _values(protocol.send, text)) is not None:
            factors = [m.per_command for m in self.drive.rig.motors]
            if len(values) == len(factors):
                self._command(time, np.array(values) * factors)

    def _command(self, time: float, torque: Array) -> None:
        self._obeyed.append((time, torque))
        self._heard = time

    def _command_at(self, time: float) -> Array:
        """Command at a time, ramped down when the host is silent."""
        commands = [torque for at, torque in self._obeyed if at <= time]
        torque = commands[-1] if commands else 0.0 * self._obeyed[0][1]
        silent = time - self._heard - SILENCE
        return torque * float(np.clip(1.0 - silent / RAMP, 0.0, 1.0))

    def _clock(self, time: float) -> float:
        return (time - self.drive.offset) / (1.0 + self.drive.drift)


def broken_line(line: bytes, generator: np.random.Generator) -> bytes:
    """A line with a fault of serial lines: a flipped bit, a lost byte, added bytes, or no end."""
    kind, at = int(generator.integers(4)), int(generator.integers(len(line) - 1))
    if kind == 0:
        return line[:at] + bytes([line[at] ^ (1 << int(generator.integers(8)))]) + line[at + 1 :]
    if kind == 1:
        return line[:at] + line[at + 1 :]
    if kind == 2:
        noise = generator.integers(0, 256, int(generator.integers(1, 12)), dtype=np.uint8)
        return line[:at] + noise.tobytes() + line[at:]
    return line[:at]


def unplug_moments(drive: Drive) -> list[int]:
    """Lines during which the cable is pulled."""
    generator = np.random.default_rng([drive.seed, 1])
    return _moments(drive.unplugged, drive.lines, generator)


def _moments(count: int, lines: int, generator: np.random.Generator) -> list[int]:
    """Lines spread over all, one at random in each equal part."""
    edges = np.linspace(0.05, 0.95, count + 1) * lines
    return [int(generator.uniform(a, b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]


def _values(template: str, text: str) -> list[float] | None:
    """Numbers at the place of {value} in a command, None where it is no such command."""
    before, _, after = template.partition("{value}")
    match = re.fullmatch(re.escape(before) + r"(.*)" + re.escape(after), text)
    try:
        values = [float(part) for part in match[1].split(",")] if match else [math.nan]
    except ValueError:
        return None
    return values if all(map(math.isfinite, values)) else None


def _stamp(clock: float, unit: str, wrap: float) -> str:
    if unit == "s":
        return f"{clock:.6f}"
    count = round(clock * {"ms": 1e3, "us": 1e6}[unit])
    return str(count % int(wrap) if count >= 0 else count)


def torque_of(dataset: Dataset, name: str = "") -> Signal:
    """Torque of the driven joints of a recording, by default the first one, on the angles' span.

    Raises
    ------
    InputError
        Where there is no recording of that name.
    """
    recording = dataset[name] if name else dataset.recordings[0]
    driven = np.array(dataset.mechanism.driven)
    torque, last = recording.torque, float(recording.angle.time[-1])
    time, value = torque.time, torque.value[:, driven]
    if last > time[-1]:
        time, value = np.append(time, last), np.concatenate([value, value[-1:]])
    return Signal(time, value, torque.hold)
