"""Friction compensation in closed loop, on a simulated rig whose friction truly sticks.

    python comparisons/compensation.py [--seeds 20]

Two links with a motor each are moved from point to point and rest there, by a controller with
noisy angles and torques that act late; its masses are 3 % off. Friction is not compensated, or as
it was fitted to simulated recordings, or 20 % too small or too large. Printed are the tracking
error (RMS over moves and joints), and what moves in the last two seconds of rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from script import call

import frictionid as fid
from frictionid.arrays import times
from frictionid.mechanics import Plant
from frictionid.simulate import Camera, Curve, Drive, Rig, Run, Sine, Stribeck, sampled_loop
from frictionid.simulate.rig import nominal_mechanism, true_system

Array = NDArray[np.float64]

RATE = 250.0  # [Hz] of the controller
NOISE = 2e-4  # [rad], standard deviation of measured angles
DELAY = 0.006  # [s], by which torques act late
POINTS = ((0.0, 0.0), (0.9, -0.6), (-0.4, 0.5), (-0.3, 0.45), (0.5, 0.9), (0.0, 0.0))
MOVE, REST, LAST = 0.7, 0.5, 10.0  # [s]
STILL = 2.0  # [s], the end of the last rest, in which nothing should move
SWING = 5e-4  # [rad]: more than that is a limit cycle
POLES = (14.0, 14.0)  # [rad/s], bandwidth of each joint's control
FACTORS = {"none": 0.0, "fitted": 1.0, "20 % too small": 0.8, "20 % too large": 1.2}
RIG = Rig(
    name="compensation",
    mechanism={
        "kind": "double_pendulum",
        "parameters": {
            **{"m1": 0.5, "m2": 0.35, "l1": 0.2, "r1": 0.12, "r2": 0.12},
            **{"I1": 0.012, "I2": 0.009, "Ir": 4e-5, "gr": 6.0},
        },
    },
    true_parameters={"m1": 0.515, "m2": 0.36},
    friction=Stribeck(
        Curve(
            *((0.12, 0.08), (0.12, 0.08), (0.01, 0.006)),
            *((0.05, 0.04), (0.05, 0.04), (0.15, 0.2)),
        )
    ),
    camera=Camera(samples=360, rate=60.0, angle_noise=1e-3),
    drive=Drive(rate=60.0),
    recordings=tuple(
        Run(f"run{k}", (0.4 * k, -0.3 * k), torques=(Sine(0.5 + 0.1 * k, f), Sine(0.3, 1.3 * f)))
        for k, f in enumerate((0.4, 0.7, 1.1, 0.5))
    ),
)


@dataclass(frozen=True)
class Outcome:
    """Of each run (R,): RMS error of moves, at rest, and the peak to peak of its motion [rad]."""

    error: Array
    rest_error: Array
    swing: Array


def reference(time: Array) -> Array:
    """Position, velocity and acceleration (3, T, 2): minimum-jerk moves, and rests between."""
    out, begin = np.zeros((3, len(time), 2)), 0.0
    out[0] = POINTS[0]
    for a, b in zip(np.array(POINTS[:-1]), np.array(POINTS[1:]), strict=True):
        s = np.clip((time - begin) / MOVE, 0.0, 1.0)[:, None]
        shape = (10 * s**3 - 15 * s**4 + 6 * s**5) * (b - a)
        out[0] = np.where((time > begin)[:, None], a + shape, out[0])
        out[1] += (30 * s**2 - 60 * s**3 + 30 * s**4) * (b - a) / MOVE
        out[2] += (60 * s - 180 * s**2 + 120 * s**3) * (b - a) / MOVE**2
        begin += MOVE + REST
    return out


def closed_loop(
    forward: Array, integral: float, seeds: Sequence[int], *, time: Array, wanted: Array
) -> Outcome:
    """Runs with feed-forward torques (V, T, 2), one for each variant and seed, R = V S."""
    system, nominal = true_system(RIG), Plant.from_parameters(nominal_mechanism(RIG), {})
    variants, count = len(forward), len(seeds)
    M = np.diagonal(nominal.terms(np.zeros(2), np.zeros(2)).M)
    kp, kd = M * np.square(POLES), 1.4 * M * np.array(POLES)
    ki = integral * kp
    noise = NOISE * np.stack(
        [np.random.default_rng(s).standard_normal((len(time), 2)) for s in seeds], axis=1
    )
    noise, own = np.tile(noise, (1, variants, 1)), np.repeat(forward, count, axis=0)
    step, smoothing = 1 / RATE, 1 - np.exp(-2 * np.pi * 30.0 / RATE)  # 30 Hz on the velocity
    before = {"q": wanted[0, 0] + noise[0], "w": 0.0 * noise[0], "sum": 0.0 * noise[0]}

    def command(k: int, y: Array) -> Array:
        q = y[0] + noise[k]
        w = before["w"] + smoothing * ((q - before["q"]) / step - before["w"])
        off = wanted[0, k] - q
        before.update(q=q, w=w, sum=before["sum"] + step * off)
        return own[:, k] + kp * off + kd * (wanted[1, k] - w) + ki * before["sum"]

    start = np.zeros((3, variants * count, 2))
    start[0] = wanted[0, 0]
    states, _ = sampled_loop(system, command, start, time, delay=DELAY, substeps=2)
    return _outcome(states, wanted, time)


def _outcome(states: Array, wanted: Array, time: Array) -> Outcome:
    off = states[:, 0] - wanted[0][:, None]
    moving = (wanted[1] != 0).any(axis=-1)
    last = time > time[-1] - STILL
    swing = np.ptp(states[last, 0], axis=0).max(axis=-1)
    error, rest = (np.sqrt((off[part] ** 2).mean(axis=(0, 2))) for part in (moving, last))
    return Outcome(error, rest, swing)


def torques(friction: fid.Friction, settings: fid.Compensation, wanted: Array) -> Array:
    """Feed-forward torques (V, T, 2) of all variants: the machine's, and friction's."""
    nominal = Plant.from_parameters(nominal_mechanism(RIG), {})
    M, h = nominal.dynamics(wanted[0], wanted[1])
    machine = times(M, wanted[2]) - h
    out = []
    for factor in FACTORS.values():
        part = machine
        if factor:
            wrong = scaled(friction, factor)
            part = part + fid.feed_forward(wrong, settings, 1 / RATE, wanted[1], wanted[2])
        out.append(part)
    return np.array(out)


def scaled(friction: fid.Friction, factor: float) -> fid.Friction:
    """The friction with all torques so many times as large, its velocities the same."""
    torque = np.array([unit.startswith("N m") for unit in friction.law.units])
    return replace(friction, theta=np.where(torque, factor, 1.0) * friction.theta)


def trial(seeds: Sequence[int], integral: float) -> Mapping[str, Outcome]:
    """Outcome of each variant over seeds of the sensors' noise."""
    time = np.arange(0.0, (len(POINTS) - 1) * (MOVE + REST) + LAST, 1 / RATE)
    fitted = fid.fit(fid.simulate(RIG), "stribeck", method="one_step").friction
    wanted = reference(time)
    forward = torques(fitted, fid.Compensation(gain=0.95, ahead=DELAY), wanted)
    done = closed_loop(forward, integral, seeds, time=time, wanted=wanted)
    split = [np.reshape(v, (len(FACTORS), -1)) for v in vars(done).values()]
    return {name: Outcome(*(v[i] for v in split)) for i, name in enumerate(FACTORS)}


def main(*, seeds: int = 20) -> None:
    """Print a table of all variants, with and without integral action."""
    heads = ("control", "compensated", "error [mrad]", "at rest [mrad]", "swing at rest [mrad]")
    swings = f"runs that swing by {1e3 * SWING:g} mrad"
    table = Table(*heads, swings, title=f"Compensation in closed loop, {seeds} seeds")
    for control, integral in (("PD", 0.0), ("PID", 1.5)):
        for name, own in trial(range(seeds), integral).items():
            error, rest, swing = (
                f"{1e3 * v.mean():.2f} +- {1e3 * v.std():.2f}"
                for v in (own.error, own.rest_error, own.swing)
            )
            table.add_row(control, name, error, rest, swing, f"{(own.swing > SWING).sum()}")
    Console().print(table)


if __name__ == "__main__":
    call(main)
