"""A virtual drive: its controller, and its port, at which cables are pulled.

It plays the torque of a recording until the first command; then it obeys commands. At time t of the
recording the controller's clock shows (t - offset)/(1 + drift).
"""

import contextlib
import fcntl
import math
import os
import re
import select
import struct
import termios
import time
import tty
from collections import deque
from itertools import pairwise
from pathlib import Path
from typing import Annotated, BinaryIO

import numpy as np
from pydantic import Field, NonNegativeInt

from frictionid.config import NotNegative, Positive, validated
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
            if not parsed(self._form, b"", broken + b"\n")[0]:
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


def _moments(count: int, lines: int, generator: np.random.Generator) -> list[int]:
    """Lines spread over all, one at random in each equal part."""
    edges = np.linspace(0.05, 0.95, count + 1) * lines
    return [int(generator.uniform(a, b)) for a, b in pairwise(edges)]


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


_QUIET, _POLL = 3, 0.02  # polls in a row without unread bytes, [s] between them
_MAX_DRAIN = 10.0  # [s] that a reader may take
_STEP = 0.01  # [s]


class Terminal:
    """The drive's end of a serial cable; a symbolic link names the other end."""

    def __init__(self, link: Path) -> None:
        if link.is_symlink():
            link.unlink()
        if link.exists():
            raise InputError(f"{link} exists and is no link to a port: choose another --port")
        self.link = link
        self._master, self._received = -1, b""
        self.plug()

    def plug(self) -> None:
        """Make the port appear."""
        self._master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        name = os.ttyname(slave)
        new = self.link.with_name(f".{self.link.name}.{os.getpid()}")
        try:
            new.symlink_to(name)
            os.replace(new, self.link)
        except OSError as error:
            raise InputError(f"{self.link} cannot be made ({error.strerror})") from None
        finally:
            # from now on the system knows whether anybody has the port open
            os.close(slave)

    def unplug(self) -> None:
        """Make the port disappear, with all unread bytes."""
        if self._master >= 0:
            with contextlib.suppress(OSError):
                self.link.unlink()
            os.close(self._master)
            self._master, self._received = -1, b""

    def is_open(self) -> bool:
        """Whether a host has the port open."""
        poll = select.poll()
        poll.register(self._master, 0)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    def send(self, content: bytes, timeout: float) -> int:
        """Bytes that the port took within `timeout` [s]."""
        if not select.select([], [self._master], [], timeout)[1]:
            return 0
        try:
            return os.write(self._master, content)
        except OSError:  # full, or nobody there any more
            return 0

    def received(self, timeout: float = 0.0) -> list[bytes]:
        """Lines that the other side sent within `timeout` [s]."""
        if not self.is_open():
            time.sleep(min(timeout, _STEP))
            return []
        if not select.select([self._master], [], [], timeout)[0]:
            return []
        with contextlib.suppress(OSError):
            self._received += os.read(self._master, 65536)
        *lines, self._received = self._received.split(b"\n")
        return lines

    def drain(self) -> None:
        """Wait until all bytes have been read, or nobody reads."""
        if not self.is_open():
            return
        slave = os.open(os.path.realpath(self.link), os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            quiet, end = 0, time.monotonic() + _MAX_DRAIN
            while quiet < _QUIET and time.monotonic() < end:
                waiting = fcntl.ioctl(slave, termios.FIONREAD, b"\0\0\0\0")
                quiet = quiet + 1 if struct.unpack("i", waiting)[0] == 0 else 0
                time.sleep(_POLL)
        finally:
            os.close(slave)


_BATCH = 256  # lines at a time
_WAIT = 0.02  # [s]
_UNPLUGGED = 0.3  # [s] that a pulled cable stays out
_HALF_LINE = 7  # bytes of the line during which the cable is pulled


class Playback:
    """Plays a recording to whoever opens the port.

    speed : times real time, infinite for as fast as they are read
    sent : file for the undamaged lines
    """

    def __init__(
        self,
        drive: Drive,
        terminal: Terminal,
        *,
        speed: float = 1.0,
        sent: BinaryIO | None = None,
    ) -> None:
        self._drive, self._terminal, self._sent = drive, terminal, sent
        self._controller = Controller(drive)
        generator = np.random.default_rng([drive.seed, 1])
        self._unplug_at = _moments(drive.unplugged, drive.lines, generator)  # lines
        self._rate, self._speed = drive.rate * speed, speed
        self._start, self._next, self._good = 0.0, 0, 0

    def run(self) -> int:
        """Play all lines; the number of undamaged ones."""
        self._wait_for_host()
        self._start = time.monotonic()
        while self._next < self._drive.lines:
            for line in self._terminal.received():
                self._controller.obey(self._next, line)
            unplug = self._unplug_at[0] if self._unplug_at else self._drive.lines
            stop = min(self._due(), self._next + _BATCH, self._drive.lines, unplug)
            if self._next >= unplug:
                self._unplug()
                self._next = self._resumed(self._next + 1)
            elif stop <= self._next:
                time.sleep(min(_WAIT, 0.5 / self._drive.rate / self._speed))
            elif self._send_lines(stop):
                self._next = stop
            else:  # the host has closed the port
                self._next = stop
                self._wait_for_host()
                self._next = self._resumed(stop)
        self._terminal.drain()
        return self._good

    def _due(self) -> int:
        """Number of lines due by now: all, at an infinite rate."""
        if math.isinf(self._rate):
            return self._drive.lines
        return int((time.monotonic() - self._start) * self._rate) + 1

    def _resumed(self, line: int) -> int:
        """The line to continue with after a pause: in real time the lines meanwhile are lost."""
        return line if math.isinf(self._rate) else max(line, self._due())

    def _wait_for_host(self) -> None:
        """Wait until the port is open and, where the protocol has a begin command, that came."""
        controller, begin = self._controller, self._drive.rig.protocol.begin
        stopped, controller.stopped = controller.stopped, True
        while controller.stopped if begin else not self._terminal.is_open():
            for line in self._terminal.received(_WAIT):
                controller.obey(self._next, line)
            if not begin:
                time.sleep(_WAIT)
        controller.stopped = stopped and controller.stopped

    def _unplug(self) -> None:
        """Pull the cable in the middle of a line, and plug it in again."""
        self._unplug_at.pop(0)
        self._send(self._controller.line(self._next)[:_HALF_LINE])
        self._terminal.drain()
        self._terminal.unplug()
        time.sleep(_UNPLUGGED / max(self._speed, 1.0))
        self._terminal.plug()
        self._wait_for_host()

    def _send_lines(self, stop: int) -> bool:
        """Send the lines before `stop`, some of them damaged; False where nobody reads them."""
        content, undamaged = b"", []
        for k in range(self._next, stop):
            line = self._controller.line(k)
            damaged = self._controller.damaged(line)
            content += line if damaged is None else damaged
            if damaged is None:
                undamaged.append(line)
        if not self._send(content):
            return False
        if self._sent is not None:
            self._sent.writelines(undamaged)
            self._sent.flush()
        self._good += len(undamaged)
        return True

    def _send(self, content: bytes) -> bool:
        """Send all bytes; False where the host has closed the port."""
        while content:
            done = self._terminal.send(content, 0.1)
            content = content[done:]
            if not done and not self._terminal.is_open():
                return False
        return True
