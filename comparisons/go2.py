"""Legs of a quadruped in the air: free runs of laws, and whether left and right legs are alike.

    FRICTIONID_DATA=FOLDER python comparisons/go2.py [ARM ...]

Every arm is fitted to the first two thirds of the recording, and predicts the last third from its
start, with the controller and nothing else. Printed are root mean squares of the angles' errors by
joint [mrad], then those of all joints, and the seconds of computing. Arms are laws by the default,
what the model file has in place of measurements, and what PACE identifies by our solver: Coulomb
and viscous friction, rotors, biases and the delay of the targets (one for all joints), all kept.

Legs are alike where the friction of a joint, as it brakes on average along the recorded motion, is
that of the joint on the other side: Wald's test by the covariance of the fit, with t, p-values
times the number of pairs.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr
from script import call

import frictionid as fid
from frictionid.data.readers.dataset import load_dataset, within
from frictionid.data.recordings import Dataset
from frictionid.data.state_estimators import RTS
from frictionid.fitting.one_step.recipe import states_of
from frictionid.fitting.parameters import BiasBlock, FrictionBlock, InertiaBlock, TargetDelayBlock
from frictionid.fitting.shooting import Settings, Shooting
from frictionid.friction import Friction, Inputs, present

DATA = Path(__file__).parent.parent / "data" / "go2"
LAWS = {
    "coulomb_viscous": fid.CoulombViscous(),
    "stribeck": fid.Stribeck(),
    "load_dependent": fid.LoadDependent(),
    "ripple": fid.Ripple(harmonics=(2,)),
    "by_evidence": fid.Ripple(harmonics="auto"),
}
PLACEHOLDERS = (0.2, 0.6)  # frictionloss [N m] and damping [N m s/rad] of go2.xml
PLACEHOLDER, PACE = "placeholders", "PACE-like"
PAIRS = ((0, 3), (1, 4), (2, 5), (6, 9), (7, 10), (8, 11))  # left and right, front and rear
APART = 0.02  # [s] between samples: of one leg, 5 and 10 ms give the same free run
MOVING = 0.1  # [rad/s]
Array = NDArray[np.float64]


def part(first: float, last: float) -> Dataset:
    """The recording from one share of its time to another."""
    dataset = load_dataset(DATA)
    (recording,) = dataset.recordings
    span = float(np.ptp(recording.angle.time))
    cut = within(recording, first * span, last * span)
    return replace(dataset, recordings=(cut,))


def fitted(arm: str, train: Dataset) -> fid.Fit:
    """An arm fitted to the training data."""
    law, mechanism = fid.CoulombViscous(), train.mechanism
    if arm == PLACEHOLDER:
        return fid.Fit(Friction(law, np.tile(PLACEHOLDERS, (mechanism.n, 1))), train)
    if arm != PACE:
        return fid.fit(train, LAWS[arm], method="shooting", sample_time=APART)
    rotors = {p.name for p in mechanism.parameters if p.rotor}
    known = tuple(name for name in mechanism.base_names if name not in rotors)
    blocks = FrictionBlock(), InertiaBlock(fixed=known), BiasBlock(), TargetDelayBlock()
    settings = Settings(windows=(0.25, 0.5, 1.0), significance=1.0)
    return fid.fit(train, law, method=Shooting(blocks=blocks, settings=settings), sample_time=APART)


def errors(fit: fid.Fit, test: Dataset) -> Array:
    """Root mean squares (n,) [mrad] of a free run's errors."""
    run = fit.predict(test, whole=True)
    columns = range(1, test.mechanism.n + 1)
    off = [run[f"q{j}"] - run[f"measured_q{j}"] for j in columns]
    return 1e3 * np.sqrt(np.square(off).mean(axis=1))


def braking(fit: fid.Fit, data: Dataset) -> tuple[Array, Array]:
    """Mean torque (n,) [N m] that brakes joints while they move, and its covariance (n, n)."""
    ((states,), friction) = states_of(data, RTS(), None), fit.friction
    q, w = states.q, states.w
    x, theta = Inputs(q, w, 0.0 * q, 0.0 * q), np.asarray(friction.theta)
    share = np.where(np.abs(w) > MOVING, np.sign(w), 0.0)
    share = share / np.abs(share).sum(axis=0)
    mean = (share * friction.law.torque(theta, x, ())).sum(axis=0)
    by = (share[..., None] * friction.law.gradient(theta, x)).sum(axis=0)
    refined = friction.provenance.refined
    assert refined is not None
    matrix = refined.square(refined.covariance)
    matrix = np.where(np.isfinite(matrix), matrix, 0.0)  # held, or at a bound
    slope, names = np.zeros((len(mean), len(matrix))), friction.law.names
    for k, estimate in enumerate(refined.parameters):
        if estimate.block == "friction":
            slope[estimate.joint, k] = by[estimate.joint, names.index(estimate.parameter)]
    return mean, slope @ matrix @ slope.T


def compare_sides(fit: fid.Fit, data: Dataset) -> None:
    """Print what joints of left and right legs brake by, and whether they are alike."""
    mean, covariance = braking(fit, data)
    refined = fit.friction.provenance.refined
    assert refined is not None
    for left, right in PAIRS:
        contrast = covariance[np.ix_([left, right], [left, right])] * [[1, -1], [-1, 1]]
        error = float(np.sqrt(contrast.sum()))
        p = 2.0 * float(stdtr(refined.freedom, -abs(mean[left] - mean[right]) / error))
        p = min(1.0, p * len(PAIRS))
        names = " ".join(data.mechanism.joints[j].removesuffix("_joint") for j in (left, right))
        print(f"  {names:18s} {mean[left]:.3f} {mean[right]:.3f} +- {error:.3f} N m, p = {p:.2g}")


def show_harmonics(fit: fid.Fit, data: Dataset) -> None:
    """Print which harmonics each joint has."""
    law = fit.friction.law
    has = present(law, np.asarray(fit.friction.theta))
    for joint, row in zip(data.mechanism.joints, has, strict=True):
        names = [
            n[4:] for n, there in zip(law.names, row, strict=True) if there and n[:4] == "cos_"
        ]
        print(f"  {joint.removesuffix('_joint'):9s} {', '.join(names) or 'none'}")


def main(arms: list[str] | None = None) -> None:
    """Print the free runs of some arms, of all without names."""
    train, test = part(0, 2 / 3), part(2 / 3, 1)
    print(*(joint.removesuffix("_joint") for joint in train.mechanism.joints))
    for arm in arms or (PLACEHOLDER, PACE, *LAWS):
        begin = time.process_time()
        fit = fitted(arm, train)
        seconds, off = time.process_time() - begin, errors(fit, test)
        numbers = " ".join(f"{x:.1f}" for x in off)
        whole = np.sqrt(np.square(off).mean())
        print(f"{arm:16s} {numbers} | {whole:.2f} mrad, {seconds:.0f} s", flush=True)
        if arm == "by_evidence":
            show_harmonics(fit, train)
        if arm in LAWS:
            compare_sides(fit, train)


if __name__ == "__main__":
    call(main)
