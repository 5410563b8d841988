"""Joints that hardly move, and which recording to make next."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import FEWEST, Rows
from frictionid.check.delay import Delay
from frictionid.check.facts import JointFacts
from frictionid.check.findings import Finding
from frictionid.check.regression import Estimate
from frictionid.mechanics import Mechanism

# Speeds [rad/s] that show the viscous part, and slow ones that show the Stribeck part.
FAST, SLOW = 2.0, (0.1, 0.5)
DECAY = 20.0  # [s] of free decay that fix the friction of joints without motor


def still_joints(rows: Rows, facts: list[JointFacts], unit: str) -> list[Finding]:
    """Findings of joints that hardly move anywhere; unit of their angles, "rad" or "m"."""
    found = []
    anything = bool((rows.free.sum(0) >= FEWEST).any())
    for fact in facts:
        slides = int(rows.free[:, fact.joint - 1].sum())
        if slides >= FEWEST:
            continue
        found.append(
            Finding(
                "missing_excitation",
                "doubtful" if anything else "unusable",
                f"joint {fact.joint} hardly moves: 95 % of the time below {fact.fast:.2g} {unit}/s "
                f"(noise {fact.velocity_noise:.2g}), {slides} windows of sliding",
                "its friction cannot be identified; record motion of this joint",
                fact.joint,
                {"fast": fact.fast, "windows": float(slides)},
            )
        )
    return found


def advice(
    mechanism: Mechanism,
    told: Array,
    facts: list[JointFacts],
    passive: float,
    estimate: Estimate,
    delay: Delay | None,
) -> list[str]:
    """Sentences that say which recording to make next, the most useful first.

    told : (nb,) base parameters; passive : [s] of motion without torque
    """
    out = []
    revolute = mechanism.description.angle_unit == "rad"
    for fact in facts:
        if revolute and fact.top < FAST:
            out.append(
                f"joint {fact.joint} never exceeds {_round(max(fact.top, 0.1))} rad/s: "
                f"add {_swing(mechanism, told, fact.joint - 1)}"
            )
        elif fact.rest < 0.9 and not 0.15 < fact.forward < 0.85:
            way = "forward" if fact.forward < 0.5 else "backward"
            out.append(f"joint {fact.joint} hardly moves {way}: add motion in that direction")
    unmoved = not all(mechanism.description.driven)
    if passive < 2.0:
        why = "" if not unmoved else ", for the friction of the joint without motor hangs on it"
        out.append(f"no free decay: add one of {DECAY:.0f} s, torque off{why}")
    elif unmoved and passive < DECAY:
        out.append(f"only {passive:.0f} s of free decay: add one of {DECAY:.0f} s")
    driven = [j for j, d in enumerate(mechanism.description.driven) if d]
    if driven and (delay is None or not delay.error < 0.005):
        why = (
            "no torque varies"
            if delay is None
            else f"the delay is known to {1e3 * delay.error:.0f} ms"
        )
        out.append(f"{why}: add torque steps or a chirp, which show delay and gain")
    blind = sorted({name for direction in estimate.blind for name, _ in direction})
    base = [name for name in blind if name in mechanism.base_names]
    if base:
        out.append(f"{' and '.join(base)} remain unclear: add faster, wider motion of all joints")
    return out


def _swing(mechanism: Mechanism, told: Array, j: int) -> str:
    """A swing that reaches twice the speed, by the energy of the told mechanism."""
    angles = np.linspace(0.0, 2.8, 141)
    q = np.zeros((len(angles), mechanism.n))
    q[:, j] = angles
    terms = mechanism.terms(told, q, np.zeros_like(q))
    speed = np.sqrt(2 * np.maximum(terms.energy - terms.energy[0], 0) / terms.M[:, j, j])
    enough = np.flatnonzero(speed > 2 * FAST)
    if len(enough):
        degrees = int(np.ceil(np.degrees(angles[enough[0]]) / 10) * 10)
        return f"a swing of this joint from {degrees} degrees"
    return f"driven motion of this joint above {FAST:g} rad/s"


def _round(value: float) -> str:
    return f"{value:.1f}" if value < 10 else f"{value:.0f}"
