"""What the recordings identify, each with its precision, and what they do not, with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.facts import JointFacts
from frictionid.check.findings import percent
from frictionid.check.hypothesis_tests import UNUSABLE_DELAY, HypothesisTests
from frictionid.check.motion import sliding_speeds
from frictionid.check.regression import Estimate
from frictionid.check.rivals import RIVALS

# A number counts as identified where its standard error is below this share of it,
PRECISE = 0.3
# a torque gain below this one, and a delay below this one [s].
GAIN, DELAY = 0.05, 0.005
# Friction below this share of the balance's terms, and below so many of its residuals, may be what
# the mechanism gets wrong: accelerations do not show it.
TERMS, RESIDUALS = 0.05, 3.0


class Identifiable(NamedTuple):
    """Whether something can be identified, and why, or how well."""

    what: str
    possible: bool
    reason: str


def identifiable(
    tests: HypothesisTests, facts: Sequence[JointFacts], estimate: Estimate
) -> list[Identifiable]:
    """Friction of each joint, inertia combinations, gain and delay."""
    mechanism = tests.measured.mechanism
    terms = _terms(tests)
    out = [
        _friction(estimate, fact, unit, float(terms[fact.joint - 1]))
        if not (reason := _hidden(tests, fact.joint - 1))
        else Identifiable(f"friction of joint {fact.joint}", False, reason)
        for fact, unit in zip(facts, mechanism.velocity_units, strict=True)
    ]
    out += _parts(tests, estimate)
    out.append(_base(mechanism.base_names, estimate))
    return [*out, _gain(tests), _delay(tests)] if any(mechanism.driven) else out


def _hidden(tests: HypothesisTests, j: int) -> str:
    """Why the torque of a joint shows no friction, or ""."""
    if j in tests.measured.dead:
        return "its torque shows nothing"
    if tests.measured.dataset.torque_at == "link":
        return "a sensor at the link does not feel friction of motor and gear"
    return ""


def _terms(tests: HypothesisTests) -> Array:
    """Root mean square (n,) of the largest term of each joint's balance [N m]."""
    rows = tests.rows.at(tests.measured.nominal)
    each = (rows.inertia[..., 0], rows.gravity[..., 0], tests.rows.means(tests.measured.torque))
    squares = [np.where(rows.moving, x, 0.0) ** 2 for x in each]
    count = np.maximum(rows.moving.sum(0), 1)
    return np.asarray(np.sqrt(np.max([x.sum(0) / count for x in squares], axis=0)))


def _friction(estimate: Estimate, fact: JointFacts, unit: str, terms: float) -> Identifiable:
    what = f"friction of joint {fact.joint}"
    _, error = estimate.at(f"coulomb_{fact.joint}")
    if not np.isfinite(error):
        return Identifiable(what, False, "the joint hardly slides")
    total, share = _precision(estimate, str(fact.joint), fact.fast)
    spread = float(estimate.spread[fact.joint - 1])
    if total < TERMS * terms and total < RESIDUALS * spread:
        reason = (
            f"{percent(total / max(terms, 1e-300))} of the terms of its balance, of which "
            f"{percent(spread / max(terms, 1e-300))} stay unexplained: only energy over long "
            "motions shows it"
        )
        return Identifiable(what, False, reason)
    return _known(what, share, fact.fast, unit)


def _parts(tests: HypothesisTests, estimate: Estimate) -> list[Identifiable]:
    """Friction of the parts that turn with several joints."""
    mechanism = tests.measured.mechanism
    fast = sliding_speeds(mechanism, tests.measured.motions).fast[mechanism.n :]
    units = mechanism.friction_units[mechanism.n :]
    out = []
    for (name, _), speed, unit in zip(mechanism.coupled, fast, units, strict=True):
        what = f"friction of {name}"
        if not np.isfinite(estimate.at(f"coulomb_{name}")[1]):
            out.append(Identifiable(what, False, "it hardly slides"))
            continue
        share = _precision(estimate, name, float(speed))[1]
        out.append(_known(what, share, float(speed), f"{unit}/s"))
    return out


def _precision(estimate: Estimate, label: str, fast: float) -> tuple[float, float]:
    """Friction [N m] at a speed, and its standard error over it; label : end of its names."""
    at = [estimate.names.index(f"{name}_{label}") for name in ("coulomb", "viscous")]
    gradient = np.array([1.0, fast])
    total = float(np.abs(estimate.value[at]) @ gradient)
    deviation = float(np.sqrt(gradient @ estimate.covariance[np.ix_(at, at)] @ gradient))
    return total, deviation / max(total, 1e-300)


def _known(what: str, share: float, fast: float, unit: str) -> Identifiable:
    reason = f"known to {percent(share)} of its level at {fast:.2g} {unit}"
    return Identifiable(what, share < PRECISE, reason)


def _base(names: Sequence[str], estimate: Estimate) -> Identifiable:
    directions = [d for d in estimate.unidentifiable if any(name in names for name, _ in d)]
    reason = "; ".join(_direction(d) for d in directions[:3])
    kept = [name for name in names if not np.isfinite(estimate.at(name)[1])]
    if kept and len(kept) < len(names):
        ratios = f"ratios to {' and '.join(kept)} only, which no torque shows"
        reason = f"{reason}; {ratios}" if reason else ratios
    reason = reason or f"all {len(names)} base parameters"
    return Identifiable("inertia combinations", not directions, reason)


def _direction(direction: tuple[tuple[str, float], ...]) -> str:
    """Words for a direction that has no effect on the data.

    >>> _direction((("a", 0.8), ("b", -0.5)))
    'more a with less b changes nothing'
    >>> _direction((("a", 0.8),))
    'a has no effect'
    """
    if len(direction) == 1:
        return f"{direction[0][0]} has no effect"
    sign = np.sign(direction[0][1])
    more = " and ".join(name for name, share in direction if share * sign > 0)
    less = " and ".join(name for name, share in direction if share * sign < 0)
    return f"more {more}{f' with less {less}' if less else ''} changes nothing"


def _gain(tests: HypothesisTests) -> Identifiable:
    gains = [e for e in tests.model_errors if e.kind == "gain"]
    if not gains:
        return Identifiable("torque gain", False, "no torque acts")
    best = min(gains, key=lambda e: e.error)
    rivals = {f.kind for f in tests.findings} & RIVALS
    if rivals:
        other = "friction that grows with the torque" if "load" in rivals else "what is unexplained"
        reason = f"{best.size:.3f} +- {best.error:.3f}, but {other} may look the same"
        return Identifiable("torque gain", False, reason)
    reason = (
        f"{best.size:.3f} +- {best.error:.3f}, if the nominal mechanism is right: a gain and a "
        "common factor of all masses look the same"
    )
    return Identifiable("torque gain", best.error < GAIN, reason)


def _delay(tests: HypothesisTests) -> Identifiable:
    if tests.delay is None:
        return Identifiable("torque delay", False, "no torque varies")
    if abs(tests.delay.seconds) >= UNUSABLE_DELAY and tests.shift == 0.0:
        return Identifiable("torque delay", False, "no delay explains the motion clearly")
    low, high = tests.delay.interval
    reason = f"the torque acts {1e3 * low:.1f} to {1e3 * high:.1f} ms after it is logged (95 %)"
    if high < 0:
        reason = (
            f"the torque acts {-1e3 * high:.1f} to {-1e3 * low:.1f} ms before it is logged (95 %)"
        )
    return Identifiable("torque delay", tests.delay.error < DELAY, reason)
