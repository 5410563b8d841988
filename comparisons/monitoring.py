"""Rates of the monitor on simulated recordings: false alarms, changes found, what is not friction.

The rig is an acrobot with set-valued friction that scatters between recordings; see monitoring.toml
for the numbers. Its motion is integrated by the simulator's own steps, judged by the monitor's
smoothing: no code is shared. Half of the healthy sets, and all changed ones, move otherwise than
the baseline. Then the real C.1 arm, each controller's recordings against those of the others.
Run from the clone: python comparisons/monitoring.py [--sets N] [--only simulated|real]
[--healthy 8 --new 3] [--off 0.05]
"""

from __future__ import annotations

import re
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.stats import binomtest
from script import call

from frictionid import baseline, load_dataset, mechanisms, monitor
from frictionid.arrays import joined
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import taken
from frictionid.deploy.monitor.baseline import Baseline
from frictionid.deploy.monitor.changes import Changes, prepared_data, recording_changes
from frictionid.deploy.monitor.judgement import Judgement, judge
from frictionid.mechanics import Mechanism
from frictionid.simulate import Camera, Curve, Multisine, Rig, Run, Stribeck, Variation, simulate

CURVE = Curve(
    (0.165, 0.055), (0.165, 0.05), (0.004, 0.0008), (0.0, 0.028), (0.0, 0.036), (1.0, 2.0)
)
RATE, NOISE = 60.0, 0.0016231562
AT_ONCE = 50  # recordings whose changes are computed together, to spare memory
ROOT = Path(__file__).parents[1]
REAL = {  # a controller's runs: data set that describes them, folder of the tables, seconds
    "acrobot, LQR": ("dfki_c1_swingup", "leaderboard_acrobot_v2_ilqr_tvlqr_lqr", 4.0),
    "acrobot, MC-PILCO": ("dfki_c1_swingup", "leaderboard_acrobot_v2_mcpilco", None),
    "pendubot, LQR": ("dfki_c1_pendubot", "leaderboard_pendubot_v2_ilqr_tvlqr_lqr", 4.0),
    "pendubot, MC-PILCO": ("dfki_c1_pendubot", "leaderboard_pendubot_v2_mcpilco", None),
    "sys_id": ("dfki_c1", "sys_id_20230629", None),
}


class Case(NamedTuple):
    """Sets of one kind: changes to draw from, and what is right to say of them."""

    name: str
    pool: Changes
    right: Callable[[Judgement], bool]


def recorded(
    settings: dict[str, Any],
    seed: int,
    count: int,
    motion: dict[str, Any],
    wear: tuple[float, ...] = (),
    mass: float | None = None,
) -> Dataset:
    """Recordings of random motion, worn from the first one on, or with another last mass."""
    rng = np.random.default_rng(seed)
    runs = []
    for i in range(count):
        amplitude = round(rng.uniform(*motion["amplitude"]), 3)
        sines = Multisine(amplitude, tuple(round(rng.uniform(*b), 3) for b in motion["bands"]))
        start = tuple(rng.uniform(-2.0, 2.0, 2).round(3).tolist())
        runs.append(Run(f"run{seed}-{i}", start, torques=(sines,)))
    scatter = settings["friction"]["scatter"]
    rig = Rig(
        *("acrobot", {"kind": "acrobot"}, Stribeck(CURVE)),
        Camera(int(settings["seconds"] * RATE) + 1, RATE, NOISE),
        tuple(runs),
        variation=Variation(scatter=scatter, wear=wear, sudden=bool(wear)),
        true_parameters={} if mass is None else {"m4": mass},
        seed=seed,
        substeps=4,
    )
    data = simulate(rig)
    return replace(data, mechanism=off_by(data.mechanism, settings["off"]))


def off_by(mechanism: Mechanism, share: float) -> Mechanism:
    """The mechanism with all masses and inertias more or less by a share, always the same."""
    draw = np.random.default_rng(5)
    values = {
        name: value * (1.0 + share * draw.choice([-1.0, 1.0]))
        for name, value in mechanism.nominal().items()
        if name[0] in "mJ"
    }
    return mechanism.with_values(values) if share else mechanism


def with_torque(data: Dataset, change: Callable[[Recording], Recording]) -> Dataset:
    """The data set with each recording's torque as it would have been logged otherwise."""
    return replace(data, recordings=tuple(map(change, data.recordings)))


def logged(settings: dict[str, Any]) -> dict[str, Callable[[Recording], Recording]]:
    """What the log may have done, or a push that is not in it, by its name."""
    calls = settings["calls"]
    count, seconds, push = calls["pulses"]

    def late(r: Recording) -> Recording:
        return replace(r, torque=r.torque._replace(time=r.torque.time - calls["delay"]))

    def gain(r: Recording) -> Recording:
        return replace(r, torque=r.torque._replace(value=r.torque.value / (1.0 + calls["gain"])))

    def pulses(r: Recording) -> Recording:
        rng = np.random.default_rng([int(1e3 * abs(r.angle.value[0, 0])), count])
        value, time = r.torque.value.copy(), r.torque.time
        for begin in rng.uniform(1.0, settings["seconds"] - 1.0, int(count)):
            value[(time > begin) & (time < begin + seconds), 1] -= push
        return replace(r, torque=r.torque._replace(value=value))

    return {"delay": late, "gain": gain, "pulses": pulses}


def changes(known: Baseline, data: Dataset) -> tuple[Changes, int]:
    """Changes of recordings against the reference of a baseline, and stretches left out."""
    parts, stretches = [], 0
    for i in range(0, len(data.recordings), AT_ONCE):
        part = replace(data, recordings=data.recordings[i : i + AT_ONCE])
        most = known.changes.disturbed
        found, left_out = recording_changes(prepared_data(part), known.reference, (), most)
        parts.append(found)
        stretches += len(left_out)
    return joined(parts), stretches


def cases(settings: dict[str, Any], known: Baseline, seed: int) -> Iterator[Case]:
    """All kinds of sets that differ from the baseline's motion or machine."""
    other, count = settings["other"]["motion"], settings["friction"]["count"]

    def otherwise(seed: int, count: int, **changed: Any) -> Dataset:
        each = count // len(other)
        sets = [recorded(settings, 10 * seed + i, each, m, **changed) for i, m in enumerate(other)]
        return replace(sets[0], recordings=sum((s.recordings for s in sets), ()))

    quiet = otherwise(seed, settings["other"]["count"])
    yield Case("healthy, other motion", changes(known, quiet)[0], lambda said: not said.causes)
    for joint in range(2):
        for sign in (1.0, -1.0):
            wear = tuple(sign * settings["friction"]["change"] * (k == joint) for k in range(2))
            worn = otherwise(seed + 2 + 2 * joint + int(sign > 0), count, wear=wear)

            def right(j: Judgement, joint: int = joint, sign: float = sign) -> bool:
                total = j.parts.query("part == 'total'").change.iloc[joint]
                return j.joints == (joint,) and sign * total > 0

            name = (
                f"friction of joint {joint + 1}, {100 * sign * settings['friction']['change']:+g} %"
            )
            yield Case(name, changes(known, worn)[0], right)
    mass = (1.0 + settings["calls"]["payload"]) * mechanisms.acrobot().nominal()["m4"]
    laden = recorded(settings, seed + 9, settings["calls"]["count"], settings["motion"], mass=mass)
    yield Case("payload", changes(known, laden)[0], called("payload"))
    for name, change in logged(settings).items():
        pool, stretches = changes(known, with_torque(quiet, change))
        print(f"{name}: {stretches} stretches left out of {len(pool.value)} recordings")
        yield Case(name, pool, called(name))


def called(name: str) -> Callable[[Judgement], bool]:
    """Whether a judgement calls it by its name, or says that it cannot separate it from others."""

    def right(j: Judgement) -> bool:
        return name == "pulses" or any(name in cause for cause in j.causes)

    return right


def counted(hits: int, cases: int) -> str:
    """A share with its exact 95 % interval (Clopper-Pearson)."""
    low, high = binomtest(hits, cases).proportion_ci()
    return f"{hits} of {cases}, {hits / cases:.1%} [{low:.1%}, {high:.1%}]"


def print_sets(
    settings: dict[str, Any], known: Baseline, healthy: Changes, case: Case, count: int
) -> None:
    """Print what the monitor says of sets that are drawn from a pool."""
    rng, said = np.random.default_rng(settings["seed"]), []
    same = case.pool is healthy
    for _ in range(count):
        order = rng.permutation(len(healthy.value))
        base, rest = order[: settings["baseline"]], order[settings["baseline"] :]
        of = rest if same else np.arange(len(case.pool.value))
        new = rng.choice(of, settings["group"], replace=False)
        names = tuple(map(str, base))
        own = replace(known, changes=healthy.rows(base), names=names, hashes=names)
        said.append(judge(own, case.pool.rows(new), settings["rate"]))
    answers = [j.answer for j in said]
    right = sum(not j.parts.empty and case.right(j) for j in said)
    print(
        f"{case.name}: friction called changed {counted(answers.count('changed'), count)}, "
        f"anything {counted(sum(bool(j.causes) for j in said), count)}, "
        f"cannot judge {sum(j.parts.empty for j in said)}, right {counted(right, count)}",
        flush=True,
    )


def simulated(settings: dict[str, Any], sets: int) -> None:
    """Print all rates of simulated sets."""
    data = recorded(settings, settings["seed"], settings["healthy"], settings["motion"])
    known = baseline(replace(data, recordings=data.recordings[: settings["baseline"]]))
    healthy, stretches = changes(known, data)
    print(f"healthy: {stretches} stretches left out of {len(data.recordings)} recordings")
    same = Case("healthy, same motion", healthy, lambda said: not said.causes)
    print_sets(settings, known, healthy, same, sets // 2)
    for case in cases(settings, known, 100 * settings["seed"]):
        count = sets // 2 if case.name.startswith("healthy") else settings["found"]
        print_sets(settings, known, healthy, case, count)


def of_controller(name: str) -> Dataset:
    """The runs of one controller on the real arm."""
    source, folder, seconds = REAL[name]
    text = (ROOT / "data" / source / "dataset.toml").read_text("utf-8")
    text = re.sub(r"patterns = .*", f'patterns = ["design_C.1/{folder}/*.csv*"]', text)
    text = re.sub(r"stop = .*", "" if seconds is None else f"stop = {seconds}", text)
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "dataset.toml"
        path.write_text(text, "utf-8")
        return load_dataset(path)


def parts_of(data: Dataset, pieces: int) -> list[Dataset]:
    """The first and the second half of a recording, each in so many pieces."""
    r = data.recordings[0]
    edges = np.linspace(r.angle.time[0], r.angle.time[-1], 2 * pieces + 1)
    cut = []
    for i, (a, b) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        angle = taken(r.angle, (r.angle.time >= a) & (r.angle.time < b))
        cut.append(replace(r, name=f"part {i + 1}", angle=angle, truth=None))
    halves = cut[:pieces], cut[pieces:]
    return [replace(data, recordings=tuple(half), truth=None) for half in halves]


def real() -> None:
    """Print what each controller's runs say of those of the others: the same friction."""
    sets = {name: of_controller(name) for name in REAL}
    for name in list(REAL)[:-1]:
        known = baseline(sets[name])
        for other, data in sets.items():
            if other != name:
                found = monitor(known, data)
                print(f"{name} -> {other}: {found.answer}; {found.sentence}", flush=True)
                print("   ", *found.judgement.notes[:2])
    for name, pieces in (("tx40", 4), ("tiago", 4), ("emps", 6)):
        first, second = parts_of(load_dataset(ROOT / "data" / name), pieces)
        found = monitor(baseline(first), second)
        print(f"{name}: {found.answer}; {found.sentence}", *found.judgement.notes[:1], flush=True)


def main(
    *,
    sets: int | None = None,
    only: Literal["simulated", "real"] | None = None,
    healthy: int | None = None,
    new: int | None = None,
    off: float = 0.0,
) -> None:
    """Print all rates.

    Parameters
    ----------
    sets : Simulated data sets [those of monitoring.toml].
    only : One of both parts.
    healthy : Recordings of a simulated baseline [as there].
    new : Recordings of a simulated set [as there].
    off : Share by which masses and inertias of the model are off the simulated ones.
    """
    settings = tomllib.loads((Path(__file__).parent / "monitoring.toml").read_text("utf-8"))
    settings["baseline"], settings["group"] = (
        healthy or settings["baseline"],
        new or settings["group"],
    )
    settings["off"] = off
    if only != "real":
        simulated(settings, sets or settings["sets"])
    if only != "simulated":
        real()


if __name__ == "__main__":
    call(main)
