"""Friction, servos and delays as MJCF's own elements hold them: no code runs beside the file.

Joints hold Coulomb friction (`frictionloss`), viscous friction and drag (`damping`, a polynomial),
and the back-EMF of servos, as MJX leaves out the damping of actuators. What friction differs by
direction is a constant torque of the motor.
A `dcmotor` without a motor holds the bristles of LuGre and Dahl, by the same exact solution as
ours, or one harmonic of cogging; with one, position control within a torque-speed envelope. A
`general` actuator holds position control within a limit, gain and bias of a torque. Both hold a
delay of their command, read between steps from its history [MuJoCo2026].
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.data.envelope import Envelope
from frictionid.friction import Friction, Law
from frictionid.friction.laws import Cogging, CoulombViscous, Dahl, LuGre, Quadratic, Sum

from .exported import ExportedFriction
from .nearest import cost_of, followed, nearest, sliding, whose_gains

# a motor without constants, as `dcmotor` needs some: its back-EMF is 1e-12 N m s/rad
_NO_MOTOR = {"input": "none", "motorconst": "1e-06 1e-06", "resistance": "1.0"}
HISTORY = "history of controls begins at 0: start elsewhere with mj_initCtrlHistory"


def is_native(model: ExportedFriction) -> bool:
    """Whether MJCF has elements for a law that is not Coulomb and viscous friction."""
    law = model.law
    return (
        isinstance(law, Quadratic)
        or (isinstance(law, Dahl) and not law.motor_load)
        or (isinstance(law, LuGre) and law.symmetric)
        or cogging_of(law) is not None
    )


def cogging_of(law: Law) -> Cogging | None:
    """Cogging of one harmonic beside Coulomb, viscous friction and drag; None of other laws."""
    if not isinstance(law, Sum) or len(law.parts) != 2:
        return None
    base, other = law.parts
    plain = isinstance(base, Quadratic) or (isinstance(base, CoulombViscous) and base.symmetric)
    if not plain or not isinstance(other, Cogging) or len(other.orders) != 1:
        return None
    return other if float(other.orders[0] * other.gear).is_integer() else None


def held(model: ExportedFriction, motors: Sequence[int] | None = None) -> Friction:
    """The friction that MJCF holds: the model's own, without its continuation, else the nearest.

    Bristles have no damping: `dcmotor` has one that does not fade with the speed, which put
    predictions six times as far off as none.

    motors : places of joints whose motors hold a constant torque, None for all that are driven
    """
    if not is_native(model):
        return _by_direction(model, list(model.driven.values()) if motors is None else motors)
    theta = np.array(model.friction.theta, dtype=float)
    if isinstance(model.law, LuGre):
        theta[:, model.law.names.index("damping")] = 0.0
    return replace(model.friction, law=model.law.sharpened(), theta=theta)


def _by_direction(model: ExportedFriction, motors: Sequence[int]) -> Friction:
    """Nearest Coulomb and viscous friction, with levels by direction at joints with motors."""
    apart = np.zeros(model.friction.n)
    plain = [j for j in motors if model.envelope(j) is None]
    apart[plain] = uneven(model)[plain]
    even = nearest(model, apart)
    if not apart.any():
        return even
    level, slope = even.theta.T
    apart = np.clip(apart, -level, level)
    theta = np.stack([level + apart, level - apart, slope], axis=-1)
    return replace(even, law=CoulombViscous(symmetric=False), theta=theta)


def uneven(model: ExportedFriction) -> Array:
    """Constant part (n,) of the torque of sliding [N m]: the mean of both directions.

    Zero where the torque follows more than the velocity, and where no speeds are known.

    >>> from frictionid.deploy.export.exported import exported
    >>> law = CoulombViscous(symmetric=False)
    >>> uneven(exported(Friction(law, np.array([[0.3, 0.1, 0.02]])), speeds=(10.0,))).round(9)
    array([0.1])
    """
    is_known = model.prepared is not None or bool(model.speeds)
    if model.law.has_memory or followed(model) or not is_known:
        return np.zeros(model.friction.n)
    w, _, fast = sliding(model)
    sharp = replace(model.friction, law=model.friction.law.sharpened())
    both = (sharp.curve(w) + sharp.curve(-w)) / 2
    return np.asarray(np.mean(both, axis=0, where=fast | ~fast.any(axis=0)))


def constant(friction: Friction) -> Array:
    """Constant torque (n,) [N m] of a friction that MJCF holds, beside level and damping."""
    law = friction.law
    if isinstance(law, CoulombViscous) and not law.symmetric:
        return np.asarray(friction.theta @ [0.5, -0.5, 0.0])
    return np.zeros(friction.n)


def joint_values(friction: Friction, j: int, back_emf: float) -> dict[str, str]:
    """Attributes of a joint: level, and damping by powers of the velocity.

    >>> import numpy as np
    >>> joint_values(Friction(Quadratic(), np.array([[0.1, 0.02, 0.003]])), 0, 0.0)
    {'frictionloss': '0.1', 'damping': '0.02 0.003'}
    """
    law, row = friction.law, [float(x) for x in friction.theta[j]]
    if isinstance(law, Dahl | LuGre):
        viscous = row[law.names.index("viscous")]
        return {"frictionloss": "0.0", "damping": repr(viscous + back_emf)}
    if not getattr(law, "symmetric", True):
        row = [(row[0] + row[1]) / 2, row[2]]
    slope, *drag = row[1:-2] if cogging_of(law) else row[1:]
    slopes = " ".join(map(repr, (slope + back_emf, *drag)))
    return {"frictionloss": repr(row[0]), "damping": slopes}


def passive_motor(friction: Friction, j: int) -> dict[str, str]:
    """Attributes of a `dcmotor` that holds bristles or cogging; none for laws without these."""
    law = friction.law
    if (cogging := cogging_of(law)) is not None:
        cos, sin = map(float, friction.theta[j, -2:])  # it pulls against ours
        numbers = (math.hypot(cos, sin), math.atan2(-cos, -sin))
        poles = round(cogging.orders[0] * cogging.gear)
        return {**_NO_MOTOR, "cogging": f"{numbers[0]!r} {poles} {numbers[1]!r}"}
    if not isinstance(law, Dahl | LuGre):
        return {}
    values = dict(zip(law.names, map(float, friction.theta[j]), strict=True))
    level = values["coulomb"]
    top = level + values.get("peak", 0.0)
    velocity = values.get("stribeck_velocity", 1.0)
    row = (top / values["presliding"], 0.0, level, top, velocity)
    return {**_NO_MOTOR, "lugre": " ".join(map(repr, row))} if top else {}


def lost_bristles(model: ExportedFriction) -> list[str]:
    """A sentence on LuGre's damping, where there is some."""
    if not isinstance(model.law, LuGre) or not model.friction.theta[:, -2].any():
        return []
    return ["the bristles' damping fades with the speed, dcmotor's does not: it is left out"]


def lost_in_mjx(model: ExportedFriction, actuators: Sequence[bytes]) -> list[str]:
    """A sentence on what MJX 3.17 has in place of dcmotors, where the new actuators have some."""
    if b"<dcmotor" not in b"".join(actuators):
        return []
    said = "MJX 3.17 takes no dcmotor (MuJoCo Warp does)"
    if model.data is not None and is_native(model):
        cost = cost_of(model, nearest(model))
        said += (
            f"; the nearest frictionloss and damping are {cost.apart:.2g} {cost.unit} from ours "
            f"after {model.horizon:g} s"
        )
    return [said]


def is_stiff(model: ExportedFriction, timestep: float) -> bool:
    """Whether RK4 cannot follow bristles at steps of `timestep` [s]; `implicitfast` can.

    They relax at |w| s0/g(w), which is to stay below 2.8 a step.
    """
    law, speeds = model.law, model.speeds or (20.0,)
    if not isinstance(law, Dahl | LuGre):
        return False
    values = dict(zip(law.names, model.friction.theta.T, strict=True))
    top = values["coulomb"] + values.get("peak", 0.0)
    rate = np.array(speeds) * top / np.maximum(values["presliding"] * values["coulomb"], 1e-12)
    return bool((rate * timestep > 2.0).any())


def actuator_of(
    model: ExportedFriction, j: int, against: float = 0.0
) -> tuple[str, dict[str, str]]:
    """Element and attributes of an actuator for a joint's motor; none where `motor` is the same.

    A `dcmotor` where it has an envelope, else a `general`, as a torque needs that is scaled or
    biased. Its control is the target of a servo, which is delayed, else the logged torque.

    against : constant friction [N m] against which the motor pulls
    """
    drive, envelope = model.drive, model.envelope(j)
    of_torque = model.calibration
    gain, bias = (float(np.asarray(x)[j]) for x in (of_torque.gain, of_torque.bias - against))
    if drive is None and (gain, bias) != (1.0, 0.0):
        return "general", _affine(gain, (bias, 0.0, 0.0))
    if envelope is not None:
        gains = (0.0, 0.0) if drive is None else (drive.kp[j], drive.kv[j])
        return "dcmotor", _dc_motor(envelope, *gains)
    if drive is None:
        return "general", {}
    kp, kv, limit, bias = (
        float(x[j]) for x in (drive.kp, drive.kv, drive.limit, drive.bias - against)
    )
    values = _affine(kp, (bias, 0.0 - kp, 0.0 - kv))
    if math.isfinite(limit):
        values["forcerange"] = f"{bias - limit!r} {bias + limit!r}"
    return "general", values


def _dc_motor(motor: Envelope, kp: float, kv: float) -> dict[str, str]:
    """Attributes of a `dcmotor` of 1 Ohm, under position control or a torque."""
    K = math.sqrt(motor.slope)
    return {
        "motorconst": f"{K!r} {K!r}",
        "resistance": "1.0",
        "input": "pos" if kp or kv else "ff",
        "controller": f"{float(kp)!r} 0 {float(kv)!r} 0 0 {float(motor.stall) / K!r}",
        "saturation": f"{float(motor.peak)!r} 0 0",
    }


def _affine(gain: float, bias: tuple[float, float, float]) -> dict[str, str]:
    """Attributes of the force gain u + bias (1, q, w)."""
    numbers = " ".join(map(repr, bias))
    return {"gainprm": repr(gain), "biastype": "affine", "biasprm": numbers}


def delay_values(delay: float, timestep: float) -> dict[str, str]:
    """Attributes of an actuator whose control acts later, at steps of `timestep` [s] or more.

    >>> delay_values(0.0031, 0.001)
    {'delay': '0.0031', 'nsample': '5', 'interp': 'linear'}
    """
    if delay <= 0:
        return {}
    samples = math.ceil(delay / timestep - 1e-9) + 1
    return {"delay": repr(delay), "nsample": str(samples), "interp": "linear"}


def said_of_motors(model: ExportedFriction, *, is_late: bool) -> list[str]:
    """Sentences on what the actuators do, and on what of a calibration they do not."""
    notes, delay = [], model.delay
    if model.drive is not None:
        notes += ["the actuators are position control: ctrl is the target", *whose_gains(model)]
    if any(actuator_of(model, j)[0] == "dcmotor" for j in model.driven.values()):
        notes.append(
            "motors are dcmotors of 1 Ohm, whose voltage and torque limits are the envelope"
        )
        if model.drive is not None and np.any(model.drive.bias):
            notes.append("a dcmotor has no constant torque: the servo's bias is left out")
    if is_late:
        notes.append(
            f"controls act {1e3 * delay:.3g} ms late (MuJoCo 3.5, not MJX 3.17); {HISTORY}"
        )
    if delay < 0:
        notes.append(f"controls would act {-1e3 * delay:.3g} ms early: MuJoCo cannot advance them")
    if np.any(model.calibration.offset):
        notes.append("angles are the true ones: logged ones less the calibration's offset")
    return notes
