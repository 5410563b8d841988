"""Regret of the default on simulated machines, see `regret.py`: what no default was tuned on.

    python comparisons/regret_simulated.py [--machines 20] [--seed 1] [--out TABLE.md]

Each machine is drawn from its seed: a pendulum or an acrobot whose nominal masses and motor's gain
are up to 4 % off and whose rotor is not known, filmed or logged at 60 to 200 Hz, its torque up to
15 ms late. Its friction is Coulomb and viscous, of either direction its own, with a Stribeck peak,
with the load, with the motor's torque, with a film lag, or LuGre's: no candidate knows the last
two. Laws are fitted to 12 recordings, and tested on 10 others with nearly twice the torque.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from regret import USUAL, Machine, row_of, table_of
from script import call

from frictionid.data.recordings import Dataset
from frictionid.mechanics import mechanism_of
from frictionid.simulate import (
    Camera,
    Curve,
    Drive,
    FilmLag,
    LoadFriction,
    LuGre,
    Multisine,
    Noise,
    Rig,
    Run,
    Steps,
    Stribeck,
    simulate,
)

FRICTIONS = ("plain", "by direction", "Stribeck", "load", "motor", "film lag", "LuGre")
TORQUE = (0.4, 0.8)  # of gravity's largest: in recordings to fit, and to test
GRAVITY = 9.81
Draw = Callable[[float, float], float]


def true_friction(kind: str, coulomb: tuple[float, ...], uniform: Draw) -> Any:
    """Friction of a kind, with Coulomb levels [N m] of about so much."""

    def each(low: float, high: float) -> tuple[float, ...]:
        return tuple(uniform(low, high) for _ in coulomb)

    def of_levels(low: float, high: float) -> tuple[float, ...]:
        return tuple(uniform(low, high) * level for level in coulomb)

    uneven = 0.15 * (kind == "by direction")
    peak = of_levels(0.2, 0.8) if kind == "Stribeck" else tuple(0.0 for _ in coulomb)
    curve = Curve(
        coulomb_positive=tuple((1.0 + uneven) * level for level in coulomb),
        coulomb_negative=tuple((1.0 - uneven) * level for level in coulomb),
        viscous=of_levels(0.01, 0.08),
        peak_positive=peak,
        peak_negative=peak,
        stribeck_velocity=each(0.3, 2.0),
    )
    if kind == "load":
        return LoadFriction(curve, bearing=each(0.003, 0.012))
    if kind == "motor":
        return LoadFriction(curve, motor=each(0.05, 0.25))
    if kind == "film lag":
        return FilmLag(curve, each(0.01, 0.05))
    if kind == "LuGre":
        stiffness = tuple(a / b for a, b in zip(coulomb, each(0.005, 0.03), strict=True))
        return LuGre(curve, stiffness, of_levels(0.0, 0.3), tuple(1.0 for _ in coulomb))
    return Stribeck(curve)


def drawn(seed: int) -> tuple[str, Machine]:
    """What a machine is, and its recordings."""
    rng = np.random.default_rng([seed, 99])

    def uniform(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    kind, friction = str(rng.choice(["pendulum", "acrobot"])), str(rng.choice(FRICTIONS))
    table: dict[str, Any] = {"kind": kind}
    if kind == "pendulum":
        mass, length = uniform(0.3, 1.5), uniform(0.2, 0.5)
        table["parameters"] = {"mass": mass, "length": length}
        rotor, most = uniform(0.0, 0.1) * mass * length**2, mass * GRAVITY * length
    else:
        rotor, most = uniform(0.5e-6, 2e-6), 0.23
    mechanism = mechanism_of(table).with_defaults()
    nominal = mechanism.nominal()
    masses = {p.name: nominal[p.name] for p in mechanism.parameters if p.unit == "kg"}
    coulomb = tuple(uniform(0.04, 0.15) * most * share for share in (1.0, 0.5))
    joints = 1 if kind == "pendulum" else 2
    rate = float(rng.choice([60, 100, 200]))
    common: Mapping[str, Any] = {
        "mechanism": table,
        "friction": true_friction(friction, coulomb[:joints], uniform),
        "camera": Camera(
            samples=int(3.0 / joints**0.5 * rate), rate=rate, angle_noise=uniform(3e-4, 2e-3)
        ),
        "true_parameters": {
            **{name: value * uniform(0.96, 1.04) for name, value in masses.items()},
            "rotor": rotor,
        },
        "drive": Drive(
            rate=rate,
            delay=uniform(0.0, 0.015),
            gain=uniform(0.96, 1.04),
            torque_noise=uniform(0.0, 0.03),
        ),
        "seed": seed,
        "substeps": 96 if friction == "LuGre" else 24,
    }

    def recorded(name: str, count: int, torque: float) -> Dataset:
        runs = []
        for k in range(count):
            start = uniform(0.5, 2.8) * float(rng.choice([-1, 1])), uniform(-0.5, 0.5)
            commands = (
                Multisine(torque, tuple(uniform(0.5, 2.0) for _ in range(3))),
                Steps(torque, uniform(0.25, 0.6)),
                Noise(torque, (0.5, 1.3)),
            )
            runs.append(Run(f"{name}_{k:02d}", start[:joints], torques=(commands[k % 3],)))
        return simulate(Rig(name, recordings=tuple(runs), **common))

    train, test = (
        recorded(name, count, share * most)
        for name, count, share in zip(("train", "test"), (12, 10), TORQUE, strict=True)
    )
    apart = 0.01 if rate > 100 else None
    what = f"{seed}: {kind}, {friction}"
    return what, Machine(train, {"test": test}, (*USUAL, "quadratic"), sample_time=apart)


def main(*, machines: int = 20, seed: int = 1, out: Path | None = None) -> None:
    """Print the table of some machines, and write it where --out says.

    Parameters
    ----------
    seed : Of the first machine.
    out : File of the table.
    """
    rows = []
    for each in range(seed, seed + machines):
        name, machine = drawn(each)
        print(name, flush=True)
        rows.append(row_of(name, machine))
        print(f"  regret {rows[-1].regret:.2f}", flush=True)
        if out is not None:
            out.write_text(table_of(rows) + "\n", encoding="utf-8")
    print(table_of(rows))


if __name__ == "__main__":
    call(main)
