"""Motion under a position controller: the torque follows from the motion, sample by sample.

    u = u_nominal(reference) + kp (q_reference - q) + kd (w_reference - w)

A robot's drives sample the angles, compute the torques, and hold them until the next sample.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from frictionid.arrays import times
from frictionid.config import NotNegative, Positive, check_settings
from frictionid.data.signals import Array
from frictionid.errors import InputError
from frictionid.mechanics import Plant
from frictionid.progress import report_step
from frictionid.simulate.integrate import TrueSystem, advance, modes_after_jump, next_modes


@dataclass(frozen=True)
class Fourier:
    """Periodic reference of one joint's position [Swevers1997].

        q = offset + sum_k (sines[k] sin(k W t) - cosines[k] cos(k W t)) / (k W)
        W = 2 pi frequency

    sines, cosines : amplitudes of the velocity's harmonics [rad/s]; frequency [Hz]

    >>> Fourier((1.0,), (0.0,), frequency=1 / (2 * np.pi)).motion(np.array([0.0, np.pi / 2]))[0]
    array([0., 1.])
    """

    sines: Annotated[tuple[float, ...], Field(min_length=1)]
    cosines: tuple[float, ...]
    frequency: Positive
    offset: float = 0.0

    def __post_init__(self) -> None:
        check_settings(self)
        if len(self.sines) != len(self.cosines):
            raise InputError(
                f"a Fourier reference needs as many sines as cosines, not {len(self.sines)} and "
                f"{len(self.cosines)}"
            )

    def motion(self, time: Array) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration at times (T,), (T,) each."""
        rate = 2 * np.pi * self.frequency * np.arange(1, len(self.sines) + 1)
        s, c = np.sin(np.multiply.outer(time, rate)), np.cos(np.multiply.outer(time, rate))
        a, b = np.array(self.sines), np.array(self.cosines)
        q = self.offset + s @ (a / rate) - c @ (b / rate)
        return q, c @ a + s @ b, c @ (b * rate) - s @ (a * rate)


@dataclass(frozen=True)
class Controller:
    """Position controller: stiffness kp [N m/rad] and damping kd [N m s/rad] of each joint."""

    kp: tuple[Positive, ...]
    kd: tuple[NotNegative, ...]

    def __post_init__(self) -> None:
        check_settings(self)


class Tracked(NamedTuple):
    """States (T, 3, R, n) at the samples, and the torques (T, R, n) commanded at them [N m]."""

    states: Array
    torque: Array


def track(
    system: TrueSystem,
    nominal: Plant,
    controller: Controller,
    references: Sequence[Sequence[Fourier]],
    time: Array,
    *,
    delay: float = 0.0,
    gain: float = 1.0,
    substeps: int = 4,
) -> Tracked:
    """Motion of R recordings side by side under the controller, one reference per joint each.

    nominal : the model in the controller
    time : (T,) [s], evenly spaced samples of the controller
    delay : [s], by which a command acts later; gain : by which it acts stronger
    substeps : steps of the integration between two samples

    >>> from frictionid.mechanics import pendulum
    >>> from frictionid.simulate.true_friction import Curve, Stribeck
    >>> machine = pendulum(mass=1.0, length=0.5)
    >>> nominal = Plant.from_parameters(machine, {})
    >>> system = TrueSystem(machine, nominal.p, Stribeck(Curve((0.5,), (0.5,), (0.1,))))
    >>> wanted, time = Fourier((1.0,), (0.0,), 0.5), np.arange(500) * 0.002
    >>> done = track(system, nominal, Controller((400.0,), (20.0,)), [[wanted]], time)
    >>> bool(np.abs(done.states[:, 0, 0, 0] - wanted.motion(time)[0]).max() < 0.003)
    True
    """
    motions = [[joint.motion(time) for joint in run] for run in references]
    wanted = np.moveaxis(np.array(motions), (0, 1, 2, 3), (2, 3, 1, 0))  # (T, 3, R, n)
    M, h = nominal.dynamics(wanted[:, 0], wanted[:, 1])
    forward = times(M, wanted[:, 2]) - h
    kp, kd, motors = np.array(controller.kp), np.array(controller.kd), system.mechanism.motors
    start = np.stack([*wanted[0, :2], system.friction.start(wanted[0, 1])])

    def command(k: int, y: Array) -> Array:
        off = wanted[k, :2] - y[:2]
        return motors * (forward[k] + kp * off[0] + kd * off[1])

    return sampled_loop(system, command, start, time, delay=delay, gain=gain, substeps=substeps)


def sampled_loop(
    system: TrueSystem,
    command: Callable[[int, Array], Array],
    start: Array,
    time: Array,
    *,
    delay: float = 0.0,
    gain: float = 1.0,
    substeps: int = 4,
) -> Tracked:
    """Motion of R machines side by side under torques that a controller commands at samples.

    Parameters
    ----------
    system : TrueSystem
    command : function of sample k and true states (3, R, n) to torques (R, n) [N m]
        They are held until the next sample.
    start : array, shape (3, R, n)
        Angles, velocities and memory of friction, see `TrueFriction.start`.
    time : (T,) [s], evenly spaced samples
    delay : [s], by which a command acts later; gain : by which it acts stronger
    substeps : steps of the integration between two samples
    """
    width = float(time[1] - time[0])
    late, rest = divmod(delay / width, 1.0)
    y = start
    states, torque = np.empty((len(time), *y.shape)), np.empty((len(time), *y.shape[1:]))
    mode = next_modes(system, y, 0.0 * y[0])
    for k in range(len(time)):
        states[k] = y
        torque[k] = command(k, y)
        for share, at in ((rest, k - int(late) - 1), (1.0 - rest, k - int(late))):
            if share > 1e-9 and k < len(time) - 1:
                u = gain * torque[max(at, 0)]
                mode = modes_after_jump(system, y, u, mode)
                count = max(1, round(share * substeps))
                for _ in range(count):
                    y, mode = advance(system, y, u, mode, share * width / count)
        if k % 100 == 0:
            report_step("simulating", len(time) - k)
    return Tracked(states, torque)
