"""What the recordings can tell, each with its precision, and what they cannot, with the reason."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.check.facts import JointFacts
from frictionid.check.hypothesis_tests import Trial
from frictionid.check.regression import Estimate
from frictionid.mechanics import Mechanism

# A number counts as identified where its standard error is below this share of it.
PRECISE = 0.3


class Identifiable(NamedTuple):
    """Whether something can be identified, and why, or how well."""

    what: str
    possible: bool
    reason: str


def identifiable(
    mechanism: Mechanism,
    facts: list[JointFacts],
    estimate: Estimate,
    trial: Trial,
    command: bool,
) -> list[Identifiable]:
    """Friction of each joint, inertia combinations, gain and delay."""
    if not trial.judged:
        nothing = "the torque is a command" if command else "no joint slides long enough"
        return [Identifiable("everything", False, nothing)]
    unit = mechanism.description.angle_unit
    out = [_friction(estimate, fact, unit) for fact in facts]
    out.append(_base(mechanism, estimate))
    gains = [s for s in trial.suspects if s.kind == "gain"]
    if gains:
        best = min(gains, key=lambda s: s.error)
        out.append(
            Identifiable(
                "torque gain",
                best.error < 0.05,
                f"{best.size:.3f} +- {best.error:.3f}, as far as the told mechanism is right: gain "
                "and all masses together cannot be told apart",
            )
        )
    elif any(mechanism.description.driven):
        out.append(Identifiable("torque gain", False, "no torque acts"))
    if trial.delay:
        low, high = trial.delay.interval
        out.append(
            Identifiable(
                "torque delay",
                trial.delay.error < 0.005,
                f"{1e3 * low:.1f} to {1e3 * high:.1f} ms (95 %)",
            )
        )
    elif any(mechanism.description.driven):
        out.append(Identifiable("torque delay", False, "no torque varies"))
    return out


def _friction(estimate: Estimate, fact: JointFacts, unit: str) -> Identifiable:
    what = f"friction of joint {fact.joint}"
    level, error = estimate.at(f"coulomb_{fact.joint}")
    if not np.isfinite(error):
        return Identifiable(what, False, "the joint hardly slides")
    viscous, _ = estimate.at(f"viscous_{fact.joint}")
    at = [estimate.names.index(f"{name}_{fact.joint}") for name in ("coulomb", "viscous")]
    grade = np.array([1.0, fact.fast])
    total = abs(level) + abs(viscous) * fact.fast
    uncertain = float(np.sqrt(grade @ estimate.covariance[np.ix_(at, at)] @ grade))
    share = 100 * uncertain / max(total, 1e-300)
    told = f"known to {share:.2g} % of its level at {fact.fast:.2g} {unit}/s"
    return Identifiable(what, share < 100 * PRECISE, told)


def _base(mechanism: Mechanism, estimate: Estimate) -> Identifiable:
    names = set(mechanism.base_names)
    blind = [d for d in estimate.blind if any(name in names for name, _ in d)]
    if not blind:
        return Identifiable("inertia combinations", True, f"all {len(names)} base parameters")
    words = "; ".join(_direction(d) for d in blind[:3])
    return Identifiable("inertia combinations", False, words)


def _direction(direction: tuple[tuple[str, float], ...]) -> str:
    """Words for a direction that cannot be seen.

    >>> _direction((("a", 0.8), ("b", -0.5)))
    'more a with less b changes nothing'
    >>> _direction((("a", 0.8),))
    'a cannot be seen'
    """
    if len(direction) == 1:
        return f"{direction[0][0]} cannot be seen"
    sign = np.sign(direction[0][1])
    more = [name for name, share in direction if share * sign > 0]
    less = [name for name, share in direction if share * sign < 0]
    text = f"more {' and '.join(more)}"
    return (
        f"{text} with less {' and '.join(less)} changes nothing"
        if less
        else (f"{text} together change nothing")
    )
