"""A serial port that may be unplugged: bytes in, bytes out, and mistakes in one line."""

from __future__ import annotations

import errno
import os
import select
from pathlib import Path
from typing import Any

import serial
from serial.tools import list_ports

from frictionid.errors import InputError

_CHUNK = 65536
_WRITE_TIMEOUT = 1.0  # [s]


class UnpluggedError(Exception):
    """The port is gone."""


class Port:
    """An open serial port.

    Raises
    ------
    InputError
        Where it does not exist, is busy or may not be opened.
    UnpluggedError
        From all methods, where the port is gone.
    """

    def __init__(self, name: str, baud: int) -> None:
        self.name = name
        try:
            # exclusive: another reader would take bytes away
            self._serial: Any = serial.Serial(
                name, baud, timeout=0, write_timeout=_WRITE_TIMEOUT, exclusive=True
            )
        except (serial.SerialException, OSError, ValueError, OverflowError) as error:
            raise InputError(_complaint(name, baud, error)) from None

    def read(self, timeout: float) -> bytes:
        """Bytes that came within `timeout` [s]."""
        try:
            handle = self._serial.fileno()
            if not select.select([handle], [], [], timeout)[0]:
                return b""
            new = os.read(handle, _CHUNK)
        except (serial.SerialException, OSError, TypeError) as error:
            raise UnpluggedError(str(error)) from None
        if not new:
            raise UnpluggedError("nothing to read from a port that has something")
        return new

    def write(self, content: bytes) -> None:
        """Send bytes."""
        try:
            self._serial.write(content)
        except (serial.SerialException, OSError) as error:
            raise UnpluggedError(str(error)) from None

    def close(self) -> None:
        """Close the port."""
        try:
            self._serial.close()
        except (serial.SerialException, OSError):
            pass


def _complaint(name: str, baud: int, error: Exception) -> str:
    number = getattr(error, "errno", None)
    text = str(error)
    if number == errno.ENOENT or not Path(name).exists():
        known = sorted(p.device for p in list_ports.comports())
        there = f"; there are {', '.join(known)}" if known else "; plug the drive in"
        return f"there is no port {name}{there}"
    if number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK) or "lock" in text:
        return f"port {name} is busy: another program has it open; close that first"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"port {name} is not open to you: become a member of its group "
            f"({_group(name)}), and log in again"
        )
    if isinstance(error, ValueError | OverflowError):
        return f"port {name} has no rate of {baud} baud; choose another with --baud"
    return f"port {name} cannot be opened ({os.strerror(number) if number else text}); check it"


def _group(name: str) -> str:
    try:
        return Path(name).group()
    except (OSError, KeyError):
        return "often dialout"
