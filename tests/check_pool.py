"""Healthy simulated recordings, and the faults that the tests of `check` plant in copies of them.

Eight rigs are simulated once, 11 recordings of 5 s each; a case draws 4 of them, noise of its
own and, where asked, a fault.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.mechanics import mechanism_of, plant_of
from frictionid.recordings import Dataset
from frictionid.signals import Signal
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

SAMPLES, DECAYS, DRIVEN = 301, 2, 9


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
        substeps=4,
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


def case(dataset, rng, driven=3, noise=(3e-4, 2e-3)):
    """A free decay and some driven recordings of a data set, with measurement noise."""
    decay = rng.choice(DECAYS, 1)
    chosen = rng.choice(np.arange(DECAYS, DECAYS + DRIVEN), driven, False)
    sigma = rng.uniform(*noise)
    recordings = []
    for i in sorted([*decay, *chosen]):
        r = dataset.recordings[i]
        value = r.angle.value + sigma * rng.standard_normal(r.angle.value.shape)
        recordings.append(replace(r, angle=r.angle._replace(value=value), truth=None))
    return Dataset(dataset.name, dataset.mechanism, tuple(recordings))


def with_angles(dataset, change):
    """Copy in which change(number of the recording, angles) replaces the angles."""
    out = []
    for i, r in enumerate(dataset.recordings):
        out.append(replace(r, angle=r.angle._replace(value=change(i, r.angle.value))))
    return replace(dataset, recordings=tuple(out))


def with_torques(dataset, change, later=0.0):
    """Copy in which change(torques) replaces the torques, with a clock that is `later` [s]."""
    out = []
    for r in dataset.recordings:
        torque = r.torque._replace(time=r.torque.time + later, value=change(r.torque.value))
        out.append(replace(r, torque=torque))
    return replace(dataset, recordings=tuple(out))


def driven_of(dataset):
    return np.flatnonzero(mechanism_of(dataset.mechanism).description.driven)


def joints_of(dataset):
    return dataset.recordings[0].angle.value.shape[1]


def flipped_torque(dataset, rng):
    j = int(rng.choice(driven_of(dataset)))
    sign = np.where(np.arange(joints_of(dataset)) == j, -1.0, 1.0)
    return with_torques(dataset, lambda u: u * sign), f"torque {j + 1} has the wrong sign"


def flipped_angle(dataset, rng):
    j = int(rng.integers(joints_of(dataset)))
    sign = np.where(np.arange(joints_of(dataset)) == j, -1.0, 1.0)
    return with_angles(dataset, lambda _, q: q * sign), f"angle {j + 1} has the wrong sign"


def degrees(dataset, rng):  # noqa: ARG001
    return with_angles(dataset, lambda _, q: np.degrees(q)), "angles are in degrees"


def absolute(dataset, rng):  # noqa: ARG001
    return with_angles(dataset, lambda _, q: np.cumsum(q, axis=1)), "angles are absolute"


def swapped(dataset, rng):
    both = with_angles(dataset, lambda _, q: q[:, ::-1])
    if rng.random() < 0.5:
        return both, "the angles of the joints are swapped"
    return with_torques(both, lambda u: u[:, ::-1]), "the joints are swapped, angles and torques"


def late(dataset, rng, seconds):
    """The torque's clock is early or late; only a late log can be half a second off."""
    sign = -1.0 if seconds > 0.1 else rng.choice([-1.0, 1.0])
    word = "after" if sign < 0 else "before"
    return with_torques(dataset, lambda u: u, sign * seconds), f"ms {word} it is logged"


def one_frame(dataset, rng):
    return late(dataset, rng, 1 / 60)


def half_a_second(dataset, rng):
    return late(dataset, rng, 0.5)


def gain(dataset, rng):
    factor = 1.18 ** rng.choice([-1, 1])
    return with_torques(dataset, lambda u: u * factor), "wrong gear or torque constant"


def commanded(dataset, rng):  # noqa: ARG001
    plant = plant_of(dataset)
    out = []
    for i, r in enumerate(dataset.recordings):
        terms = plant[i].terms(r.angle.value, np.zeros_like(r.angle.value))
        value = np.zeros_like(r.angle.value)
        value[:, driven_of(dataset)] = -terms.dLdq[:, driven_of(dataset)]
        out.append(replace(r, torque=Signal(r.angle.time, value, "previous")))
    return replace(dataset, recordings=tuple(out)), "the torque equals a gravity model"


def wrapped(dataset, rng):  # noqa: ARG001
    def wrap(_, q):
        return (q + np.pi) % (2 * np.pi) - np.pi

    return with_angles(dataset, wrap), "wrapped at half a turn"


def wraps(dataset):
    return any(np.abs(r.angle.value).max() > np.pi + 0.2 for r in dataset.recordings)


def frozen(dataset, rng):
    i, j = int(rng.integers(len(dataset.recordings))), int(rng.integers(joints_of(dataset)))
    length = int(rng.integers(15, 60))
    value = dataset.recordings[i].angle.value[:, j]
    speed = np.abs(np.gradient(value)) * 60
    moving = np.flatnonzero(speed[5 : SAMPLES - 70] > max(1.0, np.quantile(speed, 0.5))) + 5
    start = int(rng.choice(moving)) if len(moving) else 30

    def freeze(k, q):
        q = q.copy()
        if k == i:
            q[start : start + length, j] = q[start, j]
        return q

    return with_angles(dataset, freeze), f"angle {j + 1} stands still"


def frozen_torque(dataset, rng):
    """One motor's torque stands still, all through a recording or for 0.4 to 1 s of a motion.

    At a value and time at which it shows: the true torque differs from it and the joint moves.
    """
    while True:
        i, j = int(rng.integers(len(dataset.recordings))), int(rng.choice(driven_of(dataset)))
        torque, angle = dataset.recordings[i].torque, dataset.recordings[i].angle
        u, level = torque.value[:, j], np.sqrt((torque.value[:, j] ** 2).mean())
        first, last = 0, len(u)
        value = rng.choice(u)
        if rng.random() < 0.5:
            first = int(rng.integers(5, len(u) - 70))
            last = first + int(rng.integers(24, 60))
            value = u[first]
        speed = np.abs(np.gradient(angle.value[:, j], angle.time))[first : min(last, SAMPLES)]
        error = np.sqrt(((u[first:last] - value) ** 2).mean())
        if value != 0.0 and error > 0.7 * level and (speed > 0.5).mean() > 0.7:
            break
    out = list(dataset.recordings)
    changed = torque.value.copy()
    changed[first:last, j] = value
    out[i] = replace(out[i], torque=torque._replace(value=changed))
    return replace(dataset, recordings=tuple(out)), f"torque {j + 1} stands still"


# fault -> (how it is planted, whether it needs two joints)
FAULTS = {
    "flipped_torque": (flipped_torque, False),
    "flipped_angle": (flipped_angle, False),
    "degrees": (degrees, False),
    "absolute_angle": (absolute, True),
    "swapped_joints": (swapped, True),
    "one_frame_late": (one_frame, False),
    "half_a_second_late": (half_a_second, False),
    "wrong_gear": (gain, False),
    "commanded_torque": (commanded, False),
    "wrapped_angle": (wrapped, False),
    "frozen_sensor": (frozen, False),
    "frozen_torque": (frozen_torque, False),
}
