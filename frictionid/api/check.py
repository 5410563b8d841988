"""frictionid.check: what data can and cannot tell, before any fit."""

from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import pandas as pd

import frictionid.check.verdict as checks
from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.pictures import drawn
from frictionid.progress import Done, counted, say_nothing
from frictionid.quickstart import quick as first
from frictionid.quickstart.plan import plan_for
from frictionid.quickstart.quick_report import Quick
from frictionid.report.diagnostics import PICTURES, as_json, show_verdict
from frictionid.report.terminal import Shown

from .models import DatasetLike, count, dataset_of

_NONE = (float("nan"),) * 2


@dataclass(frozen=True, eq=False, repr=False)
class Verdict(Shown):
    """Verdict on a data set, as frames; `details` has all of it."""

    details: checks.Verdict

    def show(self) -> None:
        show_verdict(self.details)

    @property
    def level(self) -> str:
        """Level of the worst finding: "good", "doubtful" or "unusable"."""
        return self.details.level

    @property
    def findings(self) -> pd.DataFrame:
        """What is wrong, or worth knowing, the worst first.

        Columns: level, kind, text, remedy, joint (from 1, None for none), numbers.
        """
        columns = "level kind text remedy joint numbers".split()
        rows = map(vars, self.details.findings)
        return pd.DataFrame(rows, columns=columns).astype({"joint": object})

    @property
    def questions(self) -> pd.DataFrame:
        """The classic questions: passed (None where it was not tested), question, words."""
        columns = ["passed", "question", "words"]
        rows = [q._asdict() for q in self.details.questions]
        return pd.DataFrame(rows, columns=columns, dtype=object)

    @property
    def identifiable(self) -> pd.DataFrame:
        """What the recordings identify: what, possible, reason."""
        rows = [tuple(entry) for entry in self.details.identifiable]
        return pd.DataFrame(rows, columns=["what", "possible", "reason"])

    @property
    def joints(self) -> pd.DataFrame:
        """Facts of each joint, SI units; see `frictionid.check.facts.JointFacts`."""
        return pd.DataFrame([asdict(joint) for joint in self.details.joints]).set_index("joint")

    @property
    def torque_speed(self) -> pd.DataFrame:
        """Torque-speed envelope of each motor whose torque is measured, by the number of its joint.

        Columns: peak [N m], knee, no_load [rad/s] with half the widths of their 95 % intervals
        (peak_half and so on), NaN for what the data do not reach; torque, at, speed, by: the
        largest torque and the speed there, the largest speed and the torque there.
        """
        columns = [f"{name}{end}" for name in ("peak", "knee", "no_load") for end in ("", "_half")]
        rows = {
            e.joint: [*(x for part in (e.peak, e.knee, e.no_load) for x in part or _NONE), *e[4:]]
            for e in self.details.envelopes
        }
        return pd.DataFrame.from_dict(
            rows, orient="index", columns=[*columns, "torque", "at", "speed", "by"]
        )

    @property
    def next(self) -> tuple[str, ...]:
        """Recordings to make next."""
        return self.details.next

    def plot(self, kind: str = "residual") -> Any:
        """A Matplotlib figure.

        Parameters
        ----------
        kind : str
            "residual", the torque that the nominal mechanism leaves to friction, over velocity;
            "coverage", where the joints have been; "motion", over time.

        Raises
        ------
        InputError
            For unknown kinds.
        """
        if kind not in PICTURES:
            raise InputError(f"plot: kind = {kind!r} is unknown; {nearest(kind, PICTURES)}")
        return drawn(partial(PICTURES[kind], self.details))

    def json(self) -> str:
        """All of the verdict as JSON text, SI units."""
        return as_json(self.details)


def check(data: DatasetLike) -> Verdict:
    """Report errors in recordings, what the recordings identify, and what to record next.

    Parameters
    ----------
    data : Dataset, or path or name of one

    Returns
    -------
    Verdict
        It prints itself, at the prompt and in a notebook.

    Raises
    ------
    InputError
        Where the data do not fit their mechanism.
    """
    return Verdict(checks.check(dataset_of(data)))


def quick(data: DatasetLike, done: Done = say_nothing, *, jobs: int = 1) -> Quick:
    """Check a data set, compare a few friction laws on held-out motion, and say which one holds.

    They are fitted as `frictionid.fit` fits them: by shooting, or to the torques of an arm.

    Parameters
    ----------
    data : data set, or its folder or file
    done : function, optional
        Called with the name of each step that is finished.
    jobs : int
        Number of laws that are fitted side by side; 0: one for each core.

    Raises
    ------
    InputError
        Where the recordings are too short to hold any motion out.
    """
    dataset, jobs = dataset_of(data), count("jobs", jobs)
    with counted(len(plan_for(dataset).steps), "first verdict", done) as step:
        return first.quick(dataset, step, jobs=jobs)
