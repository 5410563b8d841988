"""What a simulated drive says and obeys: lines of telemetry with faults, commands with a watchdog.

It plays the torque of a recording until it is commanded; then it obeys. At time t of the recording
the controller's clock shows (t - offset)/(1 + drift).
"""

from __future__ import annotations

import math
import re
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from frictionid.acquire.protocol import Format, framed, read, unframed, written
from frictionid.acquire.rig_settings import RigSettings
from frictionid.config import nearest
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Array, Signal, sample
from frictionid.errors import InputError
from frictionid.mechanics import mechanism_of

# Without a command for so long [s] a commanded drive ramps its torque down, within RAMP.
SILENCE, RAMP = 0.2, 0.3
_MOST_LINES = 100_000_000


@dataclass(frozen=True)
class Faults:
    """What goes wrong: share of damaged lines, unplugged cables, restarts of the controller."""

    damaged: float = 0.0
    unplugged: int = 0
    restarts: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.damaged < 1:
            raise InputError(f"share of damaged lines = {self.damaged} must be from 0 to 1")
        for name in ("unplugged", "restarts"):
            if getattr(self, name) < 0:
                raise InputError(f"{name} = {getattr(self, name)} must not be negative")


@dataclass(frozen=True)
class Drive:
    """A simulated drive.

    torque : what it plays, one column per motor [N m]: the torque that acts, and is measured
    rate : lines per second [Hz]; offset : [s], drift : [1], of its clock
    gain, bias [N m], lag [s], noise [N m] : measured torque = gain command(t - lag) + bias, cut off
        at the motors' limits, with that standard deviation; when it plays, commands follow from
        the torque
    """

    setup: RigSettings
    torque: Signal
    rate: float = 1000.0
    offset: float = 0.0
    drift: float = 0.0
    gain: float = 1.0
    bias: float = 0.0
    lag: float = 0.0
    noise: float = 0.0
    faults: Faults = field(default_factory=Faults)

    def __post_init__(self) -> None:
        for name in ("rate", "offset", "drift", "gain", "bias", "lag", "noise"):
            if not math.isfinite(getattr(self, name)):
                raise InputError(f"{name} = {getattr(self, name)} must be a finite number")
        for name in ("rate", "gain"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} = {getattr(self, name)} must be positive")
        for name in ("lag", "noise"):
            if not getattr(self, name) >= 0:
                raise InputError(f"{name} = {getattr(self, name)} must not be negative")
        if not abs(self.drift) < 0.5:
            raise InputError(f"drift = {self.drift} must be far below 1; it is given in ppm")
        columns, motors = self.torque.value.shape[1], len(self.setup.motors)
        if columns != motors:
            raise InputError(f"the recording drives {columns} joints, [motor] has {motors} motors")
        if self.lines > _MOST_LINES:
            raise InputError(
                f"rate = {self.rate:g} Hz makes {self.lines} lines of this recording, more than "
                f"{_MOST_LINES}; lower it"
            )

    @property
    def lines(self) -> int:
        """Number of lines until the recording is over."""
        return math.floor((self.torque.time[-1] - self.torque.time[0]) * self.rate + 1e-9) + 1


class Speaker:
    """Lines of a drive, one after the other, and the commands that it obeys meanwhile."""

    def __init__(self, drive: Drive) -> None:
        self.drive, self._form = drive, drive.setup.protocol.format()
        self._time = drive.torque.time[0] + np.arange(drive.lines) / drive.rate
        self._felt = sample(drive.torque, self._time)
        self._played = (sample(drive.torque, self._time + drive.lag) - drive.bias) / drive.gain
        generator = np.random.default_rng(drive.faults.seed)
        self._felt += drive.noise * generator.standard_normal(self._felt.shape)
        self._generator = generator
        self._restarts = _moments(drive.faults.restarts, drive.lines, generator)
        self._obeyed: deque[tuple[float, Array]] = deque(maxlen=1024)
        self._heard, self._booted, self.stopped = -math.inf, 0.0, False

    def measured(self, command: Array) -> Array:
        """Torque (K, m) [N m] without noise that commands (K, m) make."""
        drive = self.drive
        most = np.array([m.limit or np.inf for m in drive.setup.motors])
        return np.clip(drive.gain * command + drive.bias, -most, most)

    def line(self, k: int) -> bytes:
        """The line at the k-th moment, undamaged."""
        time = float(self._time[k])
        if self._restarts and k >= self._restarts[0]:
            self._restarts.pop(0)
            self._booted = self._clock(time)
        command, felt = self._torques(k, time)
        return written(self._form, self._texts(self._clock(time) - self._booted, command, felt))

    def damaged(self, line: bytes) -> bytes | None:
        """The line damaged, or None where it is spared."""
        if self._generator.random() >= self.drive.faults.damaged:
            return None
        while True:
            broken = broken_line(line, self._generator)
            # what is not recognised as damaged is no damaged line
            if all(read(self._form, part) is None for part in broken.split(b"\n")):
                return broken

    def obey(self, k: int, line: bytes) -> None:
        """Take a line that the host sent before the k-th moment; others are passed over."""
        text, protocol = unframed(self._form, line), self.drive.setup.protocol
        if text is None:
            return
        time = float(self._time[min(k, len(self._time) - 1)])
        if text == protocol.stop:
            self.stopped = True
            self._order(time, np.zeros(len(self.drive.setup.motors)))
        elif protocol.begin and text == protocol.begin:
            self.stopped = False
        elif not self.stopped and (values := _values(protocol.send, text)) is not None:
            factors = [m.per_command for m in self.drive.setup.motors]
            if len(values) == len(factors):
                self._order(time, np.array(values) * factors)

    def _order(self, time: float, torque: Array) -> None:
        self._obeyed.append((time, torque))
        self._heard = time

    def _torques(self, k: int, time: float) -> tuple[Array, Array]:
        if not self._obeyed:
            return self._played[k], self._felt[k]
        command, late = self._ordered(time), self._ordered(time - self.drive.lag)
        noise = self.drive.noise * self._generator.standard_normal(len(command))
        return command, self.measured(late) + noise

    def _ordered(self, time: float) -> Array:
        """Command at a time; of a host that is silent, ramped down."""
        orders = [torque for at, torque in self._obeyed if at <= time]
        torque = orders[-1] if orders else 0.0 * self._obeyed[0][1]
        silent = time - self._heard - SILENCE
        return torque * float(np.clip(1.0 - silent / RAMP, 0.0, 1.0))

    def _clock(self, time: float) -> float:
        return (time - self.drive.offset) / (1.0 + self.drive.drift)

    def _texts(self, clock: float, command: Array, felt: Array) -> list[str]:
        protocol = self.drive.setup.protocol
        values = {"time": _stamp(clock, protocol.unit, protocol.wrap)}
        for motor, c, u in zip(self.drive.setup.motors, command, felt, strict=True):
            values[motor.measured] = f"{u / motor.per_measured:.6f}"
            if motor.command:
                values[motor.command] = f"{c / motor.per_command:.6f}"
        return [values.get(name, "0") for name in protocol.columns]


def broken_line(line: bytes, generator: np.random.Generator) -> bytes:
    """A line with one of the faults of serial lines: flipped bits, lost or added bytes, no end."""
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
    """Lines in whose middle the cable is pulled."""
    generator = np.random.default_rng([drive.faults.seed, 1])
    return _moments(drive.faults.unplugged, drive.lines, generator)


def _moments(count: int, lines: int, generator: np.random.Generator) -> list[int]:
    """Moments spread over the lines, one at random in each part."""
    edges = np.linspace(0.05, 0.95, count + 1) * lines
    return [int(generator.uniform(a, b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]


def _values(template: str, text: str) -> list[float] | None:
    """Numbers that a command holds in the place of {value}."""
    before, _, after = template.partition("{value}")
    found = re.fullmatch(re.escape(before) + r"(.*)" + re.escape(after), text)
    try:
        values = [float(part) for part in found[1].split(",")] if found else [math.nan]
    except ValueError:
        return None
    return values if all(map(math.isfinite, values)) else None


def _stamp(clock: float, unit: str, wrap: float) -> str:
    if unit == "s":
        return f"{clock:.6f}"
    count = round(clock * {"ms": 1e3, "us": 1e6}[unit])
    return str(count % int(wrap) if count >= 0 else count)


def command_line(form: Format, template: str, values: list[float]) -> bytes:
    """Framed command of values, one for each motor."""
    return framed(form, template.replace("{value}", ",".join(f"{v:.6f}" for v in values)))


def torque_of(dataset: Dataset, name: str = "") -> Signal:
    """Torque of the driven joints of a recording, by default the first one, on the angles' span.

    Raises
    ------
    InputError
        Where there is no recording of that name.
    """
    known = [r.name for r in dataset.recordings]
    if name and name not in known:
        raise InputError(
            f"data set {dataset.name!r} has no recording {name!r}; {nearest(name, known)}"
        )
    recording = dataset.recordings[known.index(name) if name else 0]
    driven = np.array(mechanism_of(dataset.mechanism).description.driven)
    torque, last = recording.torque, float(recording.angle.time[-1])
    time, value = torque.time, torque.value[:, driven]
    if last > time[-1]:
        time, value = np.append(time, last), np.concatenate([value, value[-1:]])
    return Signal(time, value, torque.hold)
