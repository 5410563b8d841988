"""How often the intervals of pooled models hold what they are to hold.

    python comparisons/pooling.py            # meta-analyses, a minute
    python comparisons/pooling.py 100        # and simulated rigs, 100 sets: 20 minutes

First meta-analyses of specimens drawn from a normal distribution, with estimates whose standard
errors differ by a factor of three between specimens: does the interval of the mean hold the mean,
and the range the next specimen?

Then simulated servos without a torque log, of set-valued friction and an integrator of their own:
friction and delay of each rig are drawn, each rig is recorded under two gain sets, fitted by
shooting, and the fits are pooled.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from drive_logs import ServoPendulum

import frictionid as fid
from frictionid.deploy.random_effects import random_effects

COUNT, SEED = 1000, 0
SPECIMENS, SPREADS = (2, 3, 5, 10), (0.0, 0.5, 1.0, 3.0)

RIGS, SPREAD = 5, 0.1  # of a set; standard deviation between rigs over the mean
MEANS = {"coulomb": 0.03, "viscous": 0.02, "delay": 0.010}  # [N m], [N m s/rad], [s]
NAMES = {"coulomb": "coulomb", "viscous": "viscous", "target delay": "delay"}
GAINS = {"soft": (4.0, 0.05), "stiff": (10.0, 0.15)}
RATE, SECONDS = 100.0, 4.0


def covered(specimens: int, tau: float, count: int, seed: int) -> tuple[float, float]:
    """How often interval of the mean and range hold it; tau is in units of the mean error."""
    rng = np.random.default_rng([seed, specimens, round(10 * tau)])
    held = np.zeros((count, 2))
    for row in held:
        errors = rng.uniform(0.5, 1.5, specimens)
        values = tau * rng.standard_normal(specimens) + errors * rng.standard_normal(specimens)
        found = random_effects(values, errors)
        (low, high), (least, most) = found.interval(), found.range()
        row[:] = low <= 0.0 <= high, least <= tau * rng.standard_normal() <= most
    interval, range_ = held.mean(axis=0)
    return float(interval), float(range_)


# --- Simulated rigs -------------------------------------------------------------------------------


def drawn(rng: np.random.Generator) -> dict[str, float]:
    """Friction and delay of a rig."""
    return {name: mean * (1 + SPREAD * rng.standard_normal()) for name, mean in MEANS.items()}


def recordings(rig: Mapping[str, float], seed: int) -> dict[str, pd.DataFrame]:
    """A recording of a rig under each gain set, by its name."""
    servo = ServoPendulum(**rig, rate=RATE)
    return {
        name: pd.DataFrame(servo.log(P, D, 10 * seed + i, SECONDS))
        for i, (name, (P, D)) in enumerate(GAINS.items())
    }


def fitted(frames: Mapping[str, pd.DataFrame]) -> fid.Fit:
    """Fit by shooting of recordings by their gain sets, without their torque."""
    machine = fid.mechanisms.pendulum(mass=0.5, length=0.15)
    gains = {name: {"P": P, "D": D} for name, (P, D) in GAINS.items() if name in frames}
    actuator = {"target": "target", "output": "torque", "P": 4.0, "recordings": gains}
    data = fid.Dataset.from_frames(frames, machine, time="t", angle="q", actuator=actuator)
    return fid.fit(data, "coulomb_viscous", method="shooting", free=["target_delay"])


def pooled_set(seed: int) -> pd.DataFrame:
    """What the pooled fits of a set of rigs hold: a fit per rig, and one per rig and gain set."""
    rng = np.random.default_rng([seed, 7])
    logs = [recordings(drawn(rng), RIGS * seed + k) for k in range(RIGS)]
    another = drawn(rng)
    alone = [fitted({name: frame}) for log in logs for name, frame in log.items()]
    ways = {"rig": [fitted(log) for log in logs], "rig and gain set": alone}
    return pd.concat(held(fits, another).assign(way=way) for way, fits in ways.items())


def held(fits: Sequence[fid.Fit], another: Mapping[str, float]) -> pd.DataFrame:
    """Whether interval, range and tau's interval of each parameter hold the truth."""
    frame = fid.pool(fits).frame
    names = frame.parameter.map(NAMES)
    mean, next_one = names.map(MEANS), names.map(another)
    return pd.DataFrame(
        {
            "parameter": frame.parameter,
            "mean": mean.between(frame.low_95, frame.high_95),
            "range": next_one.between(frame.range_low, frame.range_high),
            "tau": (SPREAD * mean).between(frame.tau_low, frame.tau_high),
            "half": (frame.range_high - frame.range_low) / 2 / mean,
        }
    )


# --- Tables ---------------------------------------------------------------------------------------


def show_analyses() -> None:
    """Print the table of meta-analyses."""
    print("| specimens | tau over the errors | interval of the mean | range of another |")
    print("| --- | --- | --- | --- |")
    for specimens in SPECIMENS:
        for tau in SPREADS:
            both = covered(specimens, tau, COUNT, SEED)
            print(
                f"| {specimens} | {tau:g} | " + " | ".join(f"{100 * v:.1f} %" for v in both) + " |"
            )


def show_rigs(count: int) -> None:
    """Print the table of simulated rigs, seeds 0 to count - 1."""
    found = pd.concat(pooled_set(seed) for seed in range(count))
    print("\n| a fit per | parameter | sets | mean | range | tau | half of the range |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for (way, name), own in found.groupby(["way", "parameter"]):
        shares = " | ".join(f"{100 * own[key].mean():.0f} %" for key in ("mean", "range", "tau"))
        print(f"| {way} | {name} | {len(own)} | {shares} | {100 * own.half.median():.0f} % |")


if __name__ == "__main__":
    show_analyses()
    if len(sys.argv) > 1:
        show_rigs(int(sys.argv[1]))
