"""Two real arms by inverse dynamics: what each law leaves of the torque, friction with intervals.

    python comparisons/arms.py [tx40 | tiago]

The recordings are in FRICTIONID_DATA. Each model is fitted to the first 70 % of the motion and
judged on the last 30 %: the torque that it does not explain, by the momentum balance over single
samples along the smoothed motion, through a zero-phase low pass as the measured torque is, root of
the sums of squares over joints and time. The law is chosen by cross-validation within the first
70 %, over blocks of time with the same measure.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.signal import butter, sosfiltfilt
from script import call

import frictionid
from frictionid import load_dataset
from frictionid.data.plants import Calibration
from frictionid.fitting.fit import Fit
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, states_of
from frictionid.fitting.parameter_block import Estimate, ParameterBlock
from frictionid.fitting.parameters import BiasBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.torque_balance import (
    TorqueBalance,
    TorqueSettings,
    fit_torques,
    torque_balance,
)
from frictionid.fitting.torque_balance.solve import left_to_friction
from frictionid.friction import along
from frictionid.friction.laws import (
    CoulombViscous,
    LoadDependent,
    Stribeck,
)

DATA = Path(__file__).parent.parent / "data"
LAWS = {
    "Coulomb and viscous": CoulombViscous(),
    "by direction": CoulombViscous(symmetric=False),
    "Stribeck": Stribeck(),
    "load-dependent": LoadDependent(),
    "load-dependent, Stribeck": LoadDependent(stribeck=True),
}
BLOCKS = 5  # of the cross-validation
PRIOR = 0.3  # of the base parameters, relative to their size


class Arm(NamedTuple):
    """How an arm is judged.

    sample_time, window, node_time : [s], of states, of the fit's rows, between nodes in them
    until : [s], end of the first 70 %; cut : [Hz], of the low pass; every : [s], samples that count
    moving : base parameters that are free beside rotors where the URDF's bodies are kept
    others : what least squares by Coulomb and viscous friction leaves, with accelerations from
        differences, with the URDF's bodies and with free ones, by the same measure
    """

    sample_time: float | None
    window: float
    node_time: float
    until: float
    cut: float
    every: float
    moving: tuple[str, ...]
    others: tuple[float, float]


ARMS = {
    "tx40": Arm(
        *(0.001, 0.05, 0.004, 5.23, 20.0, 0.02), ("Izz_link_1", "Izz_link_2"), (0.0737, 0.0745)
    ),
    "tiago": Arm(
        *(None, 0.2, 0.02, 50.27, 8.0, 0.05), ("Izz_arm_1_link", "Izz_arm_2_link"), (0.1038, 0.1053)
    ),
}


class Balances(NamedTuple):
    """Rows to fit, rows of single samples to judge by, and the low pass."""

    rows: TorqueBalance
    samples: TorqueBalance
    low_pass: Any
    every: int


def balances(name: str) -> Balances:
    """Balances of torques of an arm's recording."""
    arm, dataset = ARMS[name], load_dataset(DATA / name)
    states = states_of(dataset, INTEGRAL.states, arm.sample_time)
    dt = float(np.median(np.diff(states[0].time)))
    samples = torque_balance(dataset, states, dt, dt)
    low_pass = butter(4, arm.cut, fs=1.0 / dt, output="sos")
    rows = torque_balance(dataset, states, arm.window, arm.node_time)
    return Balances(rows, samples, low_pass, max(1, round(arm.every / dt)))


def left(data: Balances, fit: Fit | frictionid.Fit) -> tuple[Any, Any, Any]:
    """Torques (K, n) [N m] that a fit leaves, measured ones, and their times, low-passed."""
    balance, mechanism = data.samples, data.samples.dataset.mechanism
    friction = balance.problem.mean(along(fit.friction, balance.nodes)) @ mechanism.friction_map
    calibration = fit.calibration or Calibration.ideal(mechanism.n)
    if calibration.base is None:
        calibration = replace(calibration, base=mechanism.base(mechanism.nominal()))
    estimate = Estimate(fit.friction, calibration, mechanism)
    residual = left_to_friction(balance, estimate) - friction
    both = (residual, balance.logged(np.zeros(()))[0])
    e, u = (sosfiltfilt(data.low_pass, x, axis=0)[:: data.every] for x in both)
    return e, u, balance.start[:: data.every]


def share(e: Any, u: Any, rows: Any) -> float:
    """Root of the sums of squares over the joints, relative to the torque's."""
    return float(np.sqrt((e[rows] ** 2).sum() / (u[rows] ** 2).sum()))


def blocks(name: str, data: Balances) -> dict[str, tuple[ParameterBlock, ...]]:
    """What is free beside friction: rotors alone, or all base parameters with a prior."""
    names = data.rows.dataset.mechanism.base_names
    kept = tuple(n for n in names if not n.startswith("rotor") and n not in ARMS[name].moving)
    return {
        "URDF": (FrictionBlock(), InertiaBlock(fixed=kept), BiasBlock()),
        "base": (FrictionBlock(), InertiaBlock(prior=PRIOR), BiasBlock()),
    }


def cross_validated(data: Balances, law: Any, free: Any, until: float) -> float:
    """What is left of blocks of time within the first 70 % by fits to the others."""
    rows, first = data.rows, data.rows.start.min()
    edges = np.linspace(first, until, BLOCKS + 1)
    squares = np.zeros(2)
    for low, high in zip(edges, edges[1:], strict=False):
        use = (rows.stop <= until) & ((rows.stop <= low) | (rows.start >= high))
        fit = fit_torques(LeastSquares(law), rows, free, TorqueSettings(), use)
        e, u, time = left(data, fit)
        held = (time >= low) & (time < high)
        squares += (e[held] ** 2).sum(), (u[held] ** 2).sum()
    return float(np.sqrt(squares[0] / squares[1]))


def compare(name: str) -> tuple[Table, Fit]:
    """Table of laws, and the fit of the law that cross-validation chooses."""
    arm, data = ARMS[name], balances(name)
    table = Table("law", "inertias", "cross-validated", "held out", "by joint", title=name)
    best: tuple[float, Fit] | None = None
    for label, free in blocks(name, data).items():
        for law_name, law in LAWS.items():
            score = cross_validated(data, law, free, arm.until)
            use = data.rows.stop <= arm.until
            fit = fit_torques(LeastSquares(law), data.rows, free, TorqueSettings(), use)
            e, u, time = left(data, fit)
            held = time >= arm.until
            joints = np.sqrt((e[held] ** 2).mean(0) / (u[held] ** 2).mean(0))
            each = " ".join(f"{100 * x:.1f}" for x in joints)
            table.add_row(law_name, label, _percent(score), _percent(share(e, u, held)), each)
            if best is None or score < best[0]:
                best = (score, fit)
    for label, value in zip(("URDF", "base"), arm.others, strict=True):
        table.add_row("least squares of others", label, "", _percent(value), "")
    assert best is not None
    return table, best[1]


def friction_table(fit: Fit) -> Table:
    """Friction with its 95 % intervals."""
    table = Table("parameter", "value", "95 %", title=f"{fit.friction.law}")
    interval = fit.covariance.interval()
    for p, value, (low, high) in zip(
        fit.covariance.parameters, fit.covariance.values, interval, strict=True
    ):
        if p.block == "friction":
            table.add_row(f"{p.name} [{p.unit}]", f"{value:.3g}", f"{low:.3g} to {high:.3g}")
    return table


def _percent(value: float) -> str:
    return f"{100 * value:.2f} %"


def main(names: list[str] | None = None) -> None:
    """Compare laws on the arms, and print the friction that is chosen."""
    for name in names or list(ARMS):
        table, fit = compare(name)
        Console(width=110).print(table)
        Console(width=110).print(friction_table(fit))


if __name__ == "__main__":
    call(main)
