"""Friction as parameter files of BAM, for its simulators of servos: models M1 to M6."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

from frictionid.arrays import Array
from frictionid.friction import Friction, Law
from frictionid.friction.bam_files import GEAR, MODELS, MOTOR
from frictionid.friction.laws import CoulombViscous, GearLoad, MotorLoad, Stribeck
from frictionid.friction.laws.levels import VELOCITIES

from ..exported import ExportedFriction, ExportSettings, Written
from ..nearest import followed, matched, sliding

_ALPHA = 2.0  # exponent of our Stribeck peak
_NONE = 1.0  # [rad/s], Stribeck velocity of a friction without a peak


_NAMES: Mapping[type[Law], tuple[str, ...]] = {
    CoulombViscous: ("friction_base", "friction_viscous"),
    Stribeck: ("friction_base", "friction_stribeck", "dtheta_stribeck", "friction_viscous"),
    GearLoad: GEAR,
}


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A parameter file for each joint; `name` is BAM's name of the actuator."""
    friction, files, kinds = held(model), {}, set()
    for j in range(friction.n):
        kind, values = _smallest(friction, j)
        kinds.add(kind.upper())
        if isinstance(friction.law, GearLoad) and kind > "m2":
            values["moment"] = friction.law.moment
        motor = _motor(model, j)
        document = {**motor, **values, "model": kind, "actuator": settings.name}
        ending = ".json" if j == 0 else f"_{j + 1}.json"
        files[ending] = (json.dumps(document, indent=1) + "\n").encode()
    lost, is_same = [], _is_plain(model.law) and model.law.sharpened() != model.law
    if not is_same:
        lost.append(
            f"BAM has no {type(model.law).__name__}: {' and '.join(sorted(kinds))} is the nearest "
            f"to the model's torques, by least squares {matched(model)}"
        )
    if missing := [name for name in MOTOR if name not in motor]:
        lost.append(f"{', '.join(missing)} of the motor are not known: BAM takes its own values")
    lost += _uncalibrated(model)
    return Written(files, tuple(lost), None if is_same else friction)


def held(model: ExportedFriction) -> Friction:
    """The friction among BAM's that is nearest to the model, itself where it is one of them.

    Of other laws that is M2 (or M1, without a peak): Stribeck friction by least squares over the
    recorded motion, or over the measured speeds. Of laws that follow more than the velocity it is
    M5 with a share of the motor torque, where there are data.
    """
    law, friction = model.law, model.friction
    if _is_plain(law):
        if isinstance(law, MotorLoad):
            return _geared(friction, [[*row, 0.0, _NONE] for row in friction.theta])
        sharp = replace(law, width=CoulombViscous().width, shape="tanh")
        return replace(friction, law=sharp, constraints=None)
    w, torque, fast = sliding(model)
    u = np.zeros_like(w)
    geared = model.prepared is not None and not law.has_memory and bool(followed(model))
    if geared and model.prepared is not None:
        u = model.prepared.integral.nodes.inputs.u
    columns = zip(w.T, u.T, torque.T, fast.T, strict=True)
    rows = [_fitted(a[use], b[use], c[use]) for a, b, c, use in columns]
    if geared:
        return _geared(friction, rows)
    plain = [[level, peak, velocity, viscous] for level, viscous, _, peak, velocity in rows]
    return replace(friction, law=Stribeck(), theta=np.array(plain), constraints=None)


def _is_plain(law: Law) -> bool:
    """Whether BAM has the law: it knows one level for both directions, and no squared loss."""
    if isinstance(law, CoulombViscous | Stribeck):
        return law.symmetric
    return isinstance(law, GearLoad) or (isinstance(law, MotorLoad) and not law.squared)


def _geared(friction: Friction, rows: Sequence[Sequence[float]]) -> Friction:
    """M5 of coulomb, viscous, motor's share, peak and Stribeck velocity of each joint."""
    theta = np.zeros((len(rows), len(GEAR)))
    theta[:, [0, 1, 2, 4, 9]], theta[:, 10] = rows, _ALPHA
    return replace(friction, law=GearLoad(moment=0.0), theta=theta, constraints=None)


def _fitted(w: Array, u: Array, torque: Array) -> list[float]:
    """Numbers as of `_geared`: least squares for each Stribeck velocity, none of them negative."""
    best, least = [0.0, 0.0, 0.0, 0.0, _NONE], np.inf
    side = np.sign(w)
    for velocity in VELOCITIES:
        if not len(w) or not np.abs(w).min() < velocity < np.abs(w).max():
            continue
        peak = side * np.exp(-((w / velocity) ** 2))
        numbers, off = nnls(np.stack([side, w, np.abs(u) * side, peak], axis=-1), torque)
        if off < least:
            best, least = [*map(float, numbers), velocity], off
    return best


_IDEAL = {"delay": 0.0, "gain": 1.0, "bias": 0.0, "offset": 0.0}


def _uncalibrated(model: ExportedFriction) -> list[str]:
    """What BAM's test bench takes as it knows it, where the model has estimated something else."""
    calibration = model.calibration
    names = [
        k for k, ideal in _IDEAL.items() if np.any(np.asarray(getattr(calibration, k)) != ideal)
    ]
    if calibration.base is not None:
        names.append("inertias and gravity but for the armature")
    return [f"BAM's files do not hold the model's {', '.join(names)}"] if names else []


def _smallest(friction: Friction, joint: int) -> tuple[str, dict[str, float]]:
    """The smallest of BAM's models that holds one joint's parameters, and its numbers."""
    values = dict.fromkeys(GEAR, 0.0) | {"dtheta_stribeck": _NONE, "alpha": _ALPHA}
    theta = map(float, friction.theta[joint])
    values |= dict(zip(_NAMES[type(friction.law)], theta, strict=True))
    motor, external = values["load_friction_motor"], values["load_friction_external"]
    peak, other_peak = (values[f"load_friction_{x}_stribeck"] for x in ("motor", "external"))
    values |= {"load_friction_base": motor, "load_friction_stribeck": peak}
    if values["load_friction_motor_quad"] or values["load_friction_external_quad"]:
        kind = "m6"
    elif (motor, peak) != (external, other_peak):
        kind = "m5"
    elif values["friction_stribeck"] or peak:
        kind = "m4" if motor or peak else "m2"
    else:
        kind = "m3" if motor else "m1"
    return kind, {name: values[name] for name in MODELS[kind]}


def _motor(model: ExportedFriction, joint: int) -> dict[str, float]:
    """Numbers of a joint's motor by BAM's names, at its output; none that is not known.

    A fitted torque constant is the motor's, whose gear the data know.
    """
    calibration, mechanism, ratio = model.calibration, model.mechanism, 1.0
    numbers: dict[str, Any] = dict(model.friction.parameters)
    if mechanism is not None and "rotor" in (nominal := mechanism.nominal()):
        nominal["rotor"] = numbers.get("rotor", nominal["rotor"])
        numbers["rotor"] = nominal["rotor"] * nominal.get("gear", 1.0) ** 2
        if calibration.base is not None:  # inertia beyond the nominal one counts as the rotor's
            numbers["rotor"] += calibration.base[0] - mechanism.base(nominal)[0]
    if calibration.motor is not None:
        (numbers["kt"], numbers["R"]), ratio = calibration.motor, math.nan
    servo = None if model.data is None else model.data.recordings[0].servo
    if servo is not None:
        numbers = {"kt": servo.kt, "R": servo.R, **numbers}
        ratio = np.broadcast_to(servo.ratio, model.friction.n)[joint]
    numbers["kt"] = ratio * numbers.get("kt", math.nan)
    values = {name: float(numbers.get(ours, math.nan)) for name, ours in MOTOR.items()}
    return {name: value for name, value in values.items() if 0 < value < math.inf}
