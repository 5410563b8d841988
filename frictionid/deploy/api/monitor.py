"""Health monitoring: a baseline of healthy recordings, and whether new ones differ from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from frictionid.api.fit import fit
from frictionid.api.models import DatasetLike, dataset_of, friction_of
from frictionid.comparison.registry import LAWS
from frictionid.data.recordings import Dataset
from frictionid.deploy.monitor.baseline import (
    Baseline,
    check_same_machine,
    hashes_of,
    load_baseline,
    make_baseline,
    save_baseline,
)
from frictionid.deploy.monitor.changes import Changes, prepared_data, recording_changes
from frictionid.deploy.monitor.judgement import Judgement, judge
from frictionid.deploy.monitor.state import Arrival, arriving, load_state
from frictionid.deploy.report.drift import drift_figure
from frictionid.deploy.report.monitoring import judgement_frame, judgement_text
from frictionid.errors import InputError
from frictionid.report.figures.style import drawn


def baseline(
    data: DatasetLike,
    out: str | Path | None = None,
    *,
    law: Any = "stribeck",
    model: Any = None,
    only: Sequence[str] = (),
) -> Baseline:
    """Baseline of healthy recordings of a machine: how its friction scatters between them.

    Parameters
    ----------
    data : data set
    out : str or Path, optional
        JSON file to write.
    law : as of `frictionid.fit`
        Fitted in one step to all recordings; changes are measured against it.
    model : Fit, Friction or path of a model file, optional
        In place of that fit, with its calibration.
    only : list of str
        Names of the recordings to take; all.

    Raises
    ------
    InputError
        Where there are fewer than two recordings, or the fit fails.

    Examples
    --------
    >>> healthy = baseline("acrobot_clean", law="coulomb_viscous")
    >>> healthy.changes.parts.shape  # recordings, joints, parts of friction
    (25, 2, 4)
    """
    dataset = chosen_recordings(dataset_of(data), only)
    friction = fit(dataset, law).friction if model is None else friction_of(model)
    if friction.theta.ndim != 2 or friction.mechanism:
        raise InputError("the model of a baseline must hold one friction with physics")
    made = make_baseline(prepared_data(dataset), friction)
    if out is not None:
        settings = {"law": str(friction.law), "dataset": dataset.name, "data": dataset.hashes}
        save_baseline(made, Path(out), LAWS, settings)
    return made


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
        return judgement_text(self.baseline, self.judgement, self.names, self.arrivals)

    @property
    def answer(self) -> str:
        """Answer "changed", "unchanged" or "cannot_tell"."""
        return self.judgement.answer

    @property
    def frame(self) -> pd.DataFrame:
        """Change of each part of each joint's friction, with 95 % intervals [N m]."""
        return judgement_frame(self.baseline, self.judgement)

    def plot(self) -> Any:
        """A Matplotlib figure: change of each joint's friction over the recordings."""
        draw = partial(drift_figure, self.baseline, self.changes, self.arrivals)
        return drawn(draw)


def monitor(
    baseline: Baseline | str | Path,
    data: DatasetLike | Sequence[DatasetLike],
    *,
    rate: float = 0.01,
    test: Literal["permutation", "normal"] = "permutation",
    state: str | Path | None = None,
    only: Sequence[str] = (),
    done: Callable[[str], None] | None = None,
) -> Monitored:
    """Whether friction has changed since the recordings of a baseline.

    Parameters
    ----------
    baseline : Baseline, or path of its file
    data : data set, or list of data sets
        New recordings of the same machine.
    rate : float
        Of false alarms: how often healthy recordings may be called changed.
    test : "permutation" or "normal"
        Without an assumption on how recordings scatter, or with a normal distribution.
    state : str or Path, optional
        File in which arrived recordings and the evidence after each are kept.
    only : list of str
        Names of the recordings to take; all.
    done : function, optional
        Called with the name of each recording that is entered into the state.

    Raises
    ------
    InputError
        Where the baseline is another machine's, or was made by another version.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import frictionid as fid
    >>> data = fid.load_dataset("acrobot_clean")
    >>> old, new = (replace(data, recordings=part) for part in
    ...             (data.recordings[:20], data.recordings[20:]))
    >>> monitor(fid.baseline(old, law="coulomb_viscous"), new).answer
    'unchanged'
    """
    if not 0 < rate < 1:
        raise InputError(f"rate = {rate:g} must lie between 0 and 1")
    known = baseline if isinstance(baseline, Baseline) else load_baseline(Path(baseline), LAWS)
    given: Any = [data] if isinstance(data, str | Path | Dataset) else data
    sets = [dataset_of(own) for own in given]
    parts: list[Changes] = []
    names: list[str] = []
    digests: list[str] = []
    for one in sets:
        dataset = chosen_recordings(one, only)
        check_same_machine(known, dataset, dataset.name)
        parts.append(recording_changes(prepared_data(dataset), known.reference, known.covariates))
        names += [r.name for r in dataset.recordings]
        digests += hashes_of(dataset)
    new = Changes(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    arrivals: tuple[Arrival, ...] = ()
    if state is not None:
        for arrival in arriving(Path(state), known, tuple(names), tuple(digests), new):
            if done is not None:
                done(arrival.name)
        arrivals = tuple(load_state(Path(state), known))
    return Monitored(known, judge(known, new, rate, test), tuple(names), new, arrivals)


def chosen_recordings(dataset: Dataset, only: Sequence[str]) -> Dataset:
    """The data set with the recordings that are named; all where none is.

    Raises
    ------
    InputError
        For a name that it does not have.
    """
    if not only:
        return dataset
    return replace(dataset, recordings=tuple(dataset[name] for name in only))
