"""What the recordings identify, each with its precision, and what they do not, with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.check.facts import JointFacts
from frictionid.check.hypothesis_tests import HypothesisTests
from frictionid.check.regression import Estimate

# A number counts as identified where its standard error is below this share of it,
PRECISE = 0.3
# a torque gain below this one, and a delay below this one [s].
GAIN, DELAY = 0.05, 0.005


class Identifiable(NamedTuple):
    """Whether something can be identified, and why, or how well."""

    what: str
    possible: bool
    reason: str


def identifiable(
    tests: HypothesisTests, facts: Sequence[JointFacts], estimate: Estimate
) -> list[Identifiable]:
    """Friction of each joint, inertia combinations, gain and delay."""
    description = tests.measured.mechanism.description
    out = [_friction(estimate, fact, description.angle_unit) for fact in facts]
    out.append(_base(tests.measured.mechanism.base_names, estimate))
    return [*out, _gain(tests), _delay(tests)] if any(description.driven) else out


def _friction(estimate: Estimate, fact: JointFacts, unit: str) -> Identifiable:
    what = f"friction of joint {fact.joint}"
    level, error = estimate.at(f"coulomb_{fact.joint}")
    if not np.isfinite(error):
        return Identifiable(what, False, "the joint hardly slides")
    viscous, _ = estimate.at(f"viscous_{fact.joint}")
    at = [estimate.names.index(f"{name}_{fact.joint}") for name in ("coulomb", "viscous")]
    gradient = np.array([1.0, fact.fast])
    total = abs(level) + abs(viscous) * fact.fast
    deviation = float(np.sqrt(gradient @ estimate.covariance[np.ix_(at, at)] @ gradient))
    share = deviation / max(total, 1e-300)
    reason = f"known to {100 * share:.2g} % of its level at {fact.fast:.2g} {unit}/s"
    return Identifiable(what, share < PRECISE, reason)


def _base(names: Sequence[str], estimate: Estimate) -> Identifiable:
    directions = [d for d in estimate.unidentifiable if any(name in names for name, _ in d)]
    reason = "; ".join(_direction(d) for d in directions[:3])
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
    rivals = {f.kind for f in tests.findings} & {"load", "unknown_cause"}
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
    low, high = tests.delay.interval
    reason = f"{1e3 * low:.1f} to {1e3 * high:.1f} ms (95 %)"
    return Identifiable("torque delay", tests.delay.error < DELAY, reason)
