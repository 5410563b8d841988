"""The verdict before fitting: facts, faults, what can be identified, what to record next."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.data.envelope import Reached
from frictionid.data.recordings import Dataset
from frictionid.data.signals import ClockFacts, clock_of

from .conventions import Scored, convention_of_recording
from .facts import JointFacts, joints_of
from .findings import LEVELS, Finding, finding
from .hypothesis_tests import (
    Delay,
    HypothesisTests,
    run_tests,
    sampling_findings,
    untested,
)
from .log_faults import count_findings, dead_torques, in_seconds, log_findings
from .machine_faults import drift_findings, stop_findings
from .model_errors import ERRORS, SINGLED_OUT, ModelError
from .motion import Measured, Motion, adapted, motions_of
from .partial_regression import partial_regression
from .passive import energy_test, gravity_findings, gravity_shares, passive_time, rest_tests
from .questions import Identifiable, Question, advice, identifiable, questions, still_joints
from .regression import Estimate, Regression, regress, widened
from .sensors import (
    frozen_angles,
    frozen_findings,
    frozen_torques,
    unwrapped,
    velocity_findings,
    without_outliers,
)
from .servos import servo_advice, servo_findings, servos_of, with_late_targets
from .torque_source import TorqueSource, place_findings, torque_sources, unmeasured_findings
from .torque_speed import limit_findings, torque_speeds

_SHOWN = 3  # base parameters that are off


@dataclass(frozen=True, eq=False)
class Verdict:
    """Verdict on a data set before any fit; SI units.

    Attributes
    ----------
    dataset : str
    level : str
        "good", "doubtful" or "unusable": that of the worst finding.
    findings : tuple of Finding, the worst first
    clock : ClockFacts
    joints : tuple of JointFacts
    passive : float [s] of motion without torque
    conventions : tuple of Scored
        Signs, frames and units that were tested; a lower score fits better.
    delay : Delay or None, where no torque varies
    model_errors : tuple of ModelError
        Changes of the nominal mechanism, the one that explains most first.
    torque : tuple of TorqueSource
        Whether each motor's torque is measured, commanded or modelled, and what shows it.
    questions : tuple of Question
        The classic questions, answered by yes, no, or not tested and why.
    estimate : Estimate
        Least squares of base parameters and friction, with conventions and delay corrected.
    nominal : array, shape (nb,)
        Nominal base parameters of the first recording.
    identifiable : tuple of Identifiable
    next : tuple of str
        Recordings to make next.
    envelopes : tuple of Reached
        What of its torque-speed envelope each motor's measured torque reaches.
    regression : Regression
        Data of the least squares, for figures.
    """

    dataset: str
    level: str
    findings: tuple[Finding, ...]
    clock: ClockFacts
    joints: tuple[JointFacts, ...]
    passive: float
    conventions: tuple[Scored, ...]
    delay: Delay | None
    model_errors: tuple[ModelError, ...]
    torque: tuple[TorqueSource, ...]
    questions: tuple[Question, ...]
    estimate: Estimate
    nominal: Array
    identifiable: tuple[Identifiable, ...]
    next: tuple[str, ...]
    envelopes: tuple[Reached, ...]
    regression: Regression


def check(dataset: Dataset) -> Verdict:
    """Verdict on a data set, before any model is fitted.

    Examples
    --------
    >>> from frictionid.simulate import Camera, Curve, Rig, Run, Sine, Stribeck, simulate
    >>> runs = [Run(f"{i}", (1.0 + i,), (), (Sine(2.0, 0.4 + 0.3 * i),)) for i in range(3)]
    >>> machine = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 1.0}}
    >>> rig = Rig("demo", machine, Stribeck(Curve((0.3,), (0.3,), (0.05,))),
    ...           Camera(300, 60.0, 1e-3), (*runs, Run("decay", (2.0,))), substeps=4)
    >>> check(simulate(rig)).level
    'good'
    """
    timed, of_time = in_seconds(dataset)
    corrected, findings = unwrapped(timed)
    motions = motions_of(corrected.recordings)
    corrected, of_targets = with_late_targets(corrected, motions)
    others = [*of_time, *findings, *of_targets, *servo_findings(corrected)]
    findings = list(count_findings(dataset)) or others
    return judge(corrected, motions, findings)


def judge(dataset: Dataset, motions: Sequence[Motion], findings: Sequence[Finding] = ()) -> Verdict:
    """Verdict on a data set without wrapped angles whose motions are known.

    Sensor faults, then the tests against the nominal mechanism, then least squares on what these
    leave and correct. `findings` were made before; for the rest see `check`.
    """
    facts, commanded = joints_of(dataset.recordings, motions), gravity_shares(dataset)
    usable, of_sensors = screened(Measured.of_dataset(dataset, motions))
    of_commands = list(gravity_findings(usable, commanded))
    is_command = any(f.level == "unusable" for f in of_commands)
    is_counted = any(f.kind == "counts" for f in findings)
    usable, of_outliers = without_outliers(usable)
    tests = untested(usable) if is_command or is_counted else tests_of(usable)
    regression, estimate = _least_squares(tests)
    sources = torque_sources(dataset, commanded)
    motion = [m.states for m in motions]
    envelopes = tuple(torque_speeds(dataset, motion))
    unsorted = [
        *findings,
        *of_commands,
        *of_sensors,
        *of_outliers,
        *sampling_findings(usable),
        *limit_findings(dataset, motion, envelopes),
        *still_joints(tests, facts),
        *_of_tests(tests, regression, estimate, sources),
    ]
    everything = sorted(unsorted, key=lambda f: -LEVELS.index(f.level))
    passive = passive_time(tests.measured)
    untestable = "the torque is a command" if is_command else "no joint slides long enough"
    untestable = "the angles look like counts" if is_counted else untestable
    return Verdict(
        dataset=dataset.name,
        level=everything[0].level if everything else "good",
        findings=tuple(everything),
        clock=clock_of([r.angle.time for r in dataset.recordings]),
        joints=tuple(facts),
        passive=passive,
        conventions=tests.conventions,
        delay=tests.delay,
        model_errors=tests.model_errors,
        torque=sources,
        questions=tuple(questions(tests, estimate, sources)),
        estimate=estimate,
        nominal=tests.measured.nominal[0],
        identifiable=tuple(identifiable(tests, facts, estimate))
        if tests.done
        else (Identifiable("everything", False, untestable),),
        next=(*servo_advice(dataset), *advice(tests, facts, passive, estimate)),
        envelopes=envelopes,
        regression=regression,
    )


def screened(measured: Measured) -> tuple[Measured, list[Finding]]:
    """The recordings without frozen readings, and the faults of sensors and log.

    Their fault would look like others in all that follows.
    """
    dead = dead_torques(measured)
    measured = replace(measured, dead=tuple(dead))
    angles = frozen_angles(measured)
    moving = measured.without({f.recording for f in angles})
    logged = list(log_findings(measured, dead))
    # between readings that repeat and others the motion seems to need a torque that changes
    repeat = any(f.kind == "repeated_rows" and f.level == "doubtful" for f in logged)
    torques = [] if repeat else frozen_torques(moving)
    findings = [
        *frozen_findings(measured, angles, "frozen_sensor"),
        *frozen_findings(moving, torques, "frozen_torque"),
        *logged,
        *velocity_findings(measured),
    ]
    return moving.without({f.recording for f in torques}), findings


def _of_tests(
    tests: HypothesisTests,
    regression: Regression,
    estimate: Estimate,
    sources: tuple[TorqueSource, ...],
) -> Iterator[Finding]:
    """Errors of the tests, and where none explains them already, of passivity; of torques."""
    if tests.done:  # what else is found may follow from them
        yield from stop_findings(tests.measured)
    yield from (_with_figures(f, estimate, tests.measured.nominal[0]) for f in tests.findings)
    if tests.done and not tests.findings:
        passivity = [energy_test(tests.measured), *rest_tests(tests, estimate)]
        yield from (wrong for _, wrong in passivity if wrong is not None)
    if tests.done and all(f.level == "good" or f.kind == "delay" for f in tests.findings):
        yield from drift_findings(regression, estimate)
    yield from place_findings(tests, estimate)
    yield from unmeasured_findings(sources, tests, regression, estimate)


def _with_figures(fault: Finding, estimate: Estimate, nominal: Array) -> Finding:
    """The finding of a wrong mechanism with the base parameters that are surely off."""
    if fault.kind != "nominal_mechanism":
        return fault
    off = estimate.value[: len(nominal)] - nominal
    sure = np.abs(off) / np.maximum(estimate.error[: len(nominal)], 1e-300)
    said = [
        f"{estimate.names[i]} is {100 * off[i] / nominal[i]:+.1f} % from its nominal value"
        for i in np.argsort(-sure)[:_SHOWN].tolist()
        if sure[i] > ERRORS and nominal[i]
    ]
    return replace(fault, text="; ".join([fault.text, *said]))


def _least_squares(tests: HypothesisTests) -> tuple[Regression, Estimate]:
    measured = tests.measured
    mechanism, nominal = measured.mechanism, measured.nominal
    rows = adapted(measured.balances, measured.motions).without(measured.dead)
    torque = rows.means(measured.torque, tests.shift)
    estimate = regress(rows, torque, mechanism, nominal)
    if tests.longer is not None:
        means = tests.longer.means(measured.torque, tests.shift)
        estimate = widened(estimate, regress(tests.longer, means, mechanism, nominal))
    return Regression(measured, rows, torque), estimate


# --- Recordings with a fault of their own ---------------------------------------------------------

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
