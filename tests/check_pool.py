"""Healthy simulated recordings, and the faults that the tests of `check` plant in copies of them.

Eight rigs are simulated once, 16 recordings of 6 s each; a case draws 4 to 6 of them, noise of its
own and, where asked, a fault.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.recordings import Dataset
from frictionid.simulate import (
    Camera,
    Chirp,
    Curve,
    Drive,
    Multisine,
    Rig,
    Run,
    Sine,
    Steps,
    Stribeck,
    simulate,
)

SAMPLES, DECAYS, DRIVEN = 361, 3, 13


def pool(seed=0):
    """Noise-free data sets of rigs that differ in mechanism, parameters and friction."""
    rng = np.random.default_rng(seed)
    kinds = ["acrobot", "double", "pendulum", "half", "acrobot", "double", "pendulum", "double"]
    return [simulate(rig(kind, i, rng)) for i, kind in enumerate(kinds)]


def lazy_pool(seed=1):
    """The same with one joint that hardly ever moves; (data set, number of that joint)."""
    rng = np.random.default_rng(seed)
    return [
        (simulate(rig("double", i, rng, locked=joint)), joint) for i, joint in enumerate((0, 1))
    ]


def rig(kind, number, rng, locked=None):
    mechanism, level, motors = _machine(kind, rng)
    friction = np.array(level) * rng.uniform(0.03, 0.1, len(level))
    if locked is not None:
        friction[locked] = 4.0 * sum(level)
    ratio = rng.uniform(0.85, 1.15, len(level))
    curve = Curve(
        tuple(friction),
        tuple(friction * ratio),
        viscous=tuple(friction * rng.uniform(0.0, 0.1, len(level))),
        peak_positive=tuple(friction * rng.uniform(0.0, 0.5, len(level))),
        peak_negative=tuple(friction * rng.uniform(0.0, 0.5, len(level))),
        stribeck_velocity=tuple(rng.uniform(0.5, 2.0, len(level))),
    )
    runs = [_run(i, level, motors, rng, locked) for i in range(DECAYS + DRIVEN)]
    return Rig(
        f"{kind}_{number}",
        mechanism,
        Stribeck(curve),
        Camera(SAMPLES, 60.0),
        tuple(runs),
        drive=Drive(60.0),
        seed=number,
        substeps=8,
    )


def _machine(kind, rng):
    """[mechanism] table, gravity moment of each joint [N m], and the driven joints."""
    s = rng.uniform(0.7, 1.4, 4)
    if kind == "acrobot":
        return (
            {"kind": kind, "parameters": {"m3": 0.12 * s[0], "m4": 0.084 * s[1]}},
            (1.1, 0.25),
            (1,),
        )
    if kind == "pendulum":
        table = {"mass": 0.5 * s[0], "length": 0.4 * s[1]}
        return {"kind": kind, "parameters": table}, (2.0 * s[0] * s[1],), (0,)
    table = {
        "m1": 0.5 * s[0],
        "m2": 0.5 * s[1],
        "l1": 0.2 * s[2],
        "r2": 0.1 * s[3],
        "I1": 0.01 * s[0],
        "I2": 0.01 * s[1] * s[3] ** 2,
    }
    driven = (True, True) if kind == "double" else (True, False)
    motors = tuple(np.flatnonzero(driven))
    return (
        {"kind": "double_pendulum", "driven": list(driven), "parameters": table},
        (1.5, 0.5 * s[1] * s[3]),
        motors,
    )


def _run(i, level, motors, rng, locked):
    start = [float(a) for a in rng.uniform(0.8, 2.4) * rng.choice([-1, 1], 1)]
    start += [float(a) for a in rng.uniform(-1.2, 1.2, len(level) - 1)]
    if locked is not None:
        start[locked] = 0.0
    if i < DECAYS:
        return Run(f"{i:02d}_decay", tuple(start))
    torques = []
    for j in motors:
        a = float(level[j] * rng.uniform(0.35, 0.7))
        f = [float(x) for x in rng.uniform(0.4, 1.6, 3)]
        shape = (
            Sine(a, f[0], f[1]),
            Chirp(a, 0.4, f[0] + 0.5),
            Multisine(a, tuple(f)),
            Steps(a, float(rng.uniform(0.2, 0.5))),
        )
        torques.append(shape[int(rng.integers(4))])
    return Run(f"{i:02d}_driven", tuple(start), (), tuple(torques))


def case(dataset, rng, driven=(3, 6), noise=(3e-4, 2e-3)):
    """A free decay and some driven recordings of a data set, with measurement noise."""
    decay = rng.choice(DECAYS, 1)
    chosen = rng.choice(np.arange(DECAYS, DECAYS + DRIVEN), int(rng.integers(*driven)), False)
    sigma = rng.uniform(*noise)
    recordings = []
    for i in sorted([*decay, *chosen]):
        r = dataset.recordings[i]
        value = r.angle.value + sigma * rng.standard_normal(r.angle.value.shape)
        recordings.append(replace(r, angle=r.angle._replace(value=value), truth=None))
    return Dataset(dataset.name, dataset.mechanism, tuple(recordings))
