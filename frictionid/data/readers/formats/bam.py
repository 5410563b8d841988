"""Reader `bam`: logs of a position-controlled servo with a pendulum [Duclusaud2025].

Torque is not measured. It follows from the firmware's controller and the model of a DC motor:

    duty = gain kp (goal - q), within +-limit;  u = kt (vin duty - kt w)/R

and is exactly zero while the firmware has the motor disconnected.
"""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PositiveFloat

from frictionid.config import Strict, checked
from frictionid.errors import InputError
from frictionid.files import read_bytes, unzip

from ...recordings import Recording
from ...servo import Servo, servo_torque, terminal_voltage
from ...signals import Array, Signal, first_fault, taken
from ..table import table_name

# Firmware of the XL330: 4096 counts a turn, divided by 256 times a full duty of 885.
XL330_GAIN = 4096 / (2 * math.pi) / (256 * 885)
WORD = 65536
LARGEST = 1e100  # the product of three such numbers is finite
ENTRY = ("timestamp", "position", "goal_position", "load", "temp", "input_volts", "torque_enable")


class BamSettings(Strict):
    """Settings of the reader `bam`.

    kt : torque constant [N m/A]; R : resistance [Ohm]; gain : duty per radian and unit of kp;
    limit : largest duty; vin : supply [V], by default that of the log; offset : [rad], added to the
    angles so that 0 hangs down; phase : part of each log
    """

    kt: PositiveFloat
    R: PositiveFloat
    gain: PositiveFloat = XL330_GAIN
    limit: Annotated[float, Field(gt=0, le=1)] = 1.0
    vin: PositiveFloat | None = None
    offset: float = 0.0
    phase: Literal["all", "driven", "passive"] = "all"


def read(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angle, servo and modelled motor torque of a log (.json, .json.gz), its pendulum's dimensions.

    The velocity for the back-EMF is the central difference of the angles; the logged one lags by
    more than 20 ms. Covariates are the voltage [V] at the motor, zero where it is disconnected, and
    as logged: load (the duty, 885 is full), supply [V] and temperature [deg C].
    """
    chosen = checked(BamSettings, settings, f"{path}: [reader]")
    file = str(path)
    log = _log(unzip(read_bytes(path), file), file)
    columns = _columns(log["entries"], file)
    driven = columns["torque_enable"] > 0
    keep = _phase(driven, chosen.phase, file)

    def signal(value: Array) -> Signal:
        return Signal(columns["timestamp"], value[:, None])

    angle = signal(columns["position"] + chosen.offset)
    servo = Servo(  # its controller needs differences of angles only, not their zero
        goal=signal(columns["goal_position"] + chosen.offset),
        enabled=signal(driven.astype(float))._replace(hold="previous"),
        gain=chosen.gain * log["kp"],
        limit=chosen.limit,
        supply=log["vin"] if chosen.vin is None else chosen.vin,
        kt=chosen.kt,
        R=chosen.R,
    )
    signals = {
        "angle": angle,
        "torque": servo_torque(servo, angle),
        "voltage": terminal_voltage(servo, angle),
        "load": signal(signed_word(columns["load"])),
        "supply": signal(columns["input_volts"]),
        "temperature": signal(columns["temp"]),
    }
    kept = {key: taken(s, keep) for key, s in signals.items()}
    return Recording(
        table_name(path.name),
        angle=kept.pop("angle"),
        torque=kept.pop("torque"),
        parameters=_pendulum(log),
        covariates=kept,
        servo=servo,
    )


def signed_word(word: Array) -> Array:
    """Signed values of unsigned 16-bit words.

    >>> signed_word(np.array([3.0, 65535.0]))
    array([ 3., -1.])
    """
    return np.where(word >= WORD / 2, word - WORD, word)


def _pendulum(log: Mapping[str, Any]) -> dict[str, float]:
    """Parameters of the pendulum: a point mass at the end of an arm, a uniform rod."""
    mass, arm, length = log["mass"], log["arm_mass"], log["length"]
    if arm == 0:
        return {"mass": mass, "length": length}
    # the arm counts with half of its mass in gravity, and a third in inertia
    return {"mass": mass + arm / 2, "length": length, "inertia": -arm * length**2 / 6}


def _log(content: bytes, file: str) -> dict[str, Any]:
    """The log, its numbers checked; the mass of the arm is zero where it is missing."""
    try:
        log = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file} is no JSON ({str(error)[:80]}); copy it again") from None
    if not isinstance(log, dict) or not isinstance(log.get("entries"), list):
        raise InputError(f"{file} is no log of bam: it has no list of entries")
    if len(log["entries"]) < 3:
        raise InputError(f"{file} has {len(log['entries'])} entries; a motion needs at least 3")
    log["arm_mass"] = log.get("arm_mass", log.get("arm-mass", 0.0))
    for name in ("mass", "length", "kp", "vin", "arm_mass"):
        log[name] = _number(log.get(name), f"{file}: {name}")
        if not log[name] > 0 and not (name == "arm_mass" and log[name] == 0):
            raise InputError(f"{file}: {name} must be positive, not {log[name]:g}")
    return log


def _columns(entries: Sequence[Any], file: str) -> dict[str, Array]:
    """Each quantity of the entries, shape (T,); times increase and all is finite."""
    table = np.empty((len(entries), len(ENTRY)))
    for row, entry in enumerate(entries):
        where = f"{file}, entry {row} (the first is 0)"
        if not isinstance(entry, dict):
            raise InputError(f"{where} is no object; delete it")
        table[row] = [_number(entry.get(name), f"{where}: {name}") for name in ENTRY]
    fault = first_fault(table[:, 0], table[:, 1:], ENTRY)
    if fault:
        raise InputError(f"{file}, entry {fault[0]} (the first is 0): {fault[1]}; delete it")
    return dict(zip(ENTRY, table.T, strict=True))


def _number(value: Any, where: str) -> float:
    if not isinstance(value, int | float):
        fault = "is missing" if value is None else f"is {repr(value)[:40]}, which is no number"
        raise InputError(f"{where} {fault}; repair the log")
    if abs(value) > LARGEST:
        raise InputError(f"{where} is too large; repair the log")
    return float(value)


def _phase(driven: np.ndarray, phase: str, file: str) -> np.ndarray:
    """Entries of a phase, which must be contiguous."""
    if phase == "all":
        return np.ones_like(driven)
    keep = driven if phase == "driven" else ~driven
    count = int(np.count_nonzero(np.diff(keep.astype(int)) == 1) + keep[0])
    if count != 1:
        raise InputError(f"{file} has {count} {phase} phases; leave it out, or use phase = 'all'")
    return keep
