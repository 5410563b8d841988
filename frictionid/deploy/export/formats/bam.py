"""Friction as parameter files of BAM, for its simulators of servos: models M1 to M6."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

from frictionid.arrays import Array
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.nearest import follows_more, sliding
from frictionid.evaluation.curves import slow_speed
from frictionid.friction import Friction, Law
from frictionid.friction.bam_files import GEAR, MODELS, MOTOR
from frictionid.friction.laws import CoulombViscous, GearLoad, MotorLoad, Stribeck
from frictionid.friction.laws.levels import VELOCITIES

_ALPHA = 2.0  # exponent of our Stribeck peak
_NONE = 1.0  # [rad/s], Stribeck velocity of a friction without a peak


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """A parameter file for each joint; `name` is BAM's name of the actuator."""
    friction = held(own)
    models = [_model(friction, j) for j in range(friction.n)]
    motor, missing = _motor(own)
    files = {}
    for j, (model, values) in enumerate(models):
        law = friction.law
        moment = {"moment": law.moment} if isinstance(law, GearLoad) and model > "m2" else {}
        document = {**motor, **values, **moment, "model": model, "actuator": settings.name}
        ending = ".json" if j == 0 else f"_{j + 1}.json"
        files[ending] = (json.dumps(document, indent=1) + "\n").encode()
    lost = []
    if missing:
        lost.append(f"{', '.join(missing)} of the motor are not known: BAM takes its own values")
    lost += _uncalibrated(own)
    same = _same(own)
    if not same:
        names = " and ".join(sorted({model.upper() for model, _ in models}))
        lost.insert(
            0,
            f"BAM has no {type(own.law).__name__}: {names} is the nearest to the model's torques, "
            "by least squares",
        )
    return Written(files, tuple(lost), None if same else friction)


def held(own: ExportedFriction) -> Friction:
    """The friction among BAM's that is nearest to the model, itself where it is one of them.

    Of other laws that is M2 (or M1, without a peak): Stribeck friction by least squares over the
    recorded motion, or over the measured speeds. Of laws that follow more than the velocity it is
    M5 with a share of the motor torque, where there are data.
    """
    law, theta = own.law, own.friction.theta
    if _is_plain(law) and not isinstance(law, MotorLoad):
        sharp = replace(law, width=CoulombViscous().width, shape="tanh")
        return replace(own.friction, law=sharp, constraints=None)
    if _is_plain(law):
        return _geared(own, [[*row, 0.0, _NONE] for row in theta])
    w, torque = sliding(own)
    u = np.zeros_like(w)
    geared = own.prepared is not None and not law.has_memory and follows_more(own.friction)
    if geared and own.prepared is not None:
        u = own.prepared.integral.nodes.inputs.u
    fast = np.abs(w) >= slow_speed(np.quantile(np.abs(w), 0.95, axis=0))
    columns = zip(w.T, u.T, torque.T, fast.T, strict=True)
    rows = [_fitted(a[use], b[use], c[use]) for a, b, c, use in columns]
    if geared:
        return _geared(own, rows)
    plain = [[level, peak, velocity, viscous] for level, viscous, _, peak, velocity in rows]
    return replace(own.friction, law=Stribeck(), theta=np.array(plain), constraints=None)


def _is_plain(law: Law) -> bool:
    """Whether BAM has the law: it knows one level for both directions, and no squared loss."""
    if isinstance(law, CoulombViscous | Stribeck):
        return law.symmetric
    return isinstance(law, GearLoad) or (isinstance(law, MotorLoad) and not law.squared)


def _geared(own: ExportedFriction, rows: Sequence[Sequence[float]]) -> Friction:
    """M5 of coulomb, viscous, motor's share, peak and Stribeck velocity of each joint."""
    theta = np.zeros((len(rows), len(GEAR)))
    for j, (level, viscous, share, peak, velocity) in enumerate(rows):
        theta[j, [0, 1, 2, 4, 9, 10]] = level, viscous, share, peak, velocity, _ALPHA
    return replace(own.friction, law=GearLoad(moment=0.0), theta=theta, constraints=None)


def _fitted(w: Array, u: Array, torque: Array) -> list[float]:
    """Numbers as of `_geared`: least squares for each Stribeck velocity, none of them negative."""
    best, least = [0.0, 0.0, 0.0, 0.0, _NONE], np.inf
    side = np.sign(w)
    for velocity in VELOCITIES:
        if not len(w) or not np.abs(w).min() < velocity < np.abs(w).max():
            continue
        peak = side * np.exp(-((w / velocity) ** 2))
        found, off = nnls(np.stack([side, w, np.abs(u) * side, peak], axis=-1), torque)
        if off < least:
            best, least = [*map(float, found), velocity], off
    return best


def _uncalibrated(own: ExportedFriction) -> list[str]:
    """What BAM's test bench takes as it knows it, where the model has found something else."""
    calibration = own.friction.calibration
    if calibration is None:
        return []
    found = [
        name
        for name, value, ideal in (
            ("delay", calibration.delay, 0.0),
            ("gain", calibration.gain, 1.0),
            ("bias", calibration.bias, 0.0),
            ("offset", calibration.offset, 0.0),
        )
        if np.any(np.asarray(value) != ideal)
    ]
    if calibration.base is not None:
        found.append("inertias and gravity but for the armature")
    return [f"BAM's files do not hold the model's {', '.join(found)}"] if found else []


def _same(own: ExportedFriction) -> bool:
    law = own.law
    return _is_plain(law) and law.sharpened() != law


def _model(friction: Friction, joint: int) -> tuple[str, dict[str, float]]:
    """The smallest of BAM's models that holds one joint's parameters, and its numbers."""
    theta = [float(v) for v in friction.theta[joint]]
    if isinstance(friction.law, CoulombViscous):
        level, viscous, peak, velocity = theta[0], theta[1], 0.0, _NONE
    elif isinstance(friction.law, Stribeck):
        level, peak, velocity, viscous = theta
    else:
        return _gear_model(dict(zip(GEAR, theta, strict=True)))
    values = {"friction_base": level, "friction_viscous": viscous}
    if peak == 0:
        return "m1", values
    return "m2", values | {"friction_stribeck": peak, "dtheta_stribeck": velocity, "alpha": _ALPHA}


def _gear_model(values: dict[str, float]) -> tuple[str, dict[str, float]]:
    motor, external = values["load_friction_motor"], values["load_friction_external"]
    peaks = (values["load_friction_motor_stribeck"], values["load_friction_external_stribeck"])
    values |= {"load_friction_base": motor, "load_friction_stribeck": peaks[0]}
    if values["load_friction_motor_quad"] or values["load_friction_external_quad"]:
        model = "m6"
    elif motor != external or peaks[0] != peaks[1]:
        model = "m5"
    elif values["friction_stribeck"] or peaks[0]:
        model = "m4" if motor or peaks[0] else "m2"
    else:
        model = "m3" if motor else "m1"
    return model, {name: values[name] for name in MODELS[model]}


def _motor(own: ExportedFriction) -> tuple[dict[str, float], list[str]]:
    """Numbers of the motor by BAM's names, and those that are not known."""
    known: dict[str, Any] = dict(own.friction.parameters)
    calibration = own.friction.calibration
    if calibration is not None and calibration.motor is not None:
        known["kt"], known["R"] = map(float, calibration.motor)
    if own.data is not None:
        nominal = own.data.mechanism.nominal()
        if calibration is not None and calibration.base is not None and "rotor" in nominal:
            # inertia of base parameters beyond the nominal one counts as the rotor's
            more = calibration.base[0] - own.data.mechanism.base(nominal)[0]
            known["rotor"] = nominal["rotor"] + float(more)
        servo = own.data.recordings[0].servo
        known = {"rotor": nominal.get("rotor"), **known}
        if servo is not None:
            known = {"kt": servo.kt, "R": servo.R, **known}
    values = {name: known.get(ours) for name, ours in MOTOR.items()}
    motor = {name: float(v) for name, v in values.items() if v is not None}
    if "armature" in motor and motor["armature"] < 0:
        del motor["armature"]
    return motor, [name for name in values if name not in motor]
