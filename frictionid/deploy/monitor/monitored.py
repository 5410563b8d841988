"""What new recordings say of a machine's friction: as text, frame, picture and page."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array, evenly, joined
from frictionid.files import json_text
from frictionid.outputs import replace_files
from frictionid.report.figures import style
from frictionid.report.numbers import short
from frictionid.report.tables import Table, line, render_page, table_of, terminal_text, text_columns

from .baseline import Arrival, Baseline
from .changes import Changes, with_others_held
from .effects import causes_of, total_weights
from .judgement import Judgement

PAGE, DOCUMENT, FRAME = "index.html", "monitoring.json", "changes.csv"
_HEIGHT = 1.25  # [inch] of a panel
_MOST = 400  # healthy recordings that are drawn
_CAPTION = (
    "Change of friction at each joint's usual speed [N m, or N], against the mean of the "
    "healthy recordings, beside all else that changed; total: all but the asymmetry. Intervals "
    "from the scatter between recordings and the noise of each."
)


@dataclass(frozen=True, eq=False, repr=False)
class Monitored:
    """What new recordings say of a machine's friction, compared with its baseline.

    Attributes
    ----------
    baseline : Baseline
    judgement : Judgement
        Of all new recordings together.
    names : of the new recordings
    changes : of the new recordings
    arrivals : tuple of Arrival
        All recordings of the state, with the evidence after each; () without a state.
    """

    baseline: Baseline
    judgement: Judgement
    names: tuple[str, ...]
    changes: Changes
    arrivals: tuple[Arrival, ...] = ()

    def __repr__(self) -> str:
        text = [self.sentence, self.about, terminal_text(self.table)]
        text += self.judgement.notes
        return "\n".join([*text, self.evidence] if self.arrivals else text)

    @property
    def answer(self) -> str:
        """Answer "changed", "unchanged", "other" or "cannot_tell", see `Judgement`."""
        return self.judgement.answer

    @property
    def frame(self) -> pd.DataFrame:
        """Change of each part of each joint's friction with its 95 % interval.

        Columns: joint, part, change, low_95, high_95 [N m, or N], per_cent, p, changed.
        """
        joint = self.judgement.parts.joint
        return self.judgement.parts.assign(
            joint=np.array(self.baseline.joints, dtype=object)[joint.astype(int)],
            p=self.judgement.p_of_joint[joint.astype(int)],
            changed=joint.isin(self.judgement.joints),
        )

    def plot(self) -> Any:
        """A Matplotlib figure: change of each joint's friction over the recordings."""
        return style.drawn(lambda: _drift(self))

    @property
    def sentence(self) -> str:
        """The judgement in one sentence."""
        j = self.judgement
        causes = f"; {'; '.join(j.causes)}" if j.causes else ""
        if np.isnan(j.p):
            return "These recordings cannot tell whether friction has changed: they are not judged."
        p = j.p if j.answer == "cannot_tell" else j.p_of_joint.min()
        odds = f"(p = {p:.2g}, alarm at {j.rate:g})"
        if j.answer == "cannot_tell":
            return f"These recordings cannot tell whether friction has changed {odds}{causes}."
        if j.answer == "changed":
            joints = ", ".join(self.baseline.joints[k] for k in j.joints)
            return f"Friction has changed: {joints} {odds}{causes}."
        return f"Friction has not changed {odds}{', but' if causes else ''}{causes[1:]}."

    @property
    def about(self) -> str:
        """How many recordings are compared."""
        new, healthy = len(self.names), len(self.baseline.names)
        return f"{new} new recording{'s' * (new != 1)} against {healthy} healthy ones"

    @property
    def evidence(self) -> str:
        """What the sequence of arrivals says, "" without a state."""
        if not self.arrivals:
            return ""
        log, rate = np.array([x.log_evidence for x in self.arrivals]), self.judgement.rate
        now = f"evidence after {len(log)} arrivals: {np.exp(min(log[-1], 700.0)):.3g}"
        alarms = np.flatnonzero(log >= np.log(1.0 / rate))
        if not len(alarms):
            return f"{now}, alarm at {1.0 / rate:g}"
        return f"{now}; alarm at {1.0 / rate:g} since {self.arrivals[int(alarms[0])].name}"

    @property
    def table(self) -> Table:
        """Changes of all joints, for people."""
        heads = (*text_columns("joint", "part"), "change", "95 % interval", "per cent", "p")
        lines = []
        for joint, part, value, low, high, per_cent in self.judgement.parts.to_numpy():
            p = f"{self.judgement.p_of_joint[joint]:.2g}" if part == "total" else ""
            interval = f"[{short(low, 3)}, {short(high, 3)}]"
            numbers = (short(value, 3), interval, f"{per_cent:+.1f}", p)
            lines.append(line([self.baseline.joints[joint], part, *numbers], str(joint)))
        return table_of(heads, lines, _CAPTION, "monitoring")

    @property
    def document(self) -> dict[str, Any]:
        """All numbers, for scripts."""
        j, joints = self.judgement, self.baseline.joints
        return {
            "answer": j.answer,
            "joints": [joints[k] for k in j.joints],
            "rate": j.rate,
            "causes": j.causes,
            "p": j.p,
            "p_of_joint": dict(zip(joints, j.p_of_joint.tolist(), strict=True)),
            "changes": self.frame.to_dict("records"),
            "notes": j.notes,
            "recordings": self.names,
            "healthy": self.baseline.names,
            "log_evidence": {arrival.name: arrival.log_evidence for arrival in self.arrivals},
        }


def write_monitoring(folder: Path, monitored: Monitored, *, replace: bool) -> Path:
    """Path of the page written, with its numbers and its picture beside it."""
    with style.drawing():
        kinds = style.rendered(_drift(monitored), ("svg", "pdf"))
    image = "data:image/svg+xml;base64," + base64.b64encode(kinds["svg"]).decode()
    context = {"monitored": monitored, "image": image}
    contents = {
        PAGE: render_page("monitoring.html.j2", context).encode(),
        DOCUMENT: json_text(monitored.document).encode(),
        FRAME: monitored.frame.to_csv(index=False).encode(),
        **{f"figures/drift.{kind}": content for kind, content in kinds.items()},
    }
    replace_files(folder, contents, replace=replace)
    return folder / PAGE


def totals(changes: Changes, speeds: Array) -> Array:
    """Changes (R, n) of each joint's friction at its usual speed [N m]."""
    weights = total_weights(speeds)
    parts = changes.value[:, : weights.size].reshape(-1, *weights.shape)
    return (parts * weights).sum(axis=-1)


def _shares(baseline: Baseline, changes: Changes, changed: Sequence[str]) -> Array:
    """Change (R, n) [%] of each joint's friction at its usual speed, beside what changed."""
    causes, middle = causes_of(baseline.reference.effects), baseline.changes.value.mean(axis=0)
    columns = []
    for j, name in enumerate(baseline.joints):
        free = np.concatenate([causes[c] for c in (f"friction of {name}", *changed)])
        values = totals(with_others_held(changes, middle, free), baseline.reference.speeds)
        columns.append(100.0 * values[:, j] / baseline.level[j])
    return np.stack(columns, axis=-1)


def _drift(monitored: Monitored) -> Any:
    """Change [%] of each joint's friction beside what changed, covariates, and the evidence.

    Where recordings arrived one by one, all of them are drawn, else the new ones.
    """
    baseline, new, arrivals = monitored.baseline, monitored.changes, monitored.arrivals
    if arrivals:
        new = joined([a.changes for a in arrivals])
    healthy = baseline.changes
    shown = evenly(len(healthy.value), _MOST)
    old, now = np.arange(-len(shown), 0), np.arange(len(new.value))
    n = len(baseline.joints)
    rows = n + len(baseline.covariates) + bool(arrivals)
    picture = style.figure(0.5 + _HEIGHT * rows)
    axes = picture.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    before, after = (_shares(baseline, x, monitored.judgement.changed) for x in (healthy, new))
    middle, reach = before.mean(axis=0), 1.96 * before.std(axis=0, ddof=1)
    for j, (axis, name) in enumerate(zip(axes, baseline.joints, strict=False)):
        axis.axhspan(middle[j] - reach[j], middle[j] + reach[j], color=style.PALE, lw=0)
        axis.axhline(middle[j], color=style.GREY, lw=0.8)
        axis.plot(old, before[shown, j], "o", ms=2.5, color=style.GREY)
        axis.plot(now, after[:, j], "o", ms=3.5, color=style.COLOURS[1])
        axis.set_ylabel(f"{style.plain(name)}\nchange [%]")
    values = np.concatenate([healthy.covariates[shown], new.covariates])
    for axis, name, column in zip(axes[n:], baseline.covariates, values.T, strict=False):
        axis.plot([*old, *now], column, "o-", ms=2.5, lw=0.8, color=style.COLOURS[0])
        axis.set_ylabel(style.plain(name))
    if arrivals:
        log = np.array([arrival.log_evidence for arrival in arrivals]) / np.log(10.0)
        axes[-1].plot(now, log, "o-", ms=2.5, lw=0.8, color=style.COLOURS[1])
        axes[-1].axhline(2.0, color=style.GREY, lw=0.8, ls="--")
        axes[-1].set_ylabel("log10 evidence")
    axes[-1].set_xlabel("recording (healthy ones before 0)")
    for axis in axes:
        axis.axvline(-0.5, color=style.GREY, lw=0.6)
    key = {
        "healthy": style.marker(style.GREY, size=2.5),
        "95 % of healthy": style.patch(style.PALE),
        "mean": style.line(style.GREY, linewidth=0.8),
        "new": style.marker(style.COLOURS[1]),
    }
    style.key_above(picture, key)
    return picture
