"""Pendulums with smooth friction, integrated by SciPy: data sets in memory and as files."""

import copy
import csv
from dataclasses import replace
from functools import cache

import numpy as np
import tomli_w
from scipy.integrate import solve_ivp

from frictionid.names import LAWS
from frictionid.recordings import Dataset, Motion, Recording
from frictionid.results import describe, reduce
from frictionid.signals import Signal, cut
from frictionid.suite import load_suite, tasks_of
from frictionid.tasks import grounds_of, lock, run_tasks

COUNT, SECONDS, RATE = 12, 1.5, 60.0
NOISE = 1e-4  # [rad]
PENDULUM = {"kind": "pendulum", "parameters": {"mass": 0.2, "length": 0.2}}
INERTIA, GRAVITY = 0.2 * 0.2**2, 0.2 * 9.81 * 0.2  # [kg m^2], [N m]
WIDTH = 0.02  # [rad/s], of the smooth sign: that of the laws
TRUTH = {
    "kind": "stribeck",
    "coulomb_positive": [0.03],
    "coulomb_negative": [0.03],
    "peak_positive": [0.01],
    "peak_negative": [0.01],
    "stribeck_velocity": [2.0],
    "viscous": [0.004],
}
COLUMNS = ("time", "angle", "torque", "true_angle", "true_velocity")


def true_torque(w):
    """True friction torque [N m] at velocities w [rad/s]."""
    dip = np.exp(-((w / TRUTH["stribeck_velocity"][0]) ** 2))
    level = TRUTH["coulomb_positive"][0] + TRUTH["peak_positive"][0] * dip
    return level * np.tanh(w / WIDTH) + TRUTH["viscous"][0] * w


@cache
def _motion():
    """Times (T,), torques (T, COUNT), angles and velocities (T, COUNT) of all pendulums."""
    rng = np.random.default_rng(7)
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    rates, phases = rng.uniform(2.0, 12.0, (3, COUNT)), rng.uniform(0.0, 6.0, (3, COUNT))
    torque = 0.2 * np.sin(time[:, None, None] * rates + phases).sum(1)
    state = np.concatenate([rng.uniform(-1.0, 1.0, COUNT), rng.uniform(-3.0, 3.0, COUNT)])
    states = [state]
    for k, dt in enumerate(np.diff(time)):

        def slope(_, x, u=torque[k]):
            q, w = np.split(x, 2)
            return np.concatenate([w, (u - GRAVITY * np.sin(q) - true_torque(w)) / INERTIA])

        state = solve_ivp(slope, (0.0, dt), state, rtol=1e-8, atol=1e-9).y[:, -1]
        states.append(state)
    q, w = np.split(np.array(states), 2, axis=1)
    return time, torque, q, w


@cache
def recordings(noise=NOISE):
    """The pendulums' recordings; each has its own noise, and its torque held between samples."""
    time, torque, q, w = _motion()
    rng = np.random.default_rng(8)
    measured = q + noise * rng.standard_normal(q.shape)
    out = []
    for i in range(COUNT):
        one = slice(i, i + 1)
        truth = Motion(Signal(time, q[:, one]), Signal(time, w[:, one]))
        drive = Signal(time, torque[:, one], hold="previous")
        out.append(Recording(f"{i:02d}", Signal(time, measured[:, one]), drive, truth=truth))
    return tuple(out)


def dataset(noise=NOISE, **changes):
    """The data set in memory."""
    return replace(Dataset("tiny", PENDULUM, recordings(noise), truth=TRUTH), **changes)


def shortened(recording, seconds):
    """The first seconds of a recording."""
    truth = recording.truth
    return replace(
        recording,
        angle=cut(recording.angle, 0.0, seconds),
        truth=truth and Motion(cut(truth.angle, 0.0, seconds), cut(truth.velocity, 0.0, seconds)),
    )


def disturbed(recording, after, by=0.5):
    """The recording with other measured angles and torques from a time on."""
    angle, torque = recording.angle, recording.torque
    late = (angle.time >= after)[:, None]
    return replace(
        recording,
        angle=angle._replace(
            value=angle.value + by * late * (1 + np.sin(40 * angle.time))[:, None]
        ),
        torque=torque._replace(value=torque.value - by * (torque.time >= after)[:, None]),
    )


def write_dataset(folder, name="tiny", noise=NOISE, changes=()):
    """The data set as files; changes are pairs of a dotted key of dataset.toml and its value."""
    folder.mkdir(parents=True, exist_ok=True)
    for recording in recordings(noise):
        columns = [recording.angle.time, recording.angle.value[:, 0], recording.torque.value[:, 0]]
        columns += [recording.truth.angle.value[:, 0], recording.truth.velocity.value[:, 0]]
        with (folder / f"{recording.name}.csv").open("w", newline="") as file:
            csv.writer(file).writerows([COLUMNS, *zip(*columns, strict=True)])
    document = {
        "name": name,
        "mechanism": copy.deepcopy(PENDULUM),
        "columns": {
            "time": "time",
            "angle": ["angle"],
            "torque": ["torque"],
            "truth": {"angle": ["true_angle"], "velocity": ["true_velocity"]},
        },
        "recordings": {"patterns": ["*.csv"]},
        "truth": dict(TRUTH),
    }
    write_toml(folder / "dataset.toml", changed(document, changes))
    return folder


SUITE = {
    "name": "small",
    "horizons": [0.1, 0.3],
    "folds": {"count": 3},
    "datasets": [{"path": "tiny"}],
    "recipes": [{"name": "study"}, {"name": "integral"}],
    "identifiers": [{"kind": "none"}, {"kind": "coulomb_viscous"}],
}


def suite(changes=()):
    """The suite's tables with changes."""
    return changed(copy.deepcopy(SUITE), changes)


def changed(document, changes):
    """The document with each dotted key of the changes set, or deleted where the value is None."""
    for path, value in changes:
        table = document
        *parents, key = (int(part) if part.isdigit() else part for part in path.split("."))
        for parent in parents:
            table = table[parent] if isinstance(parent, int) else table.setdefault(parent, {})
        if value is None:
            del table[key]
        else:
            table[key] = value
    return document


def write_toml(path, document):
    path.write_text(tomli_w.dumps(document))
    return path


def write_suite(folder, changes=(), name="suite.toml"):
    """A suite and the data set that it names."""
    if not (folder / "tiny").exists():
        write_dataset(folder / "tiny")
    return write_toml(folder / name, suite(changes))


def compare_into(file, folder, resume=False, jobs=1):
    """What `frictionid compare` does, without tables and pictures for people."""
    table = load_suite(file)
    tasks = tasks_of(table, file)
    grounds = grounds_of(tasks)
    with lock(folder):
        describe(folder, table.name, table.title, table.model_dump(mode="json"), tasks, grounds)
        run_tasks(tasks, grounds, folder / "tasks", LAWS, jobs=jobs, resume=resume)
        reduce(folder)


def select(rows, **wanted):
    """Values of the rows with the wanted entries, by fold and joint."""
    found = [r for r in rows if all(getattr(r, k) == v for k, v in wanted.items())]
    return {(r.fold, r.joint): r.value for r in found}
