"""Rates of the monitor on simulated recordings: false alarms, changes found, sensors that are off.

The rig is an acrobot with set-valued friction that scatters between recordings; see monitoring.toml
for the numbers. Its motion is integrated by the simulator's own steps, judged by the monitor's
smoothing: no code is shared. Run from the clone:
python comparisons/monitoring.py [--recordings N] [--groups N] [--jobs N]
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from rich.progress import track
from scipy.stats import beta

from frictionid import baseline
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Signal
from frictionid.deploy.monitor.baseline import Baseline
from frictionid.deploy.monitor.changes import (
    Changes,
    curve_changes,
    prepared_data,
    recording_changes,
)
from frictionid.deploy.monitor.judgement import judge
from frictionid.deploy.monitor.monitor import log_evidence
from frictionid.simulate import Camera, Curve, Multisine, Rig, Run, Stribeck, Variation, simulate

CURVE = Curve(
    (0.165, 0.055), (0.165, 0.05), (0.004, 0.0008), (0.0, 0.028), (0.0, 0.036), (1.0, 2.0)
)
RATE, NOISE = 60.0, 0.0016231562
AT_ONCE = 100  # recordings whose changes are computed together, to spare memory


class Pools(NamedTuple):
    """Changes of all recordings against one reference.

    healthy : by what their sensors do, the same motions in the same order; "half" has half of each
    worn : of each joint, groups of recordings with its levels raised
    louder : healthy recordings by the share of the baseline's torque
    """

    known: Baseline
    healthy: dict[str, Changes]
    worn: list[Changes]
    louder: dict[float, Changes]


def rig_of(
    settings: dict[str, Any],
    seed: int,
    count: int,
    wear: tuple[float, ...] = (),
    share: float = 1.0,
) -> Rig:
    """Rig with as many recordings of random motion, worn from the first one on."""
    rng = np.random.default_rng(seed)
    motion = settings["motion"]

    def torque() -> Multisine:
        amplitude = round(share * rng.uniform(*motion["amplitude"]), 3)
        return Multisine(amplitude, tuple(round(rng.uniform(*b), 3) for b in motion["bands"]))

    def start() -> tuple[float, ...]:
        return tuple(rng.uniform(-2.0, 2.0, 2).round(3).tolist())

    runs = tuple(Run(f"run{seed}-{i}", start(), torques=(torque(),)) for i in range(count))
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


def first_half(recording: Any) -> Any:
    """The first half of a recording."""
    angle = recording.angle
    count = len(angle.time) // 2
    return replace(
        recording, angle=angle._replace(time=angle.time[:count], value=angle.value[:count])
    )


def batch(settings: dict[str, Any], known: Baseline, seed: int) -> dict[str, Changes]:
    """Changes of a batch of healthy recordings, by what their sensors do."""
    data = simulate(rig_of(settings, seed, settings["batch"]))
    variants = {"healthy": data}
    variants |= {name: with_sensors(data, f) for name, f in sensors_of(settings).items()}
    variants["half"] = with_sensors(data, first_half)
    return {name: changes(known, own) for name, own in variants.items()}


def changes(known: Baseline, data: Dataset) -> Changes:
    """Changes of recordings against the reference of a baseline."""
    firsts = range(0, len(data.recordings), AT_ONCE)
    parts = [replace(data, recordings=data.recordings[i : i + AT_ONCE]) for i in firsts]
    return joined([recording_changes(prepared_data(p), known.reference, ()) for p in parts])


def worn(settings: dict[str, Any], known: Baseline, seed: int, joint: int) -> Changes:
    """Changes of groups of recordings with a joint's levels raised."""
    own = settings["friction"]
    wear = tuple(own["change"] if j == joint else 0.0 for j in range(2))
    count = own["groups"] * own["group"]
    return changes(known, simulate(rig_of(settings, seed, count, wear)))


def louder(settings: dict[str, Any], known: Baseline, seed: int, share: float) -> Changes:
    """Changes of healthy recordings under another share of the baseline's torque."""
    return changes(known, simulate(rig_of(settings, seed, settings["other"]["count"], (), share)))


def pools_of(settings: dict[str, Any], jobs: int) -> Pools:
    """All recordings, simulated and compared with one reference."""
    data = simulate(rig_of(settings, 10**6, 20))
    known = baseline(data)  # as `frictionid baseline` makes it
    first, count = settings["seed"], settings["recordings"] // settings["batch"]
    shares = settings["other"]["torque"]
    tasks = [
        *(delayed(batch)(settings, known, first + i) for i in range(count)),
        *(delayed(worn)(settings, known, 2 * 10**6 + j, j) for j in range(2)),
        *(delayed(louder)(settings, known, 3 * 10**6 + i, s) for i, s in enumerate(shares)),
    ]
    run = Parallel(jobs, return_as="generator")
    done = list(track(run(tasks), "recordings", total=len(tasks)))
    healthy = {name: joined([part[name] for part in done[:count]]) for name in done[0]}
    return Pools(
        known, healthy, done[count : count + 2], dict(zip(shares, done[count + 2 :], strict=True))
    )


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
    settings: dict[str, Any], pools: Pools, new: Changes, k: int, test: Any = "permutation"
) -> tuple[int, int]:
    """Alarms among groups of k new recordings against random healthy ones, and number of groups."""
    size = settings["baselines"]["single" if k == 1 else "group"]
    rng = np.random.default_rng(settings["seed"])
    pool = pools.healthy["healthy"]
    count, alarms = len(new.parts), 0
    groups = rng.permutation(count)[: count // k * k].reshape(-1, k)
    for own in groups:
        free = np.setdiff1d(np.arange(len(pool.parts)), own)  # new may be of the pool itself
        base = replaced(pools.known, taken(pool, rng.choice(free, size, replace=False)))
        said = judge(base, taken(new, own), settings["rate"], test)
        alarms += said.p <= settings["rate"] * (1 + 1e-9)
    return alarms, len(groups)


def replaced(known: Baseline, healthy: Changes) -> Baseline:
    """The baseline with other healthy recordings."""
    names = tuple(map(str, range(len(healthy.parts))))
    return replace(known, changes=healthy, names=names, hashes=names)


def found_of(settings: dict[str, Any], pools: Pools, joint: int) -> tuple[int, int, int]:
    """Groups whose change was found, those in which the right joint was, and number of groups."""
    k, rng = settings["friction"]["group"], np.random.default_rng(settings["seed"])
    pool, new = pools.healthy["healthy"], pools.worn[joint]
    found = right = 0
    groups = np.arange(len(new.parts)).reshape(-1, k)
    for own in groups:
        size = settings["baselines"]["group"]
        base = replaced(pools.known, taken(pool, rng.choice(len(pool.parts), size, replace=False)))
        said = judge(base, taken(new, own), settings["rate"])
        found += said.answer == "changed"
        right += said.answer == "changed" and int(said.p_of_joint.argmin()) == joint
    return found, right, len(groups)


def first_alarms(
    settings: dict[str, Any], pools: Pools, healthy: int, arriving: Changes | None = None
) -> np.ndarray:
    """Number of arrivals at the first alarm of each sequence (S,), inf where there is none.

    Each sequence has its own choice of a baseline and arrivals: of the healthy ones, or of others.
    """
    own, rng = settings["sequences"], np.random.default_rng(settings["seed"])
    speeds = pools.known.reference.speeds
    rows = curve_changes(pools.healthy["healthy"].parts, speeds)
    new = rows if arriving is None else curve_changes(arriving.parts, speeds)
    first = np.full(own["count"], np.inf)
    for i in range(own["count"]):
        chosen = rng.choice(len(rows), healthy + own["arrivals"], replace=False)
        which = (
            chosen[healthy:] if arriving is None else rng.choice(len(new), own["arrivals"], False)
        )
        names = tuple(f"{i} {k}" for k in range(own["arrivals"]))
        log = log_evidence(rows[chosen[:healthy]], new[which], names)
        over = np.flatnonzero(log >= np.log(1.0 / settings["rate"]))
        first[i] = over[0] + 1 if len(over) else np.inf
    return first


def print_rates(settings: dict[str, Any], pools: Pools) -> None:
    """Print how often the monitor is right."""
    healthy, group = pools.healthy["healthy"], settings["friction"]["group"]
    total = healthy.parts[:, :, :2].sum(-1)
    print(f"scatter of the total change: {total.std(axis=0) / pools.known.level} of the level")
    print(f"scatter of the gain: {healthy.gain.std(axis=0)}, delay: {healthy.delay.std():.2g} s")
    for k in (1, group):
        share = counted(*alarms_of(settings, pools, healthy, k, "normal"))
        print(f"healthy, {k} new, normal: {share}")
    news = pools.healthy | {f"torque x {share:g}": own for share, own in pools.louder.items()}
    for name, new in news.items():
        for k in (1, group):
            print(f"{name}, {k} new: {counted(*alarms_of(settings, pools, new, k))}")
    for joint in range(2):
        found, right, groups = found_of(settings, pools, joint)
        print(f"joint {joint + 1} changed: found {counted(found, groups)}, right joint {right}")


def print_sequences(settings: dict[str, Any], pools: Pools) -> None:
    """Print how often and how soon the evidence over arriving recordings gives an alarm."""
    arrivals = settings["sequences"]["arrivals"]
    kinds = {"healthy": None, "joint 1 changed": pools.worn[0], "joint 2 changed": pools.worn[1]}
    for size in settings["sequences"]["healthy"]:
        for name, new in kinds.items():
            first = first_alarms(settings, pools, size, new)
            share = counted(int(np.isfinite(first).sum()), len(first))
            print(
                f"{name}, {size} in the baseline, alarm within {arrivals} arrivals: {share}", end=""
            )
            print(f", half of them by arrival {np.median(first):g}")


def main() -> None:
    """Print all rates."""
    settings = tomllib.loads((Path(__file__).parent / "monitoring.toml").read_text("utf-8"))
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=settings["recordings"])
    parser.add_argument("--groups", type=int, default=settings["friction"]["groups"])
    parser.add_argument("--jobs", type=int, default=-1)
    given = parser.parse_args()
    settings["recordings"], settings["friction"]["groups"] = given.recordings, given.groups
    settings["batch"] = min(settings["batch"], given.recordings)
    pools = pools_of(settings, given.jobs)
    print_rates(settings, pools)
    print_sequences(settings, pools)


if __name__ == "__main__":
    main()
