"""Motions to look at: from the same starts for all models, and from each model's own ones.

A model's own starts are those of its best, its median and its worst prediction of motion over the
longest horizon. They come with the band of the prediction and, where the mechanism draws itself,
lines.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.special import stdtrit

from frictionid.arrays import Array
from frictionid.data.joint_scales import joint_sizes, norm_of

from .initial_states import InitialStates
from .prepared import Prepared

PLACES = {"best": 0.0, "median": 0.5, "worst": 1.0}  # ranks among all predictions
FEWEST = 3  # folds that a band needs
_WAY = 0.1
FRAMES = 61  # drawings of a motion at most


def common_examples(
    q: Array, initial: InitialStates, prepared: Prepared, use: Array, most: int = 3
) -> Iterator[dict[str, Any]]:
    """Predicted and measured motion over the longest horizon, of rollouts (S,) that may be used.

    q : (T + 1, S, n), what is predicted from the initial states
    """
    full = np.flatnonzero(use)
    chosen = full[np.linspace(0, len(full) - 1, most + 2).round().astype(int)[1:-1]]
    for s in np.unique(chosen):
        yield example(q, initial, prepared, int(s))


def ranked_examples(
    q: Array,
    initial: InitialStates,
    prepared: Prepared,
    use: Array,
    band: Callable[[Array], Array] | None = None,
) -> Iterator[dict[str, Any]]:
    """The same from the best, the median and the worst start, with what is drawn of them.

    Of starts from which a joint moves, where there are so many: rest is predicted best.

    band : half the width (T + 1, k, n) of the band about the predictions from some starts (k,)
    """
    full, last = _moving(np.flatnonzero(use), initial, prepared), initial.last[-1]
    error = q[last[full], full] - initial.measured[last[full], full]
    units = prepared.position_units
    norm, unit = norm_of(error, units, joint_sizes(units, initial.measured))
    order = full[np.argsort(np.where(np.isfinite(norm), norm, np.inf), kind="stable")]
    rows = order[[round(rank * (len(order) - 1)) for rank in PLACES.values()]]
    widths = None if band is None else band(rows)
    for i, (place, s) in enumerate(zip(PLACES, rows, strict=True)):
        motion = example(q, initial, prepared, int(s))
        place_facts = {"place": place, "error": norm[full == s][0], "error_unit": unit}
        width = None if widths is None else widths[: last[s] + 1, i]
        yield {**motion, **place_facts, "band": width, **_drawing(prepared, motion)}


def _moving(full: Array, initial: InitialStates, prepared: Prepared) -> Array:
    """Starts (k,) from which a joint moves by a tenth of its size; all where few do."""
    measured = initial.measured[:, full]
    sizes = joint_sizes(prepared.position_units, initial.measured)
    way = np.nanmax(measured, axis=0) - np.nanmin(measured, axis=0)
    moving = full[(way > _WAY * sizes).any(axis=-1)]
    return moving if len(moving) >= len(PLACES) else full


def jackknife_width(values: Array) -> Array:
    """Half the width of 95 % intervals of numbers, from those (F, ...) without each fold.

    The delete-a-group jackknife [Shao1995] with Student's quantile of F - 1 degrees of freedom:

        se^2 = (F - 1)/F sum (x_f - mean)^2

    It is the interval of the mean, where each number is the mean of all values but a fold's own:

    >>> x = np.array([1.0, 2.0, 4.0])
    >>> mean_without = (x.sum() - x) / 2
    >>> bool(np.isclose(jackknife_width(mean_without), stdtrit(2, 0.975) * x.std(ddof=1) / 3**0.5))
    True
    """
    folds = len(values)
    with np.errstate(all="ignore"):
        scatter = ((values - values.mean(axis=0)) ** 2).sum(axis=0)
        return stdtrit(folds - 1, 0.975) * np.sqrt((folds - 1) / folds * scatter)


def example(q: Array, initial: InitialStates, prepared: Prepared, s: int) -> dict[str, Any]:
    """Predicted and measured motion of one rollout over the longest horizon that it reaches."""
    last, r = int(initial.last[-1, s]), int(initial.recording[s])
    return {
        "dataset": prepared.dataset.name,
        "recording": prepared.dataset.recordings[r].name,
        "start_s": float(prepared.causal[r].time[initial.index[s]]),
        "time": np.concatenate([[0.0], np.cumsum(initial.dt[:last, s])]),
        "measured": initial.measured[: last + 1, s],
        "predicted": q[: last + 1, s],
    }


def _drawing(prepared: Prepared, motion: dict[str, Any]) -> dict[str, Any]:
    """Lines of the mechanism (f, k, 2 or 3) at some of a motion's times; nothing without them."""
    time = motion["time"]
    frames = np.unique(np.linspace(0, len(time) - 1, FRAMES).round().astype(int))
    mechanism = prepared.dataset.mechanism
    measured, predicted = (
        mechanism.points(motion[name][frames]) for name in ("measured", "predicted")
    )
    if measured is None or predicted is None:
        return {}
    lines = {"measured": measured.round(5), "predicted": predicted.round(5)}
    return {"drawing": {"time": time[frames], **lines}}
