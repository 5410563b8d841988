"""Joints that hardly move, and which recording to make next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.check.facts import JointFacts
from frictionid.check.findings import Finding
from frictionid.check.hypothesis_tests import Delay, HypothesisTests
from frictionid.check.motion import MIN_WINDOWS, Measured
from frictionid.check.regression import Estimate
from frictionid.mechanics import Mechanism

# Speed [rad/s] that shows viscous friction.
FAST = 2.0
# Free decay [s] that identifies the friction of joints without motor, and the least for any joint.
DECAY, SOME_DECAY = 20.0, 2.0
# A delay is known where its standard error is below this [s].
KNOWN_DELAY = 0.005
_SWINGING = 2  # joints of what swings freely without harm; arms with a motor at each of more fall


def still_joints(tests: HypothesisTests, facts: Sequence[JointFacts]) -> list[Finding]:
    """Findings of joints that hardly move in any recording."""
    units = tests.measured.mechanism.velocity_units
    windows = tests.as_given.moving.sum(0)
    anything = bool((windows >= MIN_WINDOWS).any())
    return [
        Finding(
            "missing_excitation",
            "doubtful" if anything else "unusable",
            f"joint {fact.joint} hardly moves: 95 % of the time below {fact.fast:.2g} {unit} "
            f"(noise {fact.velocity_noise:.2g}), {count} windows of sliding",
            "its friction cannot be identified; record motion of this joint",
            fact.joint,
            {"fast": fact.fast, "windows": float(count)},
        )
        for fact, count, unit in zip(facts, windows, units, strict=True)
        if count < MIN_WINDOWS and fact.joint - 1 not in tests.measured.dead
    ]


def advice(
    tests: HypothesisTests, facts: Sequence[JointFacts], passive: float, estimate: Estimate
) -> list[str]:
    """Sentences that say which recording to make next, the most useful first.

    passive : [s] of motion without torque
    """
    measured = tests.measured
    driven = measured.mechanism.driven
    return [
        *_faster(measured.mechanism, measured.nominal[0], facts),
        *(_decay(passive, unmoved=not all(driven)) if _may_fall(measured) else []),
        *(_delay(tests.delay) if any(driven) else []),
        *_base(measured.mechanism, estimate),
    ]


def _faster(mechanism: Mechanism, nominal: Array, facts: Sequence[JointFacts]) -> list[str]:
    out = []
    for fact, unit in zip(facts, mechanism.position_units, strict=True):
        if unit == "rad" and fact.top < FAST:
            out.append(
                f"joint {fact.joint} never exceeds {_round(max(fact.top, 0.1))} rad/s: "
                f"add {_swing(mechanism, nominal, fact.joint - 1)}"
            )
        elif fact.at_rest < 0.9 and not 0.15 < fact.forward < 0.85:
            direction = "forward" if fact.forward < 0.5 else "backward"
            out.append(f"joint {fact.joint} hardly moves {direction}: add motion in that direction")
    return out


def _may_fall(measured: Measured) -> bool:
    """Whether gravity moves the mechanism when its motors are off, and it is no arm that breaks."""
    if measured.mechanism.n > _SWINGING and all(measured.mechanism.driven):
        return False
    q = np.linspace(-1.0, 1.0, 5)[:, None] * np.ones(measured.mechanism.n)
    return bool(measured.mechanism.dynamics(measured.nominal[0], q, 0 * q)[1].any())


def _decay(passive: float, *, unmoved: bool) -> list[str]:
    if passive < SOME_DECAY:
        reason = " (it shows the friction of the joint without motor)" if unmoved else ""
        return [f"no free decay: add one of {DECAY:.0f} s, torque off{reason}"]
    if unmoved and passive < DECAY:
        return [f"only {passive:.0f} s of free decay: add one of {DECAY:.0f} s"]
    return []


def _delay(delay: Delay | None) -> list[str]:
    if delay is not None and delay.error < KNOWN_DELAY:
        return []
    known = f"the delay is known to {1e3 * delay.error:.0f} ms" if delay else "no torque varies"
    return [f"{known}: add torque steps or a chirp, which show delay and gain"]


def _base(mechanism: Mechanism, estimate: Estimate) -> list[str]:
    names = {name for direction in estimate.unidentifiable for name, _ in direction}
    base = sorted(names & set(mechanism.base_names))
    if not base:
        return []
    return [f"{' and '.join(base)} not identified: add faster, wider motion of all joints"]


def _swing(mechanism: Mechanism, nominal: Array, j: int) -> str:
    """A swing that reaches twice the speed, by the energy of the nominal mechanism."""
    angles = np.linspace(0.0, 2.8, 141)
    q = np.zeros((len(angles), mechanism.n))
    q[:, j] = angles
    terms = mechanism.terms(nominal, q, np.zeros_like(q))
    speed = np.sqrt(2 * np.maximum(terms.energy - terms.energy[0], 0) / terms.M[:, j, j])
    enough = np.flatnonzero(speed > 2 * FAST)
    if len(enough):
        degrees = int(np.ceil(np.degrees(angles[enough[0]]) / 10) * 10)
        return f"a swing of this joint from {degrees} degrees"
    return f"driven motion of this joint above {FAST:g} rad/s"


def _round(value: float) -> str:
    return f"{value:.1f}" if value < 10 else f"{value:.0f}"
