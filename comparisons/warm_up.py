"""How well friction of a joint that warms up is found, with its temperature and without.

    python comparisons/warm_up.py 20     # figures of docs/pooling.md, a minute of processor time

A simulated pendulum with set-valued friction and an integrator of its own warms up from 15 to
48 degC in each of two recordings of 30 s; its Coulomb level falls by 0.8 % and its viscous friction
by 3 % a kelvin.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from drive_logs import ServoPendulum
from script import call

import frictionid as fid
from frictionid.evaluation import score_value

TRUTH = {"coulomb": 0.06, "viscous": 0.03, "coulomb_slope": -0.008, "viscous_decay": 0.03}
WAYS = [("thermal", "one_step", False), ("thermal", "shooting", False)]
WAYS += [("thermal", "inverse_dynamics", False), ("coulomb_viscous", "one_step", False)]
WAYS += [("thermal", "shooting", True)]


def warm_up(seed: int, *, held: bool = False) -> fid.Dataset:
    """Two recordings, which the seed draws, the torque logged as its means, or as it is held."""
    coulomb, viscous, slope, decay = TRUTH.values()
    servo = ServoPendulum(
        *(0.5, 0.15, coulomb, viscous), delay=0.0, warming=35.0, slope=slope, decay=decay, held=held
    )
    logs = {
        f"run {i}": pd.DataFrame(servo.log(4.0, 0.05, seed=10 * seed + i, seconds=30.0))
        for i in range(2)
    }
    columns = {"time": "t", "angle": "q", "torque": "u", "covariates": {"temperature": "T"}}
    return fid.Dataset.from_frames(logs, fid.mechanisms.pendulum(mass=0.5, length=0.15), **columns)


def after_a_second(fit: fid.Fit, data: fid.Dataset) -> float:
    """Median error [rad] of predictions one second ahead."""
    return score_value(fid.evaluate(fit, data, (1.0,)), "rollout_angle", "median", 1.0)


def main(count: int = 20) -> None:
    """Print errors in per cent, and how often intervals hold the truth, of each way to fit."""
    rows = []
    for seed in range(count):
        for law, method, held_torque in WAYS:
            data, unseen = (warm_up(s, held=held_torque) for s in (seed, 1000 + seed))
            fit = fid.fit(data, law, method=method)
            found = fit.frame[fit.frame.block == "friction"].set_index("parameter")
            true = np.array([TRUTH[name] for name in found.index])
            held = (found.low_95 <= true) & (true <= found.high_95)
            way = method + " (held torque)" * held_torque
            own = {"law": law, "method": way, "after 1 s": after_a_second(fit, unseen)}
            own |= {f"{k} [%]": v for k, v in (100 * (found.value / true - 1).abs()).items()}
            rows.append(own | {f"{k} held": float(v) for k, v in held.items()})
    table = pd.DataFrame(rows).groupby(["law", "method"])
    held = [name for name in table.median() if name.endswith("held")]
    for title, values in (("medians", table.median()), ("largest", table.max())):
        print(title, "\n", values.drop(columns=held).T.round(4).to_string())
    print("times that intervals hold the truth\n", table[held].sum().T.to_string())


if __name__ == "__main__":
    call(main)
