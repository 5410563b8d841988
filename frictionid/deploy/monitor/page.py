"""The judgement of a monitor as text, frame and page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.deploy.monitor.baseline import Arrival, Baseline
from frictionid.deploy.monitor.changes import Changes, curve_changes
from frictionid.deploy.monitor.judgement import Judgement
from frictionid.files import json_text
from frictionid.outputs import replace_files
from frictionid.report.figures.style import (
    COLOURS,
    GREY,
    PALE,
    drawing,
    figure,
    key_above,
    marker,
    patch,
    plain,
    rendered,
)
from frictionid.report.figures.style import (
    line as curve,
)
from frictionid.report.numbers import short
from frictionid.report.tables import Column, Table, line, render_page, terminal_text, text_columns

PAGE, DOCUMENT, FRAME = "index.html", "monitoring.json", "changes.csv"


def sentence_of(baseline: Baseline, judgement: Judgement) -> str:
    """The judgement in one sentence."""
    j = judgement
    if j.answer == "cannot_tell":
        return f"These recordings cannot tell at a rate of false alarms of {j.rate:g}."
    if j.answer == "unchanged":
        return f"Friction has not changed (p = {j.p:.2g}, alarm at {j.rate:g})."
    joints = ", ".join(baseline.joints[k] for k in j.joints)
    return f"Friction has changed: {joints} (p = {j.p:.2g}, alarm at {j.rate:g})."


def judgement_frame(baseline: Baseline, judgement: Judgement) -> pd.DataFrame:
    """Change of each part of each joint's friction with its 95 % interval.

    Columns: joint, part, change, low_95, high_95 [N m, or N], per_cent, p, changed.
    """
    j = judgement
    rows = [
        {
            "joint": baseline.joints[part.joint],
            "part": part.part,
            "change": part.value,
            "low_95": part.low,
            "high_95": part.high,
            "per_cent": part.per_cent,
            "p": float(j.p_of_joint[part.joint]),
            "changed": part.joint in j.joints,
        }
        for part in j.parts
    ]
    return pd.DataFrame(rows)


def judgement_table(baseline: Baseline, judgement: Judgement) -> Table:
    """Changes of all joints, for people."""
    columns = [
        *text_columns("joint", "part"),
        *(Column(name) for name in ("change", "95 % interval", "per cent", "p")),
    ]
    lines = []
    for part in judgement.parts:
        interval = f"[{short(part.low, 3)}, {short(part.high, 3)}]"
        p = f"{judgement.p_of_joint[part.joint]:.2g}" if part.part == "total" else ""
        numbers = (short(part.value, 3), interval, f"{part.per_cent:+.1f}", p)
        lines.append(line([baseline.joints[part.joint], part.part, *numbers], str(part.joint)))
    caption = (
        "Change of friction at each joint's usual speed [N m, or N], against the mean of the "
        "healthy recordings; total: Coulomb and viscous. Intervals from the scatter between "
        "recordings."
    )
    return Table(caption, "monitoring", tuple(columns), tuple(lines))


def judgement_text(
    baseline: Baseline, judgement: Judgement, names: Sequence[str], arrivals: Sequence[Arrival] = ()
) -> str:
    """All that a terminal shows."""
    about = f"{len(names)} new recordings against {len(baseline.names)} healthy ones"
    lines = [
        sentence_of(baseline, judgement),
        f"{about}; {rate_text(judgement)}",
        terminal_text(judgement_table(baseline, judgement)),
        *judgement.notes,
    ]
    if arrivals:
        lines.append(evidence_text(judgement, arrivals))
    return "\n".join(lines)


def rate_text(judgement: Judgement) -> str:
    """How the rate of false alarms follows."""
    if judgement.test == "normal":
        return "rate by Hotelling's test, which assumes a normal distribution"
    least = f"least possible {judgement.promised:.2g}"
    return f"rate by permutation, which assumes nothing of the scatter; {least}"


def evidence_text(judgement: Judgement, arrivals: Sequence[Arrival]) -> str:
    """What the sequence of arrivals says."""
    log = np.array([arrival.log_evidence for arrival in arrivals])
    limit = np.log(1.0 / judgement.rate)
    over = np.flatnonzero(log >= limit)
    now = f"evidence after {len(arrivals)} arrivals: {np.exp(min(log[-1], 700.0)):.3g}"
    if not len(over):
        return f"{now}, alarm at {1.0 / judgement.rate:g}"
    return f"{now}; alarm at {1.0 / judgement.rate:g} since {arrivals[int(over[0])].name}"


def judgement_document(
    baseline: Baseline, judgement: Judgement, names: Sequence[str], arrivals: Sequence[Arrival] = ()
) -> dict[str, Any]:
    """All numbers, for scripts."""
    frame = judgement_frame(baseline, judgement)
    return {
        "answer": judgement.answer,
        "joints": [baseline.joints[k] for k in judgement.joints],
        "rate": judgement.rate,
        "least_rate": judgement.promised,
        "test": judgement.test,
        "p": judgement.p,
        "p_of_joint": dict(zip(baseline.joints, judgement.p_of_joint.tolist(), strict=True)),
        "changes": frame.to_dict("records"),
        "notes": judgement.notes,
        "recordings": names,
        "healthy": baseline.names,
        "log_evidence": {arrival.name: arrival.log_evidence for arrival in arrivals},
    }


def write_monitoring(
    folder: Path,
    baseline: Baseline,
    judgement: Judgement,
    names: Sequence[str],
    arrivals: Sequence[Arrival],
    picture: Any,
    *,
    replace: bool = False,
) -> Path:
    """Path of the page written, with its numbers and its picture beside it.

    picture : function that draws the drift
    """
    with drawing():
        kinds = rendered(picture(), ("svg", "pdf"))
    image = "data:image/svg+xml;base64," + base64.b64encode(kinds["svg"]).decode()
    context = {
        "sentence": sentence_of(baseline, judgement),
        "judgement": judgement,
        "about": f"{len(names)} new recordings against {len(baseline.names)} healthy ones",
        "rate": rate_text(judgement),
        "evidence": evidence_text(judgement, arrivals) if arrivals else "",
        "table": judgement_table(baseline, judgement),
        "image": image,
        "names": names,
    }
    contents = {
        PAGE: render_page("monitoring.html.j2", context).encode(),
        DOCUMENT: json_text(judgement_document(baseline, judgement, names, arrivals)).encode(),
        FRAME: judgement_frame(baseline, judgement).to_csv(index=False).encode(),
        **{f"figures/drift.{kind}": content for kind, content in kinds.items()},
    }
    replace_files(folder, contents, replace=replace)
    return folder / PAGE


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
        "mean": curve(GREY, linewidth=0.8),
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
