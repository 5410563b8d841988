"""Drift: change of each joint's friction over the recordings, healthy ones first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.monitor.baseline import Baseline
from frictionid.deploy.monitor.changes import Changes, curve_changes
from frictionid.deploy.monitor.state import Arrival
from frictionid.report.figures.style import (
    COLOURS,
    GREY,
    PALE,
    figure,
    key_above,
    line,
    marker,
    patch,
    plain,
)

_HEIGHT = 1.25  # [inch] of a panel
_USUAL = 1  # which of the speeds
_MOST = 400  # healthy recordings that are drawn


def drift_figure(baseline: Baseline, new: Changes, arrivals: Sequence[Arrival] = ()) -> Any:
    """Change [%] of each joint's friction at its usual speed, covariates, and the evidence.

    Where recordings arrived one by one, all of them are drawn, else the new ones.
    """
    if arrivals:
        new = Changes(*map(np.concatenate, zip(*(a.changes for a in arrivals), strict=True)))
    healthy = baseline.changes
    shown = np.unique(np.linspace(0, len(healthy.parts) - 1, _MOST).round().astype(int))
    at = np.arange(-len(shown), len(new.parts))
    rows = len(baseline.joints) + len(baseline.covariates) + bool(arrivals)
    picture = figure(0.5 + _HEIGHT * rows)
    axes = picture.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    speeds = baseline.reference.speeds
    before = 100.0 * _usual(healthy.parts, speeds) / baseline.level
    after = 100.0 * _usual(new.parts, speeds) / baseline.level
    middle, reach = before.mean(axis=0), 1.96 * before.std(axis=0, ddof=1)
    for j, axis in enumerate(axes[: len(baseline.joints)]):
        axis.axhspan(middle[j] - reach[j], middle[j] + reach[j], color=PALE, lw=0)
        axis.axhline(middle[j], color=GREY, lw=0.8)
        axis.plot(at[: len(shown)], before[shown, j], "o", ms=2.5, color=GREY)
        axis.plot(at[len(shown) :], after[:, j], "o", ms=3.5, color=COLOURS[1])
        axis.set_ylabel(f"{plain(baseline.joints[j])}\nchange [%]")
    own = axes[len(baseline.joints) :]
    for i, name in enumerate(baseline.covariates):
        values = np.concatenate([healthy.covariates[shown, i], new.covariates[:, i]])
        own[i].plot(at, values, "o-", ms=2.5, lw=0.8, color=COLOURS[0])
        own[i].set_ylabel(plain(name))
    if arrivals:
        _evidence(axes[-1], at[len(shown) :], arrivals)
    axes[-1].set_xlabel("recording (healthy ones before 0)")
    for axis in axes:
        axis.axvline(-0.5, color=GREY, lw=0.6)
    key = {
        "healthy": marker(GREY, size=2.5),
        "95 % of healthy": patch(PALE),
        "mean": line(GREY, linewidth=0.8),
        "new": marker(COLOURS[1]),
    }
    key_above(picture, key)
    return picture


def _usual(parts: Array, speeds: Array) -> Array:
    """Change (R, n) at the usual speed [N m]."""
    return curve_changes(parts, speeds)[..., _USUAL]


def _evidence(axis: Any, at: Array, arrivals: Sequence[Arrival]) -> None:
    log = np.array([arrival.log_evidence for arrival in arrivals])
    axis.plot(at, log / np.log(10.0), "o-", ms=2.5, lw=0.8, color=COLOURS[1])
    axis.axhline(2.0, color=GREY, lw=0.8, ls="--")
    axis.set_ylabel("log10 evidence")
