"""What new recordings say: what has changed, by how much, or why they cannot tell.

New recordings are compared with healthy ones in all that may have changed at once, see
`effects_of`; what explains the difference is named, see `explained`. Recordings that move faster or
more abruptly than any healthy one are not judged: friction there was never seen.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array, picked
from frictionid.friction.provenance import Segment

from .baseline import Baseline
from .changes import Changes, in_proportion
from .effects import FRICTION, MOMENTS, PARTS, PAYLOAD, beyond, causes_of, sentence, total_weights
from .explanation import CauseTests, Explanation, cause_tests, difference_of, explained

Answer = Literal["changed", "unchanged", "other", "cannot_tell"]
_BLIND = 1.0  # of the usual friction: a change that is not seen below this is not seen at all
_MATTERS = (
    0.1  # of the usual friction: a change that is none beyond chance, and yet no sign of none
)
_NO_GAIN = 0.5  # of the torque: more is no change of a sensor
_TORN = 0.2  # of the time: what disturbs more is no push
_CLOCK = "another time scale, which no torque tells apart"
_LOOSE = "backlash, contact or a loose part may be behind what is named"
_SHOWN = 3  # sentences of a kind
_COLUMNS = "joint part change low_95 high_95 per_cent".split()


class Judgement(NamedTuple):
    """What new recordings say.

    answer : "changed" where friction is among what changed, "unchanged", "other" where something
        else changed, "cannot_tell"
    rate : of false alarms; p : probability of a difference like this if nothing has changed
    p_of_joint : (n,) the same of each joint's friction, beside all that changed
    joints : those whose friction changed, from 0
    changed : names of the causes that changed; causes : sentences on them, with sizes
    parts : frame of the change of each part of each joint's friction with its 95 % interval [N m]
        Columns: joint (from 0); part: "coulomb", "viscous", "stribeck", "asymmetry", or "total";
        change, low_95, high_95; per_cent: of the reference friction at the usual speed.
    notes : sentences on what limits the judgement, or prevents it
    payload : (D,) change of the payload's effects that is surely not zero, where that explains
    """

    answer: Answer
    rate: float
    p: float
    p_of_joint: Array
    joints: tuple[int, ...]
    changed: tuple[str, ...]
    causes: tuple[str, ...]
    parts: pd.DataFrame
    notes: tuple[str, ...]
    payload: Array


def judge(
    baseline: Baseline,
    new: Changes,
    rate: float = 0.01,
    disturbed: Sequence[Segment] = (),
    seconds: float = np.inf,
) -> Judgement:
    """Judgement on new recordings (k) against the healthy ones (N) of a baseline.

    disturbed : stretches of the new recordings, of so many seconds, that were left out
    """
    n, size = len(baseline.joints), np.array([e.size for e in baseline.reference.effects])
    side = beyond(baseline.changes.motion, new.motion)
    fits = np.asarray(~side.any(axis=(1, 2)))
    notes = list(_notes(baseline, new, side, disturbed))
    if 2 * fits.sum() < len(fits):
        nothing = np.full(n, np.nan)
        parts = pd.DataFrame(columns=_COLUMNS)
        return Judgement(
            "cannot_tell", rate, np.nan, nothing, (), (), (), parts, tuple(notes), 0.0 * size
        )
    difference = difference_of(baseline.changes, picked(new, fits), size)
    likely = {
        f"{FRICTION}{name}": row
        for name, row in zip(baseline.joints, in_proportion(baseline.reference), strict=True)
        if row.any()
    }
    tests = cause_tests(difference, causes_of(baseline.reference.effects), likely)
    explanation = explained(tests, rate)
    ways = explanation.ways
    single = [group[0] for group in explanation.groups if all(group[0] in way for way in ways)]
    joints = tuple(j for j, name in enumerate(baseline.joints) if f"{FRICTION}{name}" in single)
    parts = pd.DataFrame(_parts(baseline, tests, ways), columns=_COLUMNS)
    totals = parts[parts.part == "total"]
    is_blind = (totals.high_95 - totals.low_95) / 2 > _BLIND * baseline.level
    blind = [baseline.joints[j] for j in totals.joint[is_blind]]
    if blind:
        notes.append(
            f"{', '.join(blind)}: changes smaller than the friction itself would not be seen: "
            "record more of its motion"
        )
    answer = _answer(explanation, joints, every_blind=len(blind) == n)
    if answer == "unchanged" and (maybe := _maybe_changed(baseline, totals)):
        answer = "cannot_tell"
        notes.append(f"friction may have changed, of {', '.join(maybe)}: record more")
    lost = sum(s.end - s.begin for s in disturbed) / seconds
    if lost > _TORN:
        answer = "cannot_tell"
        notes.append(f"{100.0 * lost:.0f} % of the time is disturbed: {_LOOSE}")
    if impossible := list(_impossible(baseline, tests, single, ways)):
        answer, notes = "cannot_tell", [*notes, *impossible]
    return Judgement(
        answer,
        rate,
        explanation.p,
        np.array([explanation.p_of_cause[f"{FRICTION}{name}"] for name in baseline.joints]),
        joints,
        tuple(single),
        tuple(_causes(baseline, tests, explanation)),
        parts,
        tuple(notes),
        _payload(tests, explanation),
    )


def _maybe_changed(baseline: Baseline, totals: pd.DataFrame) -> list[str]:
    """Joints and changes that chance may explain, and that are yet no sign of no change."""
    matters = totals.change.abs() > _MATTERS * baseline.level
    maybe = totals[matters & (totals.low_95 * totals.high_95 > 0)]
    rows = zip(maybe.joint.tolist(), maybe.per_cent, strict=True)
    return [f"{baseline.joints[joint]} by {change:+.0f} %" for joint, change in rows]


def _payload(tests: CauseTests, explanation: Explanation) -> Array:
    """Change (D,) of a payload where one explains, beside other causes; zero where it may be."""
    out = np.zeros(len(tests.pull))
    columns = tests.causes.get(PAYLOAD, np.empty(0, dtype=int))
    for way in explanation.ways:
        if PAYLOAD in way:
            value, low, high = _interval(tests, [PAYLOAD, *way], np.eye(len(columns))).T
            out[columns] = np.where(low * high > 0, value, 0.0)
            break
    return out


def _impossible(
    baseline: Baseline, tests: CauseTests, single: Sequence[str], ways: Sequence[Sequence[str]]
) -> Iterator[str]:
    """Sentences on changes that there cannot be: something else is behind the difference."""
    for cause in single:
        effects = [baseline.reference.effects[i] for i in tests.causes[cause]]
        intervals = _intervals(tests, cause, ways, np.eye(len(effects))).tolist()
        for effect, (value, _, high) in zip(effects, intervals, strict=True):
            if effect.name == "gain" and abs(value) > _NO_GAIN:
                yield f"{cause} is {100 * value:+.3g} %: check the torque's unit"
            elif cause == PAYLOAD and effect.name not in MOMENTS and high < -1.0:
                yield f"{effect.name} would change by {100 * value:.3g} %: no mass is negative"


def _answer(explanation: Explanation, joints: Sequence[int], *, every_blind: bool) -> Answer:
    if joints:
        return "changed"
    if any(name.startswith(FRICTION) for way in explanation.ways for name in way):
        return "cannot_tell"
    if explanation.groups:
        return "other"
    return "cannot_tell" if every_blind else "unchanged"


def _intervals(tests: CauseTests, cause: str, ways: Sequence[Sequence[str]], rows: Array) -> Array:
    """Value, low and high (k, 3) of sums of a cause's numbers, rows (k, c), at 95 %.

    The value beside what is likeliest to have changed, the interval over all that may have.
    """
    each = np.stack([_interval(tests, [cause, *way], rows) for way in ways])
    return np.stack([each[0, :, 0], each[..., 1].min(axis=0), each[..., 2].max(axis=0)], axis=-1)


def _interval(tests: CauseTests, causes: Sequence[str], rows: Array) -> Array:
    """Value, low and high (k, 3) of sums of the first cause's numbers, rows (k, c), at 95 %.

    All causes are estimated beside each other; their covariance is as they scatter.
    """
    causes = list(dict.fromkeys(causes))
    columns = np.concatenate([tests.causes[c] for c in causes])
    covariance = np.linalg.inv(tests.inverse[np.ix_(columns, columns)])
    count = rows.shape[1]
    value = rows @ (covariance @ tests.pull[columns])[:count]
    variance = np.einsum("kp,pq,kq->k", rows, covariance[:count, :count], rows)
    scale = max(tests.scale[c][0] for c in causes)
    half = stdtrit(tests.freedom, 0.975) * np.sqrt(scale * variance)
    return np.stack([value, value - half, value + half], axis=-1)


def _parts(
    baseline: Baseline, tests: CauseTests, ways: Sequence[Sequence[str]]
) -> Iterator[tuple[int, str, float, float, float, float]]:
    """Change of each part of each joint beside all that changed, with its interval."""
    total = total_weights(baseline.reference.speeds)
    for j, name in enumerate(baseline.joints):
        rows = np.vstack([np.eye(len(PARTS)), total[j]])
        intervals = _intervals(tests, f"{FRICTION}{name}", ways, rows)
        for part, (value, low, high) in zip((*PARTS, "total"), intervals.tolist(), strict=True):
            per_cent = 100.0 * value / float(baseline.level[j])
            yield j, part, value, low, high, per_cent


def _causes(baseline: Baseline, tests: CauseTests, explanation: Explanation) -> Iterator[str]:
    """Sentences on what changed: each cause with its size, or what it cannot be separated from."""
    passive = all(effect.name != "gain" for effect in baseline.reference.effects)
    for cause, *rivals in explanation.groups:
        hidden = [f"{b} with {c}" for a, b, c in explanation.hidden if a == cause]
        hidden += [_CLOCK] if passive and cause == PAYLOAD else []
        rivals += hidden if explanation.doubt else []
        if rivals:
            yield f"cannot separate {cause} from {' and '.join(rivals)}"
        else:
            sizes = ", ".join(_sizes(baseline, tests, cause, explanation.ways))
            yield " or ".join([f"{cause}: {sizes}", *hidden])


def _sizes(
    baseline: Baseline, tests: CauseTests, cause: str, ways: Sequence[Sequence[str]]
) -> Iterator[str]:
    """The sizes of a cause beside the others, with 95 % intervals.

    Of friction those of the total and the parts that are not zero, over it at the usual speed.
    """
    names = [baseline.reference.effects[i] for i in tests.causes[cause]]
    rows, is_friction = np.eye(len(names)), cause.startswith(FRICTION)
    if is_friction:
        j = baseline.joints.index(cause.removeprefix(FRICTION))
        total = total_weights(baseline.reference.speeds)[j]
        rows = np.vstack([total, rows]) / baseline.level[j]
        names = [names[0]._replace(name=part, unit="1") for part in ("total", *PARTS)]
    intervals = _intervals(tests, cause, ways, rows)
    for effect, numbers in zip(names, intervals, strict=True):
        if is_friction and numbers[1] <= 0 <= numbers[2]:
            continue
        if effect.name in MOMENTS:  # where a payload sits
            continue
        factor, unit = {"1": (100.0, "%"), "s": (1e3, "ms")}.get(effect.unit, (1.0, effect.unit))
        value, low, high = factor * numbers
        name = f"{effect.name} " if len(names) > 1 else ""
        yield f"{name}{value:+.3g} {unit} (95 %: {low:.3g} to {high:.3g})"


def _notes(
    baseline: Baseline, new: Changes, side: Array, disturbed: Sequence[Segment]
) -> Iterator[str]:
    """What limits the judgement."""
    off = np.flatnonzero(side.any(axis=(1, 2)))
    if len(off):
        worst = side[off].any(axis=0).astype(int)
        how = sentence(worst, baseline.joints)
        if 2 * len(off) > len(side):
            yield (
                f"cannot judge: the new recordings are {how} than any healthy one: move as those, "
                "or make a baseline with healthy recordings that move like this"
            )
        else:
            count = f"{len(off)} of {len(side)} new recordings"
            yield f"{count} are {how} than any healthy one: left out"
    for s in disturbed[:_SHOWN]:
        yield (
            f"disturbed, not friction: {s.recording} from {s.begin:.2f} to {s.end:.2f} s, left out"
        )
    if len(disturbed) > _SHOWN:
        yield f"and {len(disturbed) - _SHOWN} more disturbed stretches"
    for i, name in enumerate(baseline.covariates):
        low, high = (f(baseline.changes.covariates[:, i]) for f in (np.min, np.max))
        mean = float(new.covariates[:, i].mean())
        beside = f"= {mean:.4g} lies outside the baseline's {low:.4g} to {high:.4g}"
        if np.isnan(mean):
            beside = "is not said of all new recordings"
        if not np.isclose(mean, np.clip(mean, low, high)):
            yield f"{name} {beside}: a change of friction may be its effect"
