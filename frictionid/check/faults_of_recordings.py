"""Faults of single recordings: tested without them, and named where the others are sound."""

from dataclasses import replace

from .conventions import convention_of_recording
from .findings import Finding, finding
from .hypothesis_tests import HypothesisTests, run_tests
from .motion import Measured

_KINDS = {"fault_of_recording", "convention_of_recording"}
# Of the machine: no recording has them alone, but a disturbance may look like them there.
_MACHINE = {"base", "load", "rotor", "nominal_mechanism", "unknown_cause", "unexplained"}


def tests_of(measured: Measured) -> HypothesisTests:
    """Tests of all recordings, or of those without a fault of their own, which is named.

    A zero, gain, sign, unit or delay that is off in one table would be an error of the mechanism,
    or none that has a name, in all of them together.
    """
    tests = run_tests(measured)
    every = frozenset(range(len(measured.motions)))
    if not tests.odd or tests.odd == every:
        return tests
    rest = tests_of(measured.without(set(tests.odd)))
    if any(f.level != "good" and f.kind not in _KINDS for f in rest.findings):
        return tests
    faults = [f for i in sorted(tests.odd) for f in _faults(measured.without(set(every - {i})))]
    return replace(rest, findings=(*faults, *rest.findings)) if faults else tests


def _faults(single: Measured) -> list[Finding]:
    """What is wrong with one recording, if that has a name; signs before delays, as a sine has."""
    convention = convention_of_recording(single)
    if convention is not None:
        return [convention]
    words = {"recording": single.dataset.recordings[0].name}
    return [
        finding("fault_of_recording", f.numbers, {**words, "fault": f.text}, f.joint, level=f.level)
        for f in run_tests(single).findings
        if f.level != "good" and f.kind not in _MACHINE
    ]
