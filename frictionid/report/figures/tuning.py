"""The lowest score so far over the trials: a panel for each tuning task, a colour per sampler."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.search_space import Objective
from frictionid.comparison.tuning.studies import StudyResult
from frictionid.report.figures.panels import panel_grid
from frictionid.report.figures.style import COLOURS, key_above, line, plain

COLUMNS = 3


def progress(studies: Sequence[StudyResult], objective: Objective) -> Any:
    """The picture of all studies: on all data thick, in each training fold thin."""
    tasks = [list(own) for _, own in groupby(studies, key=lambda study: study.task.title)]
    picture, axes = panel_grid(len(tasks), COLUMNS, 1.9, 0.6)
    samplers = list(dict.fromkeys(study.sampler for study in studies))
    colours = dict(zip(samplers, COLOURS, strict=False))
    thick = {"linewidth": 1.5, "alpha": 1.0, "zorder": 3}
    thin = {"linewidth": 0.5, "alpha": 0.4, "zorder": 2}
    for axis, own in zip(axes, tasks, strict=True):
        for study in own:
            trials = np.arange(1, len(study.trials) + 1)
            style = thick if study.fold is None else thin
            axis.step(trials, _lowest(study), where="post", color=colours[study.sampler], **style)
        axis.set_title(plain(own[0].task.title), fontsize=7, loc="left")
        axis.locator_params(axis="x", integer=True, nbins=6)
    unit = "rad" if objective.horizon is not None else "rad/s"
    picture.supxlabel("trials", fontsize=8)
    picture.supylabel(f"{objective.words} [{unit}]", fontsize=7)
    key_above(picture, {name: line(colour) for name, colour in colours.items()})
    return picture


def _lowest(study: StudyResult) -> Array:
    values = np.array([trial.value for trial in study.trials])
    return np.minimum.accumulate(np.where(np.isnan(values), np.inf, values))
