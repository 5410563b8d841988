"""The data put on trial against the told mechanism: conventions, then delay, then the mechanism.

Each step is judged with what the steps before found put right, so that one fault does not raise
suspicion of others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import FEWEST, Rows, unit_rows
from frictionid.check.conventions import Scored, better, mapped, scores
from frictionid.check.delay import Delay, delay_of
from frictionid.check.findings import Finding
from frictionid.check.misfit import misfit
from frictionid.check.model_errors import Suspect, freed, suspects, wrong
from frictionid.check.motion import Motion
from frictionid.check.torque_integral import Impulse
from frictionid.mechanics import Mechanism, Plant

# A torque is called late where its delay exceeds this many standard errors, this share of a sample
# and this time [s], and takes away this share of the sum of squares (healthy: at most 0.03).
ERRORS, SAMPLE, LEAST, EXPLAINS = 4.0, 0.35, 0.002, 0.1
# Later than this [s], no rollout can be compared with the recording.
HOPELESS = 0.1
# The told mechanism is called wrong where free base parameters leave less than this share.
FREED = 0.5
# More unexplained than this (log of the squared share) is no description of the data.
UNEXPLAINED = np.log(0.2)


@dataclass(frozen=True, eq=False)
class Trial:
    """Findings about conventions, delay and mechanism, and the data with all that put right.

    shift : [s] delay taken into account, 0 where none was found ; given : rows of the data as given
    """

    mechanism: Mechanism
    judged: bool
    findings: list[Finding]
    conventions: list[Scored]
    delay: Delay | None
    suspects: list[Suspect]
    motions: tuple[Motion, ...]
    impulse: Impulse
    rows: Rows
    given: Rows
    shift: float


def tried(plant: Plant, motions: Sequence[Motion], impulse: Impulse, judged: bool = True) -> Trial:
    """Trial of recordings against the told mechanism; `judged` false leaves them as they are.

    So do recordings in which no joint slides: nothing can be said of them.

    plant : one batch entry per recording
    """
    mechanism, told = plant.mechanism, np.asarray(plant.p)
    rows = given = unit_rows(mechanism, motions)
    if not judged or not (rows.free.sum(0) >= FEWEST).any():
        return Trial(mechanism, False, [], [], None, [], tuple(motions), impulse, rows, rows, 0.0)
    findings: list[Finding] = []
    scored = scores(mechanism, motions, impulse, told)
    delay = delay_of(rows, impulse, told)
    limit = min(scored[0].score, _delayed_score(rows, impulse, told, delay))
    wrong_ones = better(scored, limit)
    if wrong_ones:
        findings.append(_convention(wrong_ones, scored[0]))
        motions, impulse = mapped(motions, impulse, wrong_ones[0].convention)
        rows = unit_rows(mechanism, motions)
        delay = delay_of(rows, impulse, told)
    late = _late(delay, impulse)
    findings += late
    shift = delay.seconds if delay and late else 0.0
    torque = impulse.means(rows, shift)
    physical = {name: float(value[0]) for name, value in plant.parameters.items()}
    suspected = suspects(mechanism, physical, rows, torque, told)
    findings += _mechanism(mechanism, suspected, rows, torque, told)
    if not findings:
        findings += _unexplained(float(misfit(rows.at(told), torque).mean()))
    return Trial(
        mechanism,
        True,
        findings,
        scored,
        delay,
        suspected,
        tuple(motions),
        impulse,
        rows,
        given,
        shift,
    )


def _unexplained(score: float) -> list[Finding]:
    if score < UNEXPLAINED:
        return []
    return [
        Finding(
            "unexplained",
            "doubtful",
            f"{100 * np.exp(score / 2):.0f} % of the torque stays unexplained by what is told, "
            "with any friction, and none of the known mistakes explains it",
            "check that mechanism, columns and units belong to these recordings",
            None,
            {"score": score},
        )
    ]


def _delayed_score(rows: Rows, impulse: Impulse, told: Array, delay: Delay | None) -> float:
    if delay is None:
        return np.inf
    return float(misfit(rows.at(told), impulse.means(rows, delay.seconds)).mean())


def _convention(wrong_ones: list[Scored], given: Scored) -> Finding:
    first = wrong_ones[0].convention
    others = [s.convention.words for s in wrong_ones[1:] if s.convention.kind != "as_given"]
    also = f" (or, which looks the same: {'; '.join(others)})" if others else ""
    return Finding(
        first.kind,
        "unusable",
        f"{first.words}{also}: so read, the told mechanism leaves "
        f"{_percent(wrong_ones[0])} of the torque unexplained instead of {_percent(given)}",
        "correct the columns or units in dataset.toml or in the tables; checked on as if done",
        None,
        {"score": wrong_ones[0].score, "given": given.score},
    )


def _percent(scored: Scored) -> str:
    return f"{100 * np.exp(scored.score / 2):.2g} %"


def _late(delay: Delay | None, impulse: Impulse) -> list[Finding]:
    if delay is None:
        return []
    least = max(ERRORS * delay.error, SAMPLE * impulse.interval, LEAST)
    if abs(delay.seconds) < least or delay.gain < EXPLAINS:
        return []
    word = "after" if delay.seconds > 0 else "before"
    low, high = delay.interval
    return [
        Finding(
            "delay",
            "unusable" if abs(delay.seconds) > HOPELESS else "doubtful",
            f"the torque acts {1e3 * abs(delay.seconds):.1f} ms {word} it is logged "
            f"(95 %: {1e3 * low:.1f} to {1e3 * high:.1f} ms); unnoticed, that looks like viscous "
            "friction and like memory",
            "shift the torque's clock, or fit the delay (calibration parameters)",
            None,
            {"delay": delay.seconds, "error": delay.error, "explains": delay.gain},
        )
    ]


def _mechanism(
    mechanism: Mechanism, suspected: list[Suspect], rows: Rows, torque: Array, told: Array
) -> list[Finding]:
    named = wrong(suspected)
    if named:
        return [_suspect(named)]
    share = freed(rows, torque, told) if suspected else 1.0
    if share > FREED:
        return []
    return [
        Finding(
            "told_mechanism",
            "doubtful",
            f"the told mechanism does not fit: with its {len(mechanism.base_names)} base "
            f"parameters free, {100 * (1 - share):.0f} % of the remainder goes",
            "compare the estimates below with what is told, or let the fit find them",
            None,
            {"left": share},
        )
    ]


def _suspect(named: list[Suspect]) -> Finding:
    best = named[0]
    also = "; ".join(_words(s) for s in named[1:3])
    tail = f" (the data cannot tell it from: {also})" if also else ""
    remedy = {
        "gain": "check gear ratio, torque constant and units; or all masses and inertias are off "
        "by this factor",
        "rotor": "add it to [mechanism.parameters], or let the fit find it",
        "base": "correct [mechanism.parameters], or let the fit find it",
    }[best.kind]
    numbers = {"size": best.size, "error": best.error, "explains": 1 - best.left}
    return Finding(best.kind, "doubtful", f"{_words(best)}{tail}", remedy, None, numbers)


def _words(s: Suspect) -> str:
    if s.kind == "gain":
        return f"{s.words} is {s.size:.3f} +- {s.error:.3f}, not 1: wrong gear or torque constant"
    if s.kind == "rotor":
        return f"{s.words}: {s.size:.3g} +- {s.error:.1g} {s.unit} are felt on top of what is told"
    return f"{s.words} is {100 * s.share:+.0f} % from what is told"
