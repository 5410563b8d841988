"""Numerics under stress: what harms a friction curve and its intervals, and what `check` says.

    python comparisons/stress.py [SEEDS] [--only WORD]    # figures of docs/failures.md

Simulated acrobots with set-valued Stribeck friction, as in `intervals.py`, are recorded under one
stress each: other rates, noise, encoders, glitches, what is lost or does not move. Stribeck
friction is fitted by the momentum balance and by shooting, as `frictionid fit` does.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from coverage_cases import NOISE, case_of, parts_of, rig_of
from outliers import Wild, error_of, with_outliers
from scipy.signal import lfilter
from script import call

import frictionid as fid
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Array, Signal
from frictionid.simulate import simulate

LAW, MACHINE, RECORDINGS = "stribeck", "acrobot", 8
METHODS = ("one_step", "shooting")
SECONDS, STEPS = 2.0, 1440.0  # of a recording; of the true motion in a second, at least
THIN = {"one_step": None, "shooting": 1e-3}  # [s], least distance of samples that are fitted
# A point mass on a rod without inertia, on a light rod of so much inertia [kg m^2]: stretched, the
# condition number of its inertia matrix is 0.3 over that; that of the acrobot is 19.
TWO_RODS = {"m1": 1e-3, "m2": 0.3, "l1": 0.2, "r1": 0.1, "r2": 0.2, "I2": 0.012}
Change = Callable[[Dataset, int], Dataset]


class Stress(NamedTuple):
    """A change of a data set with a seed; rate [Hz], noise [rad], inertia of a rod [kg m^2]."""

    change: Change = lambda data, _: data
    rate: float = 60.0
    noise: float = NOISE[MACHINE]
    rod: float | None = None


def of_angles(change: Callable[[Array, np.random.Generator], Array]) -> Change:
    """Change of the angles (T, n) of each recording."""
    return _of("angle", lambda s, rng: s._replace(value=change(s.value, rng)))


def of_torques(change: Callable[[Array, np.random.Generator], Array]) -> Change:
    """Change of the torques (T, n) of each recording."""
    return _of("torque", lambda s, rng: s._replace(value=change(s.value, rng)))


def _of(quantity: str, change: Callable[[Signal, np.random.Generator], Signal]) -> Change:
    def changed(data: Dataset, seed: int) -> Dataset:
        rng = np.random.default_rng([seed, 11])
        own = [replace(r, **{quantity: change(getattr(r, quantity), rng)}) for r in data.recordings]
        return replace(data, recordings=tuple(own))

    return changed


def single(signal: Signal, _: np.random.Generator) -> Signal:
    """Samples and stamps of single precision."""
    return signal._replace(time=np.float32(signal.time), value=np.float32(signal.value))


def lossy(signal: Signal, rng: np.random.Generator) -> Signal:
    """A fifth of the samples is lost, but not the first and the last one."""
    kept = rng.random(len(signal.time)) > 0.2
    kept[[0, -1]] = True
    return signal._replace(time=signal.time[kept], value=signal.value[kept])


def correlated(value: Array, rng: np.random.Generator, share: float) -> Array:
    """Noise of the usual size of which a share stays from one sample to the next."""
    white = NOISE[MACHINE] * np.sqrt(1 - share**2) * rng.standard_normal(value.shape)
    return value + lfilter([1.0], [1.0, -share], white, axis=0)


def rounded(steps: int) -> Change:
    """Encoders of so many steps per turn."""
    return of_angles(lambda q, _: 2 * np.pi / steps * np.round(q * steps / (2 * np.pi)))


def decays(data: Dataset, _: int) -> Dataset:
    """Recordings without torque only."""
    still = tuple(r for r in data.recordings if not r.torque.value.any())
    return replace(data, recordings=still)


STRESSES = {
    "nothing": Stress(),
    "single precision": Stress(
        lambda data, seed: _of("torque", single)(_of("angle", single)(data, seed), seed)
    ),
    "10 kHz": Stress(rate=10_000.0),
    "1 kHz": Stress(rate=1000.0),
    "20 Hz": Stress(rate=20.0),
    "10 Hz": Stress(rate=10.0),
    "20 % of samples lost": Stress(_of("angle", lossy)),
    "5 % of angles off by 1 rad": Stress(
        lambda d, s: with_outliers(d, Wild("angle", 0.05, 1.0), s)
    ),
    "5 % of angles off by 0.05 rad": Stress(
        lambda d, s: with_outliers(d, Wild("angle", 0.05, 0.05), s)
    ),
    "5 % of torques off by 1 N m": Stress(
        lambda d, s: with_outliers(d, Wild("torque", 0.05, 1.0), s)
    ),
    "noise 10 times": Stress(noise=10 * NOISE[MACHINE]),
    "noise, half stays each sample": Stress(
        of_angles(lambda q, rng: correlated(q, rng, 0.5)), noise=0.0
    ),
    "noise, 90 % stays each sample": Stress(
        of_angles(lambda q, rng: correlated(q, rng, 0.9)), noise=0.0
    ),
    "encoders of 4096 steps": Stress(rounded(4096), noise=0.0),
    "encoders of 1024 steps": Stress(rounded(1024), noise=0.0),
    "encoders of 256 steps": Stress(rounded(256), noise=0.0),
    "encoders of 1024 steps, 1 kHz": Stress(rounded(1024), rate=1000.0, noise=0.0),
    "torque clipped at 70 %": Stress(of_torques(lambda u, _: np.clip(u, -0.098, 0.098))),
    "near-singular inertia, condition 300": Stress(rod=1e-3),
    "near-singular inertia, condition 3000": Stress(rod=1e-4),
    "free decays only": Stress(decays),
    "torque logged as zero": Stress(of_torques(lambda u, _: 0.0 * u)),
    "angles constant": Stress(of_angles(lambda q, _: q[:1] + 0.0 * q)),
    "angles constant but for noise": Stress(
        of_angles(lambda q, rng: correlated(q[:1] + 0.0 * q, rng, 0.0))
    ),
    "angle 1 constant": Stress(of_angles(lambda q, _: np.where([True, False], q[:1], q))),
    "angle 2 constant": Stress(of_angles(lambda q, _: np.where([False, True], q[:1], q))),
}


@cache
def recorded(rate: float, noise: float, rod: float | None, seeds: Sequence[int]) -> list[Dataset]:
    """Simulated sets without stress, their motions computed side by side."""
    rig = rig_of(case_of(LAW, MACHINE), seeds, RECORDINGS, late=False)
    camera = replace(rig.camera, samples=round(SECONDS * rate) + 1, rate=rate, angle_noise=noise)
    steps = int(np.ceil(STEPS / rate))
    if rod is not None:
        machine = {"kind": "double_pendulum", "driven": [False, True]}
        rig = replace(rig, mechanism=machine | {"parameters": TWO_RODS | {"I1": rod}})
        steps *= 8
    return parts_of(simulate(replace(rig, camera=camera, substeps=steps)), RECORDINGS)


class Found(NamedTuple):
    """Curve errors (n,), and which parameters (n P,) are identified, and have the truth inside."""

    error: Array
    identified: Array
    held: Array


def found_by(method: str, data: Dataset, clean: Dataset) -> Found:
    """What a fit gives; the truth is that of the clean data."""
    fit = fid.fit(data, LAW, method=method, sample_time=THIN[method])
    true = case_of(LAW, MACHINE).values.ravel()
    own = fit.frame[fit.frame.block == "friction"]
    held = (own.low_95 <= true) & (true <= own.high_95)
    assert np.isfinite(fit.friction.theta).all()
    return Found(error_of(fit.friction, clean), own.identified.to_numpy(bool), held.to_numpy(bool))


def findings(datasets: Sequence[Dataset]) -> str:
    """Kinds of findings of `check`, and in how many sets."""
    counts: Counter[str] = Counter()
    for data in datasets:
        verdict = fid.check(data)
        counts.update({f"{k} ({v})": 1 for k, v in verdict.findings[["kind", "level"]].values})
    everything = len(datasets)
    texts = [k if n == everything else f"{k} in {n} of {everything}" for k, n in counts.items()]
    return "; ".join(texts) or "nothing"


def cells(method: str, pairs: Sequence[tuple[Dataset, Dataset]], usual: Array | None) -> list[str]:
    """Cells of the table, from (stressed, clean) sets, and beside them mean errors (n,)."""
    found, refused = [], []
    for data, clean in pairs:
        try:
            found.append(found_by(method, data, clean))
        except fid.InputError as error:
            refused.append(str(error))
    said = f"refused in {len(refused)} of {len(pairs)}: {refused[0]}" if refused else ""
    if not found:
        return [said, "", ""]
    error = np.mean([f.error for f in found], axis=0)
    known = np.concatenate([f.identified for f in found])
    held = np.concatenate([f.held for f in found])[known].sum()
    ratio = " / ".join(f"{x:.2g}" for x in error / (error if usual is None else usual))
    texts = " / ".join(f"{100 * x:.2g} %" for x in error)
    return ["; ".join(filter(None, [texts, said])), ratio, f"{held} of {known.sum()}"]


def main(seeds: int = 5, *, only: str = "") -> None:
    """Print the table, a line for each stress.

    Parameters
    ----------
    seeds : Simulated data sets.
    only : Stresses whose name has this word.
    """
    drawn = tuple(range(1, seeds + 1))
    usual: dict[str, Array] = {}
    calm = recorded(60.0, NOISE[MACHINE], None, drawn)
    for method in METHODS:
        usual[method] = np.mean([found_by(method, d, d).error for d in calm], axis=0)
    print("| stress | `check` says | " + " | ".join(f"{m} | ratio | held" for m in METHODS) + " |")
    print("| --- | --- | " + " | ".join(["---"] * 3 * len(METHODS)) + " |")
    for name, stress in STRESSES.items():
        if only not in name:
            continue
        clean = recorded(stress.rate, stress.noise, stress.rod, drawn)
        stressed = [stress.change(data, seed) for data, seed in zip(clean, drawn, strict=True)]
        pairs = list(zip(stressed, clean, strict=True))
        row = [c for method in METHODS for c in cells(method, pairs, usual[method])]
        print("| " + " | ".join([name, findings(stressed), *row]) + " |", flush=True)


if __name__ == "__main__":
    call(main)
