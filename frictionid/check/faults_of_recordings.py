"""Faults of single recordings: tested without them, and named where the others are sound."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .conventions import convention_of_recording
from .findings import Finding, finding
from .hypothesis_tests import HypothesisTests, run_tests
from .model_errors import ERRORS, SINGLED_OUT
from .motion import Measured
from .partial_regression import partial_regression
from .servos import servos_of

_KINDS = {"fault_of_recording", "convention_of_recording", "bias_of_recording"}
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
    faults = [
        f
        for i in sorted(tests.odd)
        for f in _faults(measured.without(set(every - {i}))) or _bias(tests, i)
    ]
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


def _bias(tests: HypothesisTests, i: int) -> Iterator[Finding]:
    """The bias of a sensor's torque in a recording, where it leaves little.

    Friction has one offset in all recordings; in one alone that takes the bias up.
    """
    measured, rows = tests.measured, tests.rows
    dataset, torque = measured.dataset, rows.means(measured.torque, tests.shift)
    motors = np.flatnonzero(measured.mechanism.driven).tolist()
    if dataset.torque_at == "command" or servos_of(dataset) or not motors:
        return
    fit = partial_regression(rows, torque, measured.nominal)
    target = torque - rows.required(measured.nominal)
    here = (rows.recording == i)[:, None] * np.eye(torque.shape[1])[:, None]
    biases = {j: fit.estimate(target, here[j]) for j in motors}
    j = min(motors, key=lambda j: biases[j][2])
    (size,), (error,), left = biases[j]
    rivals = [e.left for e in tests.model_errors]
    most = min(SINGLED_OUT, *rivals) * float((fit.residual(target) ** 2).sum())
    if abs(size) > ERRORS * error and left < most:
        words = {
            "recording": dataset.recordings[i].name,
            "unit": measured.mechanism.torque_units[j],
        }
        yield finding("bias_of_recording", {"size": size, "error": error}, words, j + 1)
