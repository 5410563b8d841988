"""All signals of a recording from the columns of one table, as a dataset.toml describes them."""

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from frictionid.data.readers.actuator_signals import servo_of
from frictionid.data.readers.column_toml import ColumnNames
from frictionid.data.readers.dataset_toml import RELATIVE, UNITS, DatasetToml
from frictionid.data.readers.motor_toml import Motor
from frictionid.data.readers.table import Table
from frictionid.data.readers.table_signals import signal_of
from frictionid.data.servo import Servo, servo_torque
from frictionid.data.signals import Signal
from frictionid.errors import InputError


class Recorded(NamedTuple):
    """Signals of a recording in SI units, each on its clock; truth: noise-free angle, velocity.

    servo : what makes the torque, where the table says targets in its place
    """

    angle: Signal
    torque: Signal
    velocity: Signal | None
    covariates: Mapping[str, Signal]
    truth: tuple[Signal, Signal] | None
    servo: Servo | None = None


def recorded(table: Table, toml: DatasetToml, name: str = "") -> Recorded:
    """Signals of a table in SI units; a name is that of the recording.

    Raises
    ------
    InputError
        At the first row whose time does not increase or where a cell is empty or not finite.
    """
    columns = toml.columns
    assert columns is not None
    whole = table
    if columns.missing == "drop":
        table = _seen(table, columns)
    signals = partial(_signal, table, toml, columns)
    truth = None
    if columns.truth:
        truth = (
            signals("angle", columns.truth.angle)._replace(sigma=None),
            signals("velocity", columns.truth.velocity)._replace(sigma=None),
        )
    velocity = signals("velocity", columns.velocity) if columns.velocity else None
    angle = _with_deviations(signals("angle", columns.angle), table, toml, columns)
    angle = _at_joints(angle, toml.motor, "angle")
    servo = None if toml.actuator is None else servo_of(whole, toml, name, angle)
    if servo is None:
        torque = _signal(whole, toml, columns, "torque", columns.torque)
        torque = _at_joints(torque, toml.motor, "torque")
    else:
        torque = servo_torque(servo, angle)
    return Recorded(
        angle=angle,
        torque=torque,
        velocity=velocity and _at_joints(velocity, toml.motor, "velocity"),
        covariates={key: signals("", [column]) for key, column in columns.covariates.items()},
        truth=truth,
        servo=servo,
    )


def _at_joints(signal: Signal, motor: Motor | None, quantity: str) -> Signal:
    """The signal of the joints from that of the motors, see `Motor`."""
    if motor is None:
        return signal
    torque = quantity == "torque"
    if not (motor.torque_at_shaft if torque else motor.angle == "motor"):
        return signal
    C = motor.matrix(signal.value.shape[1])
    to_joints = C if torque else np.linalg.inv(C).T
    offset = np.array(motor.offset) if quantity == "angle" else 0.0
    sigma = signal.sigma
    if sigma is not None:
        sigma = np.sqrt(np.square(sigma) @ np.square(to_joints))
    with np.errstate(over="ignore", invalid="ignore"):
        return signal._replace(value=signal.value @ to_joints + offset, sigma=sigma)


def _seen(table: Table, columns: ColumnNames) -> Table:
    """The rows that have all angles."""
    cells = np.stack([table.columns[name] for name in columns.angle])
    keep = ~np.isnan(cells).any(axis=0)
    if not keep.any():
        raise InputError(f"{table.file}: no row has all angles; name other columns")
    return Table(table.file, table.rows[keep], {k: v[keep] for k, v in table.columns.items()})


def _with_deviations(
    angle: Signal, table: Table, toml: DatasetToml, columns: ColumnNames
) -> Signal:
    """The angles with the standard deviation of each sample, where the table has columns for it."""
    if columns.sigma is None:
        return angle
    sigma = _signal(table, toml, columns, "angle", columns.sigma).value
    return angle._replace(sigma=sigma * toml.signs.of("angle"))


def _signal(
    table: Table, toml: DatasetToml, columns: ColumnNames, quantity: str, names: list[str]
) -> Signal:
    """Columns of a table on their clock, in SI units; covariates ("") keep the unit of the file."""
    torque = quantity == "torque"
    clock = columns.time.torque if torque and any(names) else columns.time.angle
    if quantity == "velocity" and names == columns.velocity:
        clock = columns.velocity_clock
    sigma = getattr(toml.sigma, quantity) if quantity else None
    unit: Any = np.array(toml.units.scales(quantity) if quantity else [1.0])
    unit = unit * np.array(toml.signs.of(quantity), float)
    if toml.motor is not None and quantity:
        units = getattr(toml.units, quantity)
        unit = unit * np.where(np.isin(units, RELATIVE[quantity]), toml.motor.unit(quantity), 1.0)
    return signal_of(
        table,
        clock,
        names,
        second=UNITS["time"][toml.units.time],
        unit=unit,
        hold=toml.hold.torque if torque else "linear",
        sparse=toml.asked.two_clocks,
        sigma=None if sigma is None else np.full(len(names), sigma),
    )
