"""Servos without a torque log, simulated: friction, delay of the targets and backlash, many times.

    python comparisons/actuators.py [CASES LOOSE] [CASES TIGHT] [CASES BEHIND] [CASES AXIS]

Loose gears: two gain sets, targets 10 ms late, backlash of 0.5 degrees, fitted with and without the
block `backlash`, a third gain set held out. Tight gears: targets 2 to 12 ms late, each gain set
fitted alone, and with the torque log in place of the targets. Friction behind a gap of 1 degree,
one gain set, with a torque log: the law `play`, and `coulomb_viscous` in its place. An axis with a
gap of 20 mrad between motor and load, friction of both, load inertia and stiffness free, with the
gap as it is, without one, and as it follows from the smallest angle noise. Prints a table of each.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from drive_logs import LooseAxis, ServoPendulum
from scipy.optimize import minimize_scalar
from script import call

import frictionid as fid

GAINS = {"soft": (4.0, 0.05), "stiff": (10.0, 0.15), "held out": (6.0, 0.1)}
RUNS, SECONDS = 3, 6.0
_MANY = 0.1  # of the windows not explained: something is missing
BLOCKS = ("target_delay", "delay", "backlash")


def recordings(rig: ServoPendulum, name: str, seed: int) -> dict[str, pd.DataFrame]:
    """Recordings with a gain set."""
    seeds = 1000 * seed + 10 * list(GAINS).index(name) + np.arange(RUNS)
    logs = (rig.log(*GAINS[name], seed=int(s), seconds=SECONDS) for s in seeds)
    return {f"{name} {k}": pd.DataFrame(log) for k, log in enumerate(logs)}


def dataset(rig: ServoPendulum, names: list[str], seed: int, *, torque: bool = False) -> Any:
    """Data set of gain sets, by their targets or by the torque log."""
    frames: dict[str, pd.DataFrame] = {}
    for name in names:
        frames |= recordings(rig, name, seed)
    machine = fid.mechanisms.pendulum(mass=rig.mass, length=rig.length)
    columns = dict(time="t", angle="q")
    if torque:
        return fid.Dataset.from_frames(frames, machine, torque="u", hold="previous", **columns)
    own = {f"{name} *": dict(zip("PD", GAINS[name], strict=True)) for name in names}
    actuator = dict(target="target", output="torque", P=1.0, recordings=own)
    return fid.Dataset.from_frames(frames, machine, actuator=actuator, **columns)


def fitted(data: Any, *free: str) -> tuple[Any, dict[str, float], dict[str, float]]:
    """A fit, its values, and half-widths of their 95 % intervals, by name."""
    fit = fid.fit(data, "coulomb_viscous", method="shooting", free=list(free) or None)
    rows = list(fit.frame.itertuples())
    names = [r.block if r.block in BLOCKS else r.parameter for r in rows]
    values = {n: r.value for n, r in zip(names, rows, strict=True)}
    return fit, values, {n: (r.high_95 - r.low_95) / 2 for n, r in zip(names, rows, strict=True)}


def error(fit: Any, data: Any) -> float:
    """Root mean square [rad] of free runs of whole recordings."""
    runs = fit.predict(data, whole=True)
    return float(np.sqrt(np.mean((runs["q1"] - runs["measured_q1"]) ** 2)))


def loose(seed: int) -> dict[str, float]:
    """Errors of one case with backlash."""
    rig = ServoPendulum(backlash=np.radians(0.5))
    data = dataset(rig, ["soft", "stiff"], seed)
    fit, found, _ = fitted(data, "target_delay", "backlash")
    without, wrong, _ = fitted(data, "target_delay")
    return {
        "coulomb [%]": 100 * abs(found["coulomb"] / rig.coulomb - 1),
        "viscous [%]": 100 * abs(found["viscous"] / rig.viscous - 1),
        "delay [ms]": 1e3 * abs(found["target_delay"] - rig.delay),
        "backlash [%]": 100 * abs(found.get("backlash", 0.0) / rig.backlash - 1),
        "held out / fitted": error(fit, dataset(rig, ["held out"], seed)) / error(fit, data),
        "without it: coulomb [%]": 100 * abs(wrong["coulomb"] / rig.coulomb - 1),
        "not named (share)": float(
            not any("would show" in w and "backlash" in w for w in without.convergence.warnings)
        ),
        "not doubted (share)": float(not without.convergence.warnings),
    }


def tight(seed: int) -> dict[str, float]:
    """Errors of one case without backlash, and whether its gain sets disagree."""
    rig = ServoPendulum(viscous=0.0, delay=np.random.default_rng(seed).uniform(0.002, 0.012))
    each = [fitted(dataset(rig, [name], seed)) for name in ("soft", "stiff")]
    out = {}
    for (_, found, _), name in zip(each, ("soft", "stiff"), strict=True):
        out[f"{name}: coulomb [%]"] = 100 * abs(found["coulomb"] / rig.coulomb - 1)
        out[f"{name}: viscous [% of coulomb at 1 rad/s]"] = 100 * found["viscous"] / rig.coulomb
        out[f"{name}: delay [ms]"] = 1e3 * abs(found["target_delay"] - rig.delay)
    (_, a, own), (_, b, other) = each
    apart = {name: abs(a[name] - b[name]) > np.hypot(own[name], other[name]) for name in a}
    out |= {f"sets disagree in {name} (share)": float(off) for name, off in apart.items()}
    out["sets disagree in any of these (share)"] = float(any(apart.values()))
    _, logged, _ = fitted(dataset(rig, ["soft", "stiff"], seed, torque=True), "delay")
    out["torque log: coulomb [%]"] = 100 * abs(logged["coulomb"] / rig.coulomb - 1)
    out["torque log: viscous [% of coulomb at 1 rad/s]"] = 100 * logged["viscous"] / rig.coulomb
    out["torque log: delay [ms]"] = 1e3 * abs(logged.get("delay", 0.0))
    return out


def behind(seed: int) -> dict[str, float]:
    """Errors of one case with friction behind a gap, the torque logged as its means, or as held."""
    rig = ServoPendulum(gap=np.radians(1.0), delay=0.0)
    data = dataset(rig, ["soft"], seed, torque=True)
    truth = {"coulomb": rig.coulomb, "viscous": rig.viscous, "gap": rig.gap}
    out: dict[str, float] = {}
    held = fid.fit(
        dataset(replace(rig, held=True), ["soft"], seed, torque=True), "play", method="shooting"
    )
    for name, row in held.frame.set_index("parameter").iterrows():
        out[f"held torque: {name} [%]"] = 100 * abs(row["value"] / truth[name] - 1)
        within = row["low_95"] <= truth[name] <= row["high_95"]
        out[f"held torque: {name} not in its interval (share)"] = float(not within)
    for method in ("one_step", "shooting"):
        fit = fid.fit(data, "play", method=method)
        table = fit.frame.set_index("parameter")
        for name, true in truth.items():
            row = table.loc[name]
            out[f"{method}: {name} [%]"] = 100 * abs(row["value"] / true - 1)
            if method == "shooting":
                within = row["low_95"] <= true <= row["high_95"]
                out[f"{name} not in its interval (share)"] = float(not within)
    without, wrong, _ = fitted(data)
    went, other = fit.convergence, without.convergence
    out["windows not explained [%]"] = 100 * len(went.unexplained) / went.windows
    out["without it: windows not explained [%]"] = 100 * len(other.unexplained) / other.windows
    doubted = other.warnings or len(other.unexplained) > _MANY * other.windows
    out["without it: coulomb [%]"] = 100 * abs(wrong["coulomb"] / rig.coulomb - 1)
    out["without it: not doubted (share)"] = float(not doubted)
    return out


def axis(seed: int) -> dict[str, float]:
    """Errors of one case of motor and load with a gap between them."""
    rig = LooseAxis()
    logs = {str(k): pd.DataFrame(rig.log(10 * seed + k)) for k in range(RUNS)}
    truth = [rig.motor_coulomb, rig.motor_viscous, rig.load_coulomb, rig.load_viscous]
    truth += [rig.load_inertia, rig.stiffness]
    names = [f"{part} {name}" for part in ("motor", "load") for name in ("coulomb", "viscous")]
    names += ["load inertia", "stiffness"]

    def fit(gap: float) -> Any:
        machine = fid.mechanisms.two_mass_axis(
            gap=gap, motor_inertia=rig.motor_inertia, load_inertia=0.05, stiffness=120.0
        )
        columns = dict(time="t", angle=["q1", "q2"], torque=["u1", "u2"], hold="previous")
        data = fid.Dataset.from_frames(logs, machine, **columns)
        free = dict(free=["friction", "inertia"], fixed=["inertia.motor_inertia"])
        return fid.fit(data, "coulomb_viscous", method="shooting", **free)

    def errors(found: Any, name: str) -> dict[str, float]:
        values = found.frame.value.to_numpy()[: len(truth)]
        off = 100 * np.abs(values / np.array(truth) - 1)
        return {f"{name}{n} [%]": float(x) for n, x in zip(names, off, strict=True)}

    def noise(gap: float) -> float:
        return float(np.hypot(*fit(gap).convergence.angle_noise))

    best = minimize_scalar(noise, bounds=(0.005, 0.05), method="bounded", options={"xatol": 2e-4})
    without = fit(0.0)
    out = errors(fit(rig.gap), "") | errors(fit(float(best.x)), "gap found: ")
    out["gap found [%]"] = 100 * abs(best.x / rig.gap - 1)
    out["fits that took"] = best.nfev
    out["without a gap: motor coulomb [%]"] = errors(without, "")["motor coulomb [%]"]
    out["without a gap: not doubted (share)"] = float(not without.convergence.warnings)
    return out


def main(many: list[int] | None = None) -> None:
    """Print median, 95 % quantile and largest of all errors."""
    for study, cases in zip((loose, tight, behind, axis), many or 4 * [20], strict=True):
        if not cases:
            continue
        table = pd.DataFrame([study(seed) for seed in range(cases)])
        rows = table.quantile([0.5, 0.95, 1.0]).T
        rows["mean"] = table.mean()
        print(f"{study.__name__}, {cases} cases (seeds 0 to {cases - 1})")
        print(rows.round(3).to_string(), "\n", flush=True)


if __name__ == "__main__":
    call(main)
