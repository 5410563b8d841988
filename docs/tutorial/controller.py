"""A controller moves the simulated pendulum to and fro, without and with friction compensation.

    python controller.py

It reads compensation.csv, as a drive would, and simulated.toml, whose friction truly sticks.
"""

import csv
from pathlib import Path

import numpy as np

from frictionid.mechanics import Plant
from frictionid.simulate import load_rig, sampled_loop
from frictionid.simulate.rig import nominal_mechanism, true_system

RATE, TIME = 200.0, 4.0  # [Hz], [s]
NOISE, DELAY = 3e-4, 0.004  # [rad] of the encoder, [s] of the drive
STIFF, DAMPED = 6.0, 0.7  # [N m/rad], [N m s/rad]


def main() -> None:
    """Print the tracking errors."""
    rig = load_rig(Path("simulated.toml"))
    nominal = Plant.from_parameters(nominal_mechanism(rig), {})
    time = np.arange(0.0, TIME, 1 / RATE)
    q, w, a = reference(time)
    M, h = nominal.dynamics(q[:, None], w[:, None])
    machine = M[:, 0, 0] * a - h[:, 0]
    with open("compensation.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    velocity, torque = (
        np.array([float(row[key]) for row in rows]) for key in ("velocity", "torque")
    )
    friction = np.interp(w + DELAY * a, velocity, torque)
    forward = np.stack([machine, machine + friction])  # two runs, side by side
    noise = NOISE * np.random.default_rng(0).standard_normal(len(time))
    before = {"q": q[0]}

    def command(k, y):
        measured = y[0, :, 0] + noise[k]
        speed = (measured - before["q"]) * RATE
        before["q"] = measured
        return (forward[:, k] + STIFF * (q[k] - measured) + DAMPED * (w[k] - speed))[:, None]

    start = np.zeros((3, 2, 1))
    states, _ = sampled_loop(true_system(rig), command, start, time, delay=DELAY)
    off = states[:, 0, :, 0] - q[:, None]
    for name, error in zip(("without", "with"), np.sqrt((off**2).mean(axis=0)), strict=True):
        print(f"tracking error {name} compensation: {1e3 * error:.1f} mrad")


def reference(time):
    """Position, velocity and acceleration of a swing that begins smoothly."""
    rate = 2 * np.pi * 0.5
    s, c = np.sin(rate * time), np.cos(rate * time)
    return 0.4 * (1 - c), 0.4 * rate * s, 0.4 * rate**2 * c


if __name__ == "__main__":
    main()
