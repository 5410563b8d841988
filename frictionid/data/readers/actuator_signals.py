"""The servo of a recording from the columns of its table, as [actuator] describes it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.data.readers.actuator_toml import Actuator
from frictionid.data.readers.dataset_toml import RELATIVE, UNITS, DatasetToml
from frictionid.data.readers.table import Table
from frictionid.data.readers.table_signals import signal_of
from frictionid.data.servo import Servo
from frictionid.data.signals import Array, Signal
from frictionid.errors import InputError

_GAPS = 2.0  # of its own usual gaps, by which targets may begin late or end early


def servo_of(table: Table, toml: DatasetToml, name: str, angle: Signal) -> Servo:
    """Servo of a recording; targets are in the frame of its angles (T, n).

    Raises
    ------
    InputError
        Where a target is missing or no number, or the targets do not cover the angles.
    """
    assert toml.actuator is not None and toml.columns is not None
    own = toml.actuator.in_recording(name)
    quantity = "angle" if own.kind == "position" else "velocity"
    goal = _signal(table, toml, own, own.target, quantity)
    _check_span(table.file, goal, angle)
    rate, more = own.target_velocity, own.feedforward
    limit = 1.0 if own.output == "duty" else np.inf
    supply: float | Signal = float("nan")
    if isinstance(own.supply, str):
        supply = _signal(table, toml, own, [own.supply], "", "linear")
    elif own.supply is not None:
        supply = own.supply
    n = angle.value.shape[1]
    on = np.ones((len(goal.time), n))
    if own.enabled is not None:
        on = on * _signal(table, toml, own, [own.enabled], "").value
    return Servo(
        goal=goal,
        enabled=Signal(goal.time, on, "previous"),
        gain=own.scale * np.array(own.P),
        limit=np.array([limit] if own.limit is None else own.limit),
        supply=supply,
        kt=float("nan") if own.kt is None else own.kt,
        R=float("nan") if own.R is None else own.R,
        damping=own.scale * np.array(own.D),
        goal_velocity=_signal(table, toml, own, rate, "velocity") if rate else None,
        feedforward=_signal(table, toml, own, more, "torque") if more else None,
        target=own.kind,
        output=own.output,
        current_limit=own.current_limit or np.inf,
        ratio=np.array(own.gear),
        efficiency=np.array(own.efficiency),
        target_delay=own.delay,
        backlash=np.array(own.backlash),
    )


def _signal(
    table: Table,
    toml: DatasetToml,
    own: Actuator,
    names: Sequence[str],
    quantity: str,
    hold: str | None = None,
) -> Signal:
    """Columns on the clock of the targets: of angles and velocities in SI units, others as is."""
    columns = toml.columns
    assert columns is not None
    unit: Array = np.ones(1)
    if quantity:
        unit = np.array(toml.signs.of(quantity), float)
    if quantity in ("angle", "velocity"):
        unit = unit * np.array(toml.units.scales(quantity))
        units = getattr(toml.units, quantity)
        if toml.motor is not None:
            relative = np.isin(units, RELATIVE[quantity])
            unit = unit * np.where(relative, toml.motor.unit(quantity), 1.0)
    found = signal_of(
        table,
        own.time or columns.time.angle,
        list(names),
        second=UNITS["time"][toml.units.time],
        unit=unit,
        hold=hold or own.hold,
        sparse=toml.asked.two_clocks,
    )
    at_motor = toml.motor is not None and toml.motor.angle == "motor"
    if not at_motor or quantity not in ("angle", "velocity"):
        return found
    assert toml.motor is not None
    offset = np.array(toml.motor.offset) if quantity == "angle" else 0.0
    to_joints = np.linalg.inv(toml.motor.matrix(found.value.shape[1])).T
    return found._replace(value=found.value @ to_joints + offset)


def _check_span(file: str, goal: Signal, angle: Signal) -> None:
    gap = float(np.median(np.diff(goal.time))) if len(goal.time) > 1 else 0.0
    gap = _GAPS * max(gap, float(np.median(np.diff(angle.time))))
    begin, end = float(angle.time[0]), float(angle.time[-1])
    if goal.time[0] > begin + gap or goal.time[-1] < end - gap:
        raise InputError(
            f"{file}: targets are known from {goal.time[0]:g} to {goal.time[-1]:g} s only, the "
            f"angles from {begin:g} to {end:g} s: keep the common span by start and stop in "
            "[recordings], or log the targets throughout"
        )
