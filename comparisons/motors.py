"""Motors on simulated rigs with truth: torque-speed envelopes, harmonics of cogging by evidence.

    python comparisons/motors.py [CASES]

The rigs are servos with an integrator, a friction and an envelope of their own
(`drive_logs`), 200 Hz, angles with noise of 0.2 mrad. Printed are relative
errors, median and largest, and how often which harmonics are chosen.
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np
import pandas as pd
from drive_logs import ServoPendulum
from numpy.typing import NDArray

import frictionid as fid
from frictionid.data.plants import plant_of
from frictionid.fitting.identifiers.start_of_fit import harmonics
from frictionid.fitting.one_step.recipe import INTEGRAL, training_problem
from frictionid.friction.laws import Cogging, Sum

MOTORS = ((0.4, 2.0, 5.0), (0.3, 2.0, 4.0), (0.35, 1.0, 6.0), (0.4, 3.0, 4.0), (0.3, 1.0, 8.0))
NAMES = ("peak", "knee", "no_load")
WAVES = ((6, 0.02, 0.6), (12, 0.01, -1.2))
PLAIN = {
    "Coulomb and viscous": ServoPendulum(),
    "a tenth of the torque beside them": ServoPendulum(load=0.1),
    "less friction, more noise": ServoPendulum(noise=5e-4, viscous=0.005),
    "torque held, 100 Hz": ServoPendulum(held=True, rate=100.0),
}


def rig_data(
    rig: ServoPendulum, seed: int, noise: float = 0.0, gains: tuple[float, float] = (10.0, 0.15)
) -> fid.Dataset:
    """Three to six recordings of 6 s whose torque is logged, with noise [N m]."""
    frames = {}
    for k in range(3 + seed % 4):
        log = pd.DataFrame(rig.log(*gains, seed=100 * seed + k, seconds=6.0))
        log["u"] += noise * np.random.default_rng(seed).normal(size=len(log))
        frames[f"{k}"] = log
    machine = fid.mechanisms.pendulum(mass=rig.mass, length=rig.length)
    columns = {"time": "t", "angle": "q", "torque": "u", "hold": "previous"}
    return fid.Dataset.from_frames(frames, machine, **columns)


def by_motion(rig: ServoPendulum, guess: tuple[float, ...], seed: int) -> fid.Fit:
    """A fit of friction, delay and envelope to recordings without any torque."""
    frames = {
        f"{k}": pd.DataFrame(rig.log(10.0, 0.15, seed=100 * seed + k, seconds=6.0))
        for k in range(3)
    }
    actuator = dict(target="target", output="torque", P=10.0, D=0.15, delay=rig.delay)
    actuator |= dict(zip(("peak_torque", "knee_speed", "no_load_speed"), guess, strict=True))
    machine = fid.mechanisms.pendulum(mass=rig.mass, length=rig.length)
    plain = {name: frame.drop(columns="u") for name, frame in frames.items()}
    data = fid.Dataset.from_frames(plain, machine, time="t", angle="q", actuator=actuator)
    free = ["target_delay", "envelope"]
    return fid.fit(data, "coulomb_viscous", method="shooting", free=free)


def show(what: str, errors: list[NDArray[np.float64]]) -> None:
    """Print errors (cases, 3) of peak, knee and no-load speed."""
    off = np.abs(errors)
    parts = (
        f"{name} {100 * np.nanmedian(x):.2g} % ({100 * np.nanmax(x):.2g} %), "
        f"{np.isnan(x).sum()} not reached"
        for name, x in zip(NAMES, off.T, strict=True)
    )
    print(f"{what}, {len(off)} cases: {'; '.join(parts)}", flush=True)


def envelopes(cases: int) -> None:
    """Print errors of envelopes by measured torques, and by the motion alone."""
    for noise in (0.0, 0.005):
        errors = []
        for seed in range(cases):
            for motor in MOTORS:
                rig = ServoPendulum(**dict(zip(NAMES, motor, strict=True)))
                frame = fid.check(rig_data(rig, seed, noise)).torque_speed
                errors.append(frame[list(NAMES)].to_numpy(dtype=float)[0] / motor - 1)
        show(f"measured torque, noise {noise} N m", errors)
    errors = []
    for seed in range(max(cases // 5, 1)):
        for motor in MOTORS:
            rig = ServoPendulum(**dict(zip(NAMES, motor, strict=True)))
            fit = by_motion(rig, tuple(np.array(motor) * (1.2, 0.8, 1.1)), seed)
            values = fit.frame[fit.frame.block == "envelope"].value.to_numpy()
            errors.append(values / motor - 1)
    show("motion alone, begun 10 to 20 % off", errors)


def chosen(data: fid.Dataset, law: Cogging | fid.Ripple) -> tuple[int, ...]:
    """Harmonics of the joint that the rows of a one-step fit show."""
    problem = training_problem(data, plant_of(data), INTEGRAL)
    has = harmonics(law, problem, np.ones((1, len(problem.r))))[0, 0]
    return tuple(np.array(law.orders)[has].tolist())


def choices(cases: int) -> None:
    """Print which harmonics are chosen where there are none, and where there are two."""
    gains = ((30.0, 0.2), (10.0, 0.15))
    for name, rig in PLAIN.items():
        for law in (Cogging("auto"), fid.Ripple(harmonics="auto")):
            data = (rig_data(rig, s, gains=gains[s % 2]) for s in range(cases))
            print(f"none, {name}: {law.kind} {Counter(chosen(d, law) for d in data)}", flush=True)
    for share in (1.0, 0.25):
        waves = tuple((k, share * size, phase) for k, size, phase in WAVES)
        rig = ServoPendulum(waves=waves)
        data = (rig_data(rig, s, gains=gains[s % 2]) for s in range(cases))
        print(f"{waves}: {Counter(chosen(d, Cogging('auto')) for d in data)}", flush=True)


def amplitudes(cases: int) -> None:
    """Print errors of amplitudes and phases by shooting, where the right ones are chosen."""
    errors = []
    for seed in range(cases):
        law = Sum(("coulomb_viscous", Cogging("auto")))
        data = rig_data(ServoPendulum(waves=WAVES), seed, gains=(20.0, 0.2))
        friction = fid.fit(data, law, method="shooting").friction
        values = dict(zip(friction.law.names, friction.theta[0], strict=True))
        if not {"cos_6", "cos_12"} <= set(values):
            continue
        for k, size, phase in WAVES:
            cos, sin = values[f"cos_{k}"], values[f"sin_{k}"]
            errors.append([np.hypot(cos, sin) / size - 1, np.arctan2(-sin, cos) / phase - 1])
    for name, x in zip(("amplitude", "phase"), np.abs(errors).T, strict=True):
        middle, largest = 100 * np.median(x), 100 * x.max()
        print(f"{name}, {len(x)} waves: {middle:.2g} % ({largest:.2g} %)", flush=True)


if __name__ == "__main__":
    count = int(sys.argv[1]) if sys.argv[1:] else 20
    envelopes(count)
    choices(count)
    amplitudes(max(count // 2, 1))
