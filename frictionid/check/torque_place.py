"""What the declared place of the torques means: at the motors, at the links, or commands."""

from __future__ import annotations

from collections.abc import Iterator

from frictionid.check.findings import Finding
from frictionid.check.hypothesis_tests import HypothesisTests
from frictionid.check.regression import Estimate
from frictionid.data.plants import LINK_TORQUE, LINK_TORQUE_REMEDY

# Coulomb friction in the torques of links: this many standard errors, and residuals of its joint.
ERRORS, RESIDUALS = 5.0, 2.0


def place_findings(tests: HypothesisTests, estimate: Estimate) -> Iterator[Finding]:
    """Findings of torques at links and of commands; none of torques at motors."""
    place = tests.measured.dataset.torque_at
    if place == "link":
        yield Finding("link_torque", "doubtful", LINK_TORQUE, LINK_TORQUE_REMEDY)
        yield from _friction_at_links(tests, estimate)
    elif place == "command":
        yield Finding(
            "commanded_torque",
            "good",
            'the torques are commands, not measured (torque.at = "command"): friction fitted to '
            "them holds what the drives add or lose, a gain is that of drive and motor, and a "
            "delay holds the drive's",
            "record the torque that the drive reports (its current), where it does",
        )


def _friction_at_links(tests: HypothesisTests, estimate: Estimate) -> Iterator[Finding]:
    """Friction that sensors behind the gears cannot feel, and yet shows."""
    if not tests.done:
        return
    for j, unit in enumerate(tests.measured.mechanism.torque_units):
        level, error = estimate.at(f"coulomb_{j + 1}")
        if level > ERRORS * error and level > RESIDUALS * float(estimate.spread[j]):
            yield Finding(
                "friction_at_link",
                "doubtful",
                f"the balance of joint {j + 1} shows Coulomb friction of {level:.2g} +- "
                f"{error:.1g} {unit}, which a sensor at the link would not feel",
                'say torque.at = "motor" if the torque is that of the motors; else it is friction '
                "of the joint's own bearing",
                j + 1,
                {"coulomb": level, "error": error},
            )
