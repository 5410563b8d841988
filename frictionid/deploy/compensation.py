"""Friction compensation: a torque that cancels friction along a reference, without chatter."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
import pandas as pd
from pydantic import Field

from frictionid.arrays import Array, namespace, numbers_like, plain
from frictionid.config import NotNegative, Positive, validated
from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, Memory
from frictionid.friction.friction import Nodes, along
from frictionid.friction.law import Law, refuse_temperature
from frictionid.friction.wrapped import LinearOutside, WrappedLaw


def friction_in(model: Any) -> Friction:
    """A friction as it is, and that of a fit.

    Raises
    ------
    InputError
        For anything else, parameters that are NaN, and friction that depends on the temperature.
    """
    friction = getattr(model, "friction", model)
    if not isinstance(friction, Friction):
        raise InputError(
            f"a friction must be a Friction or a Fit, not {model!r:.60}: "
            'fid.load_model("model.json") reads a file'
        )
    if np.isnan(plain(friction.theta)).any():
        raise InputError("a friction has parameters that are nan: give numbers, or fit again")
    refuse_temperature(friction.law, "a simulator or controller")
    return friction


def check_step(dt: Any, where: str) -> None:
    """Refuse a time of one step that is no positive number of seconds."""
    if not (isinstance(dt, int | float) and 0 < dt < np.inf):
        raise InputError(f"{where}: dt = {dt!r} s must be a positive time of one step")


def per_joint(x: Any, n: int, theta: Array, where: str) -> Array:
    """Numbers (..., n) as an array like theta; `where` names the function and the argument."""
    out = numbers_like(x, theta, where)
    if out.ndim == 0 or out.shape[-1] != n:
        raise InputError(
            f"{where} has shape {tuple(out.shape)}; its last axis must have one number for each of "
            f"{n} joints"
        )
    return out


_MOVING = 1e-6  # [rad/s]: the level at rest is that of the slowest motion


@validated
class Compensation:
    """Settings of a feed-forward compensation.

        u = gain (F(|v|) (1 + s) + F(-|v|) (1 - s)) / 2,   s = tanh(v / smooth),
        v = w_reference + ahead a_reference

    F is the friction law, without its own smoothing of sgn(w). u follows the reference, never the
    measured velocity: it closes no loop, and noise cannot make it chatter. While the reference
    rests, v = 0, friction holds the joint, and u is zero (or half of what two directions differ
    by); with the reference's acceleration, u grows to the break-away level in the direction to
    come. gain <= 1: friction that is compensated too much drives a joint.

    Attributes
    ----------
    gain : share of friction that is compensated, above 0, at most 1
    smooth : reference speed [rad/s, or m/s] over which u changes sides; one, or one for each joint
    ahead : time [s] by which the reference is read ahead, such as the delay of the drive
    torque_limit : largest u [N m], one, or one for each joint; None: no limit

    Examples
    --------
    >>> Compensation(gain=1.2)
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: gain: it should be less than or equal to 1, not 1.2
    """

    gain: Annotated[float, Field(gt=0.0, le=1.0)] = 0.9
    smooth: Positive | tuple[Positive, ...] = 0.05
    ahead: NotNegative = 0.0
    torque_limit: Positive | tuple[Positive, ...] | None = None


@dataclass(frozen=True)
class CompensationLaw(WrappedLaw):
    """What compensates a law, as a law of the reference velocity; see `Compensation`.

    What works on laws works on it: curves, memory along a motion, export as code.
    """

    settings: Compensation
    cannot_be_saved = "a compensation: save the friction itself, and give the settings again"

    @property
    def facts(self) -> tuple[str, ...]:
        """Lines on what it computes, for the head of a file."""
        s = self.settings
        ahead = f", {s.ahead:g} s ahead" if s.ahead else ""
        limit = f", and is at most {listed(s.torque_limit)}" if s.torque_limit else ""
        return (
            f"Compensation: {s.gain:g} of the friction {bare(self.law)}.",
            f"w is the velocity of the reference{ahead}, not the measured one; "
            "add Tf to the motor torque.",
            f"Tf changes sides over |w| = {listed(s.smooth)}{limit}.",
        )

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        law, speed = self.law.sharpened(), namespace(x.w).abs(x.w) + _MOVING
        forth = law.torque(theta, x._replace(w=speed), memory)
        back = law.torque(theta, x._replace(w=-speed), memory)
        return self.between(x.w, forth, back)

    def between(self, w: Array, forth: Array, back: Array) -> Array:
        """The compensation at velocities w of the reference, of friction in both directions."""
        xp, settings = namespace(w), self.settings
        side = xp.tanh(w / np.asarray(settings.smooth))
        u = 0.5 * settings.gain * ((1.0 + side) * forth + (1.0 - side) * back)
        if settings.torque_limit is None:
            return u
        most = np.asarray(settings.torque_limit) + 0.0 * u
        return xp.minimum(xp.maximum(u, -most), most)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * self.torque(theta, x, memory)


def listed(values: Any) -> str:
    """Numbers with four digits.

    >>> listed((0.05, 1 / 3)), listed(2.0)
    ('0.05, 0.3333', '2')
    """
    return ", ".join(f"{value:.4g}" for value in np.ravel(values))


def continued(law: Law, speeds: Sequence[float]) -> Law:
    """A law with a straight line beyond these speeds; of a compensation, within its limits."""
    if isinstance(law, CompensationLaw):
        return replace(law, law=continued(law.law, speeds))
    return LinearOutside(bare(law), tuple(speeds))


def bare(law: Law) -> Law:
    """A law without its continuation."""
    return law.law if isinstance(law, LinearOutside) else law


def compensating(friction: Any, settings: Compensation | None = None) -> Friction:
    """The compensation of a Friction or Fit, as a friction of the reference velocity.

    Beyond the speeds of the data, where the friction knows them, it goes on as a straight line.

    Raises
    ------
    InputError
        For models without friction torques, and settings of another number of joints.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> friction = Friction(CoulombViscous(), np.array([[0.1, 0.02]]))
    >>> torque = compensating(friction, Compensation(gain=0.9, smooth=0.05, torque_limit=0.12))
    >>> torque.curve(np.array([-2.0, 0.0, 1.0, 5.0])).ravel().round(3)
    array([-0.12 ,  0.   ,  0.108,  0.12 ])
    """
    settings, friction = settings or Compensation(), friction_in(friction)
    if friction.mechanism:
        raise InputError("a model without physics has no friction torque to compensate")
    for name in ("smooth", "torque_limit"):
        numbers = getattr(settings, name)
        if isinstance(numbers, tuple) and len(numbers) != friction.n:
            raise InputError(
                f"compensation: {name} has {len(numbers)} numbers, the friction {friction.n} joints"
            )
    source = friction.provenance
    speeds = tuple(max(speed, _MOVING) for speed in source.speeds)
    if len(speeds) not in (0, friction.n):
        raise InputError(f"{len(speeds)} speeds for {friction.n} joints: give one each")
    law = continued(friction.law, speeds) if speeds else friction.law
    return replace(friction, law=CompensationLaw(law, settings))


def feed_forward(
    friction: Any,
    settings: Compensation,
    dt: float,
    w: Array,
    a: Array | None = None,
    *,
    q: Array | None = None,
    u: Array | None = None,
    load: Array | None = None,
) -> Array:
    """Compensation (T, n) [N m] along a reference.

    Parameters
    ----------
    friction : Friction, theta (n, P), or Fit
    settings : Compensation
    dt : float
        Time [s] between two samples of the reference. Over the step before a sample, memory of
        friction follows the sample's velocity, as in exported code: of a torque that is held until
        the next sample that is twice as exact as the mean velocity of the step.
    w, a : arrays, shape (T, n)
        Velocities [rad/s] and accelerations [rad/s^2] of the reference.
    q, u, load : arrays, shape (T, n), optional
        Positions, motor torques and loads of the reference, for laws that depend on them.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> friction = Friction(CoulombViscous(), np.array([[0.1, 0.0]]))
    >>> w = np.array([[0.0], [0.0], [1.0]])
    >>> a = np.array([[0.0], [50.0], [50.0]])                          # it is about to move
    >>> feed_forward(friction, Compensation(gain=1.0, ahead=0.005), 0.01, w, a).ravel().round(3)
    array([0. , 0.1, 0.1])
    """
    compensation = compensating(friction, settings)
    check_step(dt, "feed_forward")
    named = {"w": w, "a": a, "q": q, "u": u, "load": load}
    columns = {
        key: per_joint(x, compensation.n, compensation.theta, f"feed_forward: {key}")
        for key, x in named.items()
        if x is not None
    }
    for key, x in columns.items():
        if x.shape != columns["w"].shape or x.ndim != 2 or not np.isfinite(plain(x)).all():
            raise InputError(f"feed_forward: {key} must be finite numbers (T, n), and as many as w")
    v = columns["w"] + settings.ahead * columns.get("a", 0.0)
    inputs = Inputs(*({**columns, "w": v}.get(key, 0.0 * v) for key in ("q", "w", "u", "load")))
    nodes = Nodes(inputs, dt * np.arange(len(v)), np.array([0, len(v)]), newest=True)
    return along(compensation, nodes)


def compensation_table(
    friction: Any,
    settings: Compensation,
    speeds: Sequence[float],
    joints: Sequence[str] = (),
    points: int = 201,
) -> pd.DataFrame:
    """Compensation over reference velocity, for drives that interpolate tables.

    Parameters
    ----------
    friction : Friction, theta (n, P), or Fit
        Of laws with memory the steady state.
    settings : Compensation
    speeds : of each joint [rad/s or m/s], the table's last one
    joints : names; those of the friction where they are missing
    points : of each joint; half of them stand where the torque changes sides, the others in steps
        that grow with the speed

    Returns
    -------
    DataFrame
        Columns joint, velocity and torque, SI.
    """
    compensation, parts = compensating(friction, settings), []
    widths = np.broadcast_to(np.asarray(settings.smooth, dtype=float), compensation.n)
    names = tuple(joints) or compensation.joints
    if len(speeds) != compensation.n or not all(v > 0 for v in speeds):
        raise InputError(
            f"speeds = {tuple(speeds)}: give one above 0 for each of {compensation.n} joints"
        )
    half = max(points // 2, 4)
    for j, name in enumerate(names):
        near = np.linspace(0.0, min(4.0 * widths[j], speeds[j]), half // 2 + 1)
        far = np.geomspace(near[-1], speeds[j], half - half // 2 + 1)[1:]
        w = np.unique(np.concatenate([-far, -near, near, far]))
        torque = steadily(compensation, w)[:, j]
        parts.append(pd.DataFrame({"joint": name, "velocity": w, "torque": torque}))
    return pd.concat(parts, ignore_index=True)


def steadily(compensation: Friction, w: Array) -> Array:
    """Compensation (V, n) of steady sliding at velocities w (V,); none has memory."""
    law: Any = compensation.law
    friction, speed = replace(compensation, law=law.law), np.abs(w) + _MOVING
    return np.asarray(law.between(w[:, None], friction.curve(speed), friction.curve(-speed)))


def table_error(compensation: Friction, table: pd.DataFrame) -> float:
    """By how much [N m] a table, straight between its velocities, is off at most."""
    off = []
    for j, (_, part) in enumerate(table.groupby("joint", sort=False)):
        places = np.arange(len(part))
        w = np.interp(np.arange(0.0, places[-1], 0.25), places, part.velocity)
        torque = steadily(compensation, w)[:, j]
        off.append(np.abs(np.interp(w, part.velocity, part.torque) - torque).max())
    return float(max(off))
