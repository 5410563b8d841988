"""Regret of the default: what frictionid chooses, against the best choice in hindsight.

    python comparisons/regret.py [MACHINE ...] [--out TABLE.md]

Recordings of real machines (in FRICTIONID_DATA) are split into training and test sets. An arm is a
law with a way to fit it, to all training data. Its error on a test set is the median error of the
angles after 0.5 and 1 s, from the same starts for all arms; of arms under position control the
torque that is left over (see `arms.py`), of a quadruped the mean error of a free run of its
controller. An arm's regret is the geometric mean, over test sets and horizons, of its errors over
those of the arm that is best by that mean.

The default takes no part in that: it is fitted by the default method, its law is what the verdict
of `frictionid.compare` on the training data alone says to use, fitted to all of them. Nothing here
says what the defaults are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import arms
import numpy as np
from numpy.typing import NDArray
from script import call

import frictionid as fid
from frictionid.api.evaluate import scores_of
from frictionid.comparison.training_set import Method
from frictionid.data.readers.dataset import load_dataset, within
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import Protocol
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.fitting.parameter_block import ParameterBlock
from frictionid.fitting.parameters import (
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    InertiaBlock,
    TargetDelayBlock,
)
from frictionid.fitting.shooting import Settings, Shooting
from frictionid.fitting.shooting.settings import torque_is_sampled
from frictionid.fitting.torque_balance import InverseDynamics

DATA = Path(__file__).parent.parent / "data"
HORIZONS = (0.5, 1.0)  # [s]
DEFAULT = "default"
LAWS = {
    "coulomb_viscous": fid.CoulombViscous(),
    "stribeck": fid.Stribeck(),
    "stribeck by direction": fid.Stribeck(symmetric=False),
    "load_dependent": fid.LoadDependent(),
    "motor_load": fid.MotorLoad(),
    "load_dependent, stribeck": fid.LoadDependent(stribeck=True),
    "quadratic": fid.Quadratic(),
    "ripple": fid.Ripple(harmonics=(2,)),  # of a linkage
}
USUAL = ("coulomb_viscous", "stribeck", "stribeck by direction", "load_dependent", "motor_load")
# without motor_load: beside free inertias the motors' own torque explains anything
OF_ARMS = ("coulomb_viscous", "stribeck", "load_dependent", "load_dependent, stribeck")
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Machine:
    """A machine with recordings to fit and others to test.

    train, tests : data sets; laws : names in `LAWS`
    method : by which its law is fitted if nothing is said
    sample_time : [s] between samples, None for all
    horizons : [s] of the choice within the training data, those of `compare` if not given
    judge : errors of fits by name (A, E), in place of those of predictions
    folds : of the choice, those of `compare` if not given
    """

    train: Dataset
    tests: Mapping[str, Dataset]
    laws: tuple[str, ...] = USUAL
    method: str = "shooting"
    sample_time: float | None = None
    horizons: tuple[float, ...] | None = None
    judge: Callable[[Machine, Mapping[str, fid.Fit]], Array] | None = None
    folds: int | None = None


# --- Machines ------------------------------------------------------------------------------------


def only(name: str, *words: str) -> Dataset:
    """The recordings of a data set whose names have one of some words in them."""
    dataset = load_dataset(DATA / name)
    chosen = tuple(r for r in dataset.recordings if any(word in r.name for word in words))
    return replace(dataset, recordings=chosen)


def part(name: str, first: float, last: float) -> Dataset:
    """All recordings of a data set, from one share of their time to another."""
    dataset = load_dataset(DATA / name)
    spans = [float(np.ptp(r.angle.time)) for r in dataset.recordings]
    pairs = zip(dataset.recordings, spans, strict=True)
    return replace(dataset, recordings=tuple(within(r, first * s, last * s) for r, s in pairs))


def c1() -> Machine:
    """Double pendulum, fitted to torques from rest, tested on swing-ups."""
    names = ("dfki_c1_swingup", "dfki_c1_pendubot")
    tests = {name.removeprefix("dfki_c1_"): load_dataset(DATA / name) for name in names}
    return Machine(load_dataset(DATA / "dfki_c1"), tests, sample_time=0.01)


def a0() -> Machine:
    """Double pendulum, fitted to motion within 1.8 rad, tested on a turn and on a swing-up."""
    tests = {name: only("dfki_a0", name) for name in ("trajectory_05", "trajectory_11")}
    return Machine(only("dfki_a0", "_00", "_01", "_02", "_03"), tests, sample_time=0.01)


def xl330(fitted: str, tested: str) -> Machine:
    """Servo with a pendulum, tested at another gain."""
    tests = {tested: only("bam_xl330_whole", tested)}
    return Machine(only("bam_xl330_whole", fitted), tests, sample_time=0.01)


def emps() -> Machine:
    """Carriage on a rail, tested on the last 30 %."""
    tests = {"last 30 %": part("emps", 0.7, 1)}
    return Machine(part("emps", 0, 0.7), tests, sample_time=0.01)


def ibm() -> Machine:
    """Filmed double pendulum, tested on two other films."""
    tests = {f"film {name}": only("ibm", name) for name in "45"}
    laws = (*USUAL[:-1], "quadratic")
    return Machine(only("ibm", *"0123"), tests, laws, "shooting", 0.01)


def arm(name: str, sample_time: float | None, horizons: tuple[float, ...]) -> Machine:
    """Arm under position control, judged by the torque that is left over in the last 30 %."""
    dataset = load_dataset(DATA / name)
    (recording,) = dataset.recordings
    first = within(recording, 0.0, arms.ARMS[name].until - float(recording.angle.time[0]))
    train, laws = replace(dataset, recordings=(first,)), OF_ARMS
    tests = {"torque left": dataset}
    return Machine(train, tests, laws, "inverse_dynamics", sample_time, horizons, torque_left)


def go2() -> Machine:
    """Quadruped in the air, tested on the last third of its chirp, with its controller."""
    tests, laws = {"free run": part("go2", 2 / 3, 1)}, ("coulomb_viscous", "ripple")
    return Machine(part("go2", 0, 2 / 3), tests, laws, "shooting", 0.02, None, free_runs, 3)


MACHINES: Mapping[str, Callable[[], Machine]] = {
    "dfki_c1": c1,
    "dfki_a0": a0,
    "xl330_kp100": lambda: xl330("kp100", "kp400"),
    "xl330_kp400": lambda: xl330("kp400", "kp100"),
    "emps": emps,
    "ibm": ibm,
    "tx40": lambda: arm("tx40", 0.002, (0.05, 0.1, 0.2)),
    "tiago": lambda: arm("tiago", None, (0.1, 0.25, 0.5)),
    "go2": go2,
}


# --- Errors --------------------------------------------------------------------------------------


def predictions(machine: Machine, fits: Mapping[str, fid.Fit]) -> Array:
    """Median errors of the angles (A, tests x horizons)."""
    protocol = Protocol(horizons=HORIZONS, sample_time=machine.sample_time)
    return np.concatenate(
        [_scored(fits, test, protocol, "rollout_angle") for test in machine.tests.values()], axis=1
    )


def free_runs(machine: Machine, fits: Mapping[str, fid.Fit]) -> Array:
    """Mean errors of free runs (A, tests)."""
    protocol = Protocol(horizons=HORIZONS[:1], sample_time=machine.sample_time, whole=True)
    return np.concatenate(
        [_scored(fits, test, protocol, "free_run") for test in machine.tests.values()], axis=1
    )


def torque_left(machine: Machine, fits: Mapping[str, fid.Fit]) -> Array:
    """Shares of the torque (A, 1) that fits leave unexplained after the training data."""
    name, until = machine.train.name, float(machine.train.recordings[0].angle.time[-1])
    balances = arms.balances(name)
    shares = []
    for fit in fits.values():
        e, u, clock = arms.left(balances, fit)
        shares.append([arms.share(e, u, clock >= until)])
    return np.array(shares)


def _scored(fits: Mapping[str, fid.Fit], test: Dataset, protocol: Protocol, score: str) -> Array:
    """A score of all joints (A, horizons), the median of predictions and the mean of free runs."""
    table = scores_of({name: fit.friction for name, fit in fits.items()}, test, protocol)
    table = table.sort_values("horizon_s")
    statistic = "median" if score == "rollout_angle" else "mean"
    rows = (table.score == score) & (table.statistic == statistic) & (table.joint == "all")
    by_arm = {name: group.value.to_numpy() for name, group in table[rows].groupby("identifier")}
    return np.array([by_arm[name] for name in fits])


# --- Arms and the default ------------------------------------------------------------------------


def ways(machine: Machine) -> dict[str, Method]:
    """Ways to fit beside the default."""
    late: list[ParameterBlock] = [DelayBlock()] if torque_is_sampled(machine.train) else []
    late += [TargetDelayBlock()] if any(r.servo for r in machine.train.recordings) else []
    narrow = (FrictionBlock(), *late)
    if machine.method == "inverse_dynamics":
        near = (*narrow, InertiaBlock(prior=arms.PRIOR), BiasBlock())
        return {
            "friction and delay": InverseDynamics(blocks=narrow),
            "inertia by a prior": InverseDynamics(blocks=near),
            "one step": INTEGRAL,
        }
    # a passive machine shows only ratios, and no bias
    free = (InertiaBlock(), BiasBlock()) if late else (InertiaBlock(fixed=("gravity_1",)),)
    return {
        "friction and delay": Shooting(blocks=narrow),
        "what shows": Shooting(blocks=(*narrow, *free)),
        "all kept": Shooting(blocks=(*narrow, *free), settings=Settings(significance=1.0)),
        "one step": INTEGRAL,
    }


def default_of(machine: Machine) -> tuple[str, str, dict[str, fid.Fit]]:
    """The law that folds of the training data choose, what it frees, and the fits of all laws."""
    comparison = fid.compare(
        machine.train,
        {name: LAWS[name] for name in machine.laws},
        machine.folds,
        machine.method,
        horizons=machine.horizons,
        sample_time=machine.sample_time,
    )
    fitted, verdict = comparison.fitted, comparison.verdict
    if fitted is None or verdict.provisional is None:
        raise InputError(verdict.sentence)
    for law in verdict.candidates:
        print(f"  folds: {_numbers(law.by_fold):60s} {law.name} {law.standing}")
    by_law = {name: fitted[name, machine.method] for name in machine.laws}
    refined = by_law[verdict.provisional].refined
    free = dict.fromkeys(p.block for p in refined.covariance.parameters) if refined else ()
    fits = {name: fid.Fit(r.overall, machine.train) for name, r in by_law.items()}
    return verdict.provisional, ", ".join(free), fits


def others_of(machine: Machine) -> dict[str, fid.Fit]:
    """All laws by all other ways, fitted to the training data; without what cannot be fitted."""
    fits = {}
    for way, method in ways(machine).items():
        for name in machine.laws:
            try:
                fits[f"{name}, {way}"] = fid.fit(
                    machine.train, LAWS[name], method=method, sample_time=machine.sample_time
                )
            except InputError as error:
                print(f"  {name}, {way}: left out, as {error}")
    return fits


# --- Table ---------------------------------------------------------------------------------------


class Row(NamedTuple):
    """What the default chose on a machine and what was best, with their errors, and the regret."""

    machine: str
    chosen: str
    errors: str
    best: str
    best_errors: str
    regret: float


def row_of(name: str, machine: Machine) -> Row:
    """Regret on one machine; all arms are printed, best first."""
    law, free, fits = default_of(machine)
    arms_of_all = {f"{label}, {DEFAULT}": fit for label, fit in fits.items()} | others_of(machine)
    errors = (machine.judge or predictions)(machine, arms_of_all)
    errors = np.where(np.isfinite(errors), errors, np.inf)
    level = np.exp(np.log(errors).mean(axis=1))
    regret, labels = level / level.min(), list(arms_of_all)
    for k in np.argsort(regret):
        print(f"  {regret[k]:6.3f}  {_numbers(errors[k]):32s} {labels[k]}", flush=True)
    k, best = labels.index(f"{law}, {DEFAULT}"), int(np.argmin(level))
    texts = (f"{law} ({free})", _numbers(errors[k]), labels[best], _numbers(errors[best]))
    return Row(name, *texts, float(regret[k]))


def _numbers(errors: Array) -> str:
    return " ".join(f"{error:.3g}" for error in errors)


def table_of(rows: Sequence[Row]) -> str:
    """The table as Markdown, median and worst regret at its end."""
    head = ("machine", "default (free)", "errors", "best arm", "errors", "regret")
    lines = [f"| {' | '.join(head)} |", "| --- | --- | --- | --- | --- | ---: |"]
    lines += [f"| {' | '.join(map(str, row[:-1]))} | {row.regret:.2f} |" for row in rows]
    regret = [row.regret for row in rows]
    for word, value in (("median", np.median(regret)), ("worst", max(regret))):
        lines.append(f"| {word} | | | | | {value:.2f} |")
    return "\n".join(lines)


def main(machines: list[str] | None = None, *, out: Path | None = None) -> None:
    """Print the table of all machines, or of some, and write it where --out says.

    Parameters
    ----------
    machines : Names of machines [all].
    out : File of the table.
    """
    if unknown := set(machines or ()) - set(MACHINES):
        raise SystemExit(f"{', '.join(sorted(unknown))}: there are {', '.join(MACHINES)}")
    rows: list[Row] = []
    for name in machines or MACHINES:
        begin = time.perf_counter()
        print(name, flush=True)
        try:
            rows.append(row_of(name, MACHINES[name]()))
        except InputError as error:  # a default that fails is worse than any arm
            rows.append(Row(name, f"fails: {error}", "", "", "", np.inf))
        print(f"  regret {rows[-1].regret:.2f}, {time.perf_counter() - begin:.0f} s", flush=True)
        if out is not None:
            out.write_text(table_of(rows) + "\n", encoding="utf-8")
    print(table_of(rows))


if __name__ == "__main__":
    call(main)
