"""All signals of a recording from the columns of one table, as a dataset.toml describes them."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.errors import InputError

from ..recording import Recording, TrueMotion, base_motion
from ..servo import Servo, servo_torque
from ..signals import Signal, check_span
from .column_toml import CURRENTS, OWN, UNITS, Motor
from .dataset_toml import DatasetToml
from .machine_toml import Base
from .table import Table, signal_of

_GAPS = 2.0  # of the targets' usual gaps, by which they may begin late or end early


def recorded(
    table: Table, toml: DatasetToml, name: str, parameters: Mapping[str, float]
) -> Recording:
    """Recording of a table, see `signals_of`."""
    return Recording(name, parameters=parameters, **signals_of(table, toml, name))


def signals_of(table: Table, toml: DatasetToml, name: str = "") -> dict[str, Any]:
    """Signals of a table in SI units, each on its clock, by the names that a `Recording` has.

    A name is that of the recording.

    Raises
    ------
    InputError
        At the first row whose time does not increase or where a cell is empty or not finite.
    """
    columns = toml.columns
    assert columns is not None
    seen = table.complete(columns.angle) if columns.missing == "drop" else table
    if not len(seen.rows):
        raise InputError(f"{table.file}: no row has all angles; name other columns")
    signal, at_joints = partial(_signal, seen, toml), partial(_at_joints, motor=toml.motor)
    truth = None
    if columns.truth:
        truth = TrueMotion(
            signal("angle", columns.truth.angle)._replace(sigma=None),
            signal("velocity", columns.truth.velocity)._replace(sigma=None),
        )
    velocity = None
    if columns.velocity:
        velocity = at_joints(
            "velocity", signal("velocity", columns.velocity, columns.velocity_clock)
        )
    angle = signal("angle", columns.angle)
    if columns.sigma is not None:
        sigma = signal("angle", columns.sigma).value * toml.signs.each("angle")
        angle = angle._replace(sigma=sigma)
    angle = at_joints("angle", angle)
    servo = None if toml.actuator is None else _servo(table, toml, name, angle)
    if servo is None:
        clock = columns.time.torque if any(columns.torque) else ""
        torque = _signal(table, toml, "torque", columns.torque, clock, toml.hold.torque)
        torque = at_joints("torque", torque)
    else:
        torque = servo_torque(servo, angle)
    covariates = {key: signal("", [column]) for key, column in columns.covariates.items()}
    base = {} if toml.base is None else _on_base(seen, toml, toml.base, angle.time)
    signals = {"angle": angle, "torque": torque, "velocity": velocity, "covariates": covariates}
    return {**signals, "truth": truth, "servo": servo, **base}


def _on_base(table: Table, toml: DatasetToml, base: Base, time: Array) -> dict[str, Signal | None]:
    """Motion of the base by its sensors, and the wrench on it; time : of the angles."""
    signals = {}
    if base.wrench == "none":
        signals["wrench"] = Signal(time[[0, -1]], np.zeros((2, 6)), "linear")
    for quantity, names in base.columns.items():
        signal = _signal(table, toml, "", names, base.time or "")
        signals[quantity] = signal._replace(value=signal.value * base.units.scale(quantity))
    wrench = signals.pop("wrench", None)
    motion = base_motion(**signals, turn=base.sensor_rotation, place=base.sensor_position)
    return {"base_motion": motion, "base_wrench": wrench}


def _signal(
    table: Table,
    toml: DatasetToml,
    quantity: str,
    names: list[str],
    clock: str = "",
    hold: str | None = "linear",
) -> Signal:
    """Columns on a clock, "" the angles', in SI units; as they are where the quantity is ""."""
    assert toml.columns is not None
    sigma = getattr(toml.sigma, quantity) if quantity else None
    unit = np.array(toml.signs.each(quantity), float)
    if quantity:
        unit = unit * np.array(toml.units.scales(quantity))
    if toml.motor is not None and quantity:
        by_motor = np.isin(getattr(toml.units, quantity), [*OWN[quantity], *CURRENTS])
        unit = unit * np.where(by_motor, toml.motor.unit(quantity), 1.0)
    return signal_of(
        table,
        clock or toml.columns.time.angle,
        names,
        second=UNITS["time"][toml.units.time],
        unit=unit,
        hold=hold,
        sparse=len(toml.asked.clocks) > 1,  # rows may lack the time of one
        sigma=None if sigma is None else np.full(len(names), sigma),
    )


def _at_joints(quantity: str, signal: Signal, motor: Motor | None) -> Signal:
    """The signal of the joints from that of the motors, see `Motor`."""
    if motor is None:
        return signal
    torque = quantity == "torque"
    offset = np.array(motor.offset) if quantity == "angle" else 0.0
    if not (motor.torque_at_shaft if torque else motor.angle == "motor"):
        return signal._replace(value=signal.value + offset)
    C = motor.matrix(signal.value.shape[1])
    to_joints = C if torque else np.linalg.inv(C).T
    sigma = signal.sigma
    if sigma is not None:
        sigma = np.sqrt(np.square(sigma) @ np.square(to_joints))
    with np.errstate(over="ignore", invalid="ignore"):
        return signal._replace(value=signal.value @ to_joints + offset, sigma=sigma)


def _servo(table: Table, toml: DatasetToml, name: str, angle: Signal) -> Servo:
    """Servo of a recording; targets are in the frame of its angles (T, n).

    Raises
    ------
    InputError
        Where a target is missing or no number, or the targets do not cover the angles.
    """
    assert toml.actuator is not None
    actuator = toml.actuator.in_recording(name)

    def signal(quantity: str, names: list[str], hold: str = actuator.hold) -> Signal:
        columns = _signal(table, toml, quantity, names, actuator.time or "", hold)
        columns = columns._replace(sigma=None)
        return _at_joints(quantity, columns, toml.motor) if quantity else columns

    goal = signal("angle" if actuator.kind == "position" else "velocity", actuator.target)
    gaps = [usual_step(s.time) for s in (goal, angle) if len(s.time) > 1]
    check_span(f"{table.file}: targets are", goal, angle, _GAPS * max(gaps, default=0.0))
    goal_velocity = feedforward = None
    if actuator.target_velocity:
        goal_velocity = signal("velocity", actuator.target_velocity)
    if actuator.feedforward:
        feedforward = signal("", actuator.feedforward)
        feedforward = feedforward._replace(value=feedforward.value * toml.signs.each("torque"))
    supply = actuator.supply
    on = np.ones((len(goal.time), angle.value.shape[1]))
    if actuator.enabled is not None:
        on = on * signal("", [actuator.enabled]).value
    limit = 1.0 if actuator.output == "duty" else np.inf
    return Servo(
        goal=goal,
        enabled=Signal(goal.time, on, "previous"),
        gain=actuator.scale * np.array(actuator.P),
        limit=np.array(actuator.limit or [limit]),
        supply=signal("", [supply], "linear") if isinstance(supply, str) else supply or np.nan,
        kt=actuator.kt or np.nan,
        R=actuator.R or np.nan,
        damping=actuator.scale * np.array(actuator.D),
        goal_velocity=goal_velocity,
        feedforward=feedforward,
        target=actuator.kind,
        output=actuator.output,
        current_limit=actuator.current_limit or np.inf,
        ratio=np.array(actuator.gear),
        efficiency=np.array(actuator.efficiency),
        target_delay=actuator.delay,
        backlash=np.array(actuator.backlash),
        envelope=actuator.envelope,
    )
