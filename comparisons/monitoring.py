"""Rates of the monitor on simulated recordings: false alarms, changes found, sensors that are off.

The rig is an acrobot with set-valued friction that scatters between recordings; see monitoring.toml
for the numbers. Run from the clone: python comparisons/monitoring.py [--recordings N] [--jobs N]
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from rich.progress import track
from scipy.stats import beta

from frictionid import fit
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Signal
from frictionid.monitor.baseline import Baseline, make_baseline
from frictionid.monitor.changes import Changes, prepared_data, recording_changes
from frictionid.monitor.judgement import judge
from frictionid.simulate import Camera, Curve, Rig, Run, Sine, Stribeck, Variation, simulate

CURVE = Curve(
    (0.165, 0.055), (0.165, 0.05), (0.004, 0.0008), (0.0, 0.028), (0.0, 0.036), (1.0, 2.0)
)
RATE, NOISE = 60.0, 0.0016231562


def rig_of(settings: dict[str, Any], seed: int, count: int, wear: tuple[float, ...] = ()) -> Rig:
    """Rig with recordings of as many random sines, worn from the first one on."""
    rng = np.random.default_rng(seed)
    runs = tuple(
        Run(
            f"run{seed}-{i}",
            tuple(rng.uniform(-2.0, 2.0, 2).round(3).tolist()),
            torques=(Sine(round(rng.uniform(0.13, 0.16), 3), round(rng.uniform(0.9, 1.2), 3)),),
        )
        for i in range(count)
    )
    camera = Camera(int(settings["seconds"] * RATE) + 1, RATE, NOISE)
    scatter = settings["friction"]["scatter"]
    variation = Variation(scatter=scatter, wear=wear, sudden=bool(wear))
    return Rig(
        *("acrobot", {"kind": "acrobot"}, Stribeck(CURVE), camera, runs),
        variation=variation,
        seed=seed,
        substeps=8,  # 3e-8 rad from 64 after 5 s
    )


def with_sensors(data: Dataset, change: Callable[[Any], Any]) -> Dataset:
    """The data set with each recording as other sensors would have logged it."""
    return replace(data, recordings=tuple(map(change, data.recordings)))


def sensors_of(settings: dict[str, Any]) -> dict[str, Callable[[Any], Any]]:
    """What the sensors may have done, by its name."""
    off = settings["sensors"]
    tilt = np.array([np.deg2rad(off["tilt"]), 0.0])

    def torque(r: Any, early: float, share: float) -> Any:
        signal: Signal = r.torque
        moved = signal._replace(time=signal.time - early, value=signal.value * share)
        return replace(r, torque=moved)

    return {
        "late": lambda r: torque(r, off["late"], 1.0),
        "gain": lambda r: torque(r, 0.0, 1.0 / (1.0 + off["gain"])),
        "tilt": lambda r: replace(r, angle=r.angle._replace(value=r.angle.value + tilt)),
    }


def batch(settings: dict[str, Any], known: Baseline, seed: int) -> dict[str, Changes]:
    """Changes of a batch of healthy recordings, by what their sensors do."""
    data = simulate(rig_of(settings, seed, settings["batch"]))
    variants = {"healthy": data}
    variants |= {name: with_sensors(data, f) for name, f in sensors_of(settings).items()}
    return {name: changes(known, own) for name, own in variants.items()}


def changes(known: Baseline, data: Dataset) -> Changes:
    """Changes of recordings against the reference of a baseline."""
    return recording_changes(prepared_data(data), known.reference, ())


def worn(settings: dict[str, Any], known: Baseline, seed: int, joint: int) -> Changes:
    """Changes of groups of recordings with a joint's levels raised."""
    own = settings["friction"]
    wear = tuple(own["change"] if j == joint else 0.0 for j in range(2))
    count = own["groups"] * own["group"]
    return changes(known, simulate(rig_of(settings, seed, count, wear)))


def taken(own: Changes, index: Any) -> Changes:
    """Changes of some recordings."""
    return Changes(*(values[index] for values in own))


def joined(parts: list[Changes]) -> Changes:
    """Changes of several batches."""
    return Changes(*map(np.concatenate, zip(*parts, strict=True)))


def counted(alarms: int, cases: int) -> str:
    """A share with its exact 95 % interval (Clopper-Pearson)."""
    low = beta.ppf(0.025, alarms, cases - alarms + 1) if alarms else 0.0
    high = beta.ppf(0.975, alarms + 1, cases - alarms) if alarms < cases else 1.0
    return f"{alarms} of {cases}, {alarms / cases:.2%} [{low:.2%}, {high:.2%}]"


def alarms_of(
    settings: dict[str, Any], known: Baseline, pool: Changes, new: Changes, k: int, test: Any
) -> tuple[int, int]:
    """Alarms among groups of k new recordings against random healthy ones, and number of groups."""
    size = settings["baselines"]["single" if k == 1 else "group"]
    rng = np.random.default_rng(settings["seed"])
    count, alarms = len(new.parts), 0
    groups = rng.permutation(count)[: count // k * k].reshape(-1, k)
    for own in groups:
        free = np.setdiff1d(np.arange(len(pool.parts)), own)  # new may be the pool itself
        base = replaced(known, taken(pool, rng.choice(free, size, replace=False)))
        alarms += judge(base, taken(new, own), settings["rate"], test).answer == "changed"
    return alarms, len(groups)


def replaced(known: Baseline, healthy: Changes) -> Baseline:
    """The baseline with other healthy recordings."""
    names = tuple(map(str, range(len(healthy.parts))))
    return replace(known, changes=healthy, names=names, hashes=names)


def found_of(
    settings: dict[str, Any], known: Baseline, pool: Changes, new: Changes, joint: int
) -> tuple[int, int, int]:
    """Groups whose change was found, those in which the right joint was, and number of groups."""
    k, rng = settings["friction"]["group"], np.random.default_rng(settings["seed"])
    found = right = 0
    groups = np.arange(len(new.parts)).reshape(-1, k)
    for own in groups:
        size = settings["baselines"]["group"]
        base = replaced(known, taken(pool, rng.choice(len(pool.parts), size, replace=False)))
        said = judge(base, taken(new, own), settings["rate"])
        found += said.answer == "changed"
        right += said.answer == "changed" and int(said.p_of_joint.argmin()) == joint
    return found, right, len(groups)


def main() -> None:
    """Print all rates."""
    settings = tomllib.loads((Path(__file__).parent / "monitoring.toml").read_text("utf-8"))
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=settings["recordings"])
    parser.add_argument("--groups", type=int, default=settings["friction"]["groups"])
    parser.add_argument("--jobs", type=int, default=-1)
    given = parser.parse_args()
    settings["friction"]["groups"] = given.groups
    settings["batch"] = min(settings["batch"], given.recordings)
    data = simulate(rig_of(settings, 10**6, 20))
    known = make_baseline(prepared_data(data), fit(data, "stribeck").friction)
    first, count = settings["seed"], given.recordings // settings["batch"]
    run = Parallel(given.jobs, return_as="generator")
    jobs = (delayed(batch)(settings, known, first + i) for i in range(count))
    parts = list(track(run(jobs), "healthy recordings", total=count))
    pool = {name: joined([part[name] for part in parts]) for name in parts[0]}
    healthy = pool["healthy"]
    print(f"scatter of the total change: {np.std(healthy.parts[:, :, :2].sum(-1), axis=0)} N m")
    for test in ("permutation", "normal"):
        for k in (1, settings["friction"]["group"]):
            share = counted(*alarms_of(settings, known, healthy, healthy, k, test))
            print(f"healthy, {k} new, {test}: {share}")
    for name in list(pool)[1:]:
        for k in (1, settings["friction"]["group"]):
            share = counted(*alarms_of(settings, known, healthy, pool[name], k, "permutation"))
            print(f"{name}, {k} new: {share}")
    changed = run(delayed(worn)(settings, known, 2 * 10**6 + j, j) for j in range(2))
    for joint, own in enumerate(track(changed, "worn recordings", total=2)):
        found, right, groups = found_of(settings, known, healthy, own, joint)
        print(f"joint {joint + 1} changed: found {counted(found, groups)}, right joint {right}")


if __name__ == "__main__":
    main()
