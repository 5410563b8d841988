"""The verdict before fitting: facts, faults, what can be identified, what to record next."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from frictionid.arrays import Array
from frictionid.check.clock import in_seconds, sampling_findings
from frictionid.check.conventions import Scored
from frictionid.check.coverage import advice, still_joints
from frictionid.check.facts import ClockFacts, JointFacts, clock_of, joints_of
from frictionid.check.findings import LEVELS, Finding
from frictionid.check.hypothesis_tests import Delay, HypothesisTests, run_tests, untested
from frictionid.check.log_faults import dead_torques, log_findings
from frictionid.check.model_errors import Compared, ModelError, compared, incompatible
from frictionid.check.motion import Measured, Motion, adapted, is_blurred, motions_of
from frictionid.check.passive import (
    GravityShares,
    energy_findings,
    gravity_findings,
    gravity_shares,
    passive_time,
    rest_findings,
)
from frictionid.check.questions import Identifiable, Question, identifiable, questions
from frictionid.check.regression import Estimate, Regression, regress, widened
from frictionid.check.sensors import (
    frozen_angles,
    frozen_findings,
    frozen_torques,
    unwrapped,
    without_outliers,
)
from frictionid.check.servos import servo_advice, servo_findings, with_late_targets
from frictionid.check.torque_source import TorqueSource, place_findings, torque_sources
from frictionid.check.unmeasured import unmeasured
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.friction import Friction


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
    published : Compared or None
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
    published: Compared | None
    regression: Regression


@dataclass(frozen=True)
class Screening:
    """Faults of the sensors, and the recordings without them.

    command : whether the torque is nothing but a command, so that nothing else can be tested
    """

    findings: tuple[Finding, ...]
    usable: Measured
    command: bool


def check(dataset: Dataset, published: Friction | None = None) -> Verdict:
    """Verdict on a data set, before any model is fitted.

    Parameters
    ----------
    dataset : Dataset
    published : Friction, optional
        Somebody's model, with mechanism parameters of its own, to compare with the data.

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
    findings = [*of_time, *findings, *of_targets, *servo_findings(corrected)]
    return judge(corrected, motions, findings, published)


def judge(
    dataset: Dataset,
    motions: Sequence[Motion],
    findings: Sequence[Finding] = (),
    published: Friction | None = None,
) -> Verdict:
    """Verdict on a data set without wrapped angles whose motions are known.

    Sensor faults, then the tests against the nominal mechanism, then least squares on what these
    leave and correct. `findings` were made before; for the rest see `check`.
    """
    facts = joints_of(dataset.recordings, motions)
    measured = Measured.of(dataset, motions)
    commanded = gravity_shares(dataset)
    screening = screened(measured, commanded)
    usable, of_outliers = without_outliers(screening.usable)
    tests = untested(usable) if screening.command else run_tests(usable)
    regression, estimate = _least_squares(tests)
    sources = torque_sources(dataset, commanded)
    model = _compared(regression, estimate, published) if published else None
    everything = _worst_first(
        [
            *findings,
            *screening.findings,
            *of_outliers,
            *sampling_findings(usable),
            *still_joints(tests, facts),
            *tests.findings,
            *_passivity_findings(tests, estimate),
            *place_findings(tests, estimate),
            *_torque_findings(sources, tests, regression, estimate),
            *(incompatible(model) if model else []),
        ]
    )
    passive = passive_time(tests.measured)
    return Verdict(
        dataset=dataset.name,
        level=everything[0].level if everything else "good",
        findings=tuple(everything),
        clock=clock_of(dataset.recordings),
        joints=tuple(facts),
        passive=passive,
        conventions=tests.conventions,
        delay=tests.delay,
        model_errors=tests.model_errors,
        torque=sources,
        questions=tuple(questions(tests, estimate, sources)),
        estimate=estimate,
        nominal=tests.measured.nominal[0],
        identifiable=tuple(_identifiable(screening, tests, facts, estimate)),
        next=(*servo_advice(dataset), *advice(tests, facts, passive, estimate)),
        published=model,
        regression=regression,
    )


def screened(measured: Measured, commanded: GravityShares) -> Screening:
    """Frozen readings and commanded torques; recordings with frozen readings are left out.

    Their fault would look like others in all that follows.
    """
    dead = dead_torques(measured)
    measured = replace(measured, dead=tuple(dead))
    angles = frozen_angles(measured)
    moving = measured.without({f.recording for f in angles})
    torques = frozen_torques(moving)
    usable = moving.without({f.recording for f in torques})
    commands = gravity_findings(usable, commanded)
    findings = (
        *commands,
        *frozen_findings(measured, angles, "angle"),
        *frozen_findings(moving, torques, "torque"),
        *log_findings(measured, dead),
    )
    return Screening(findings, usable, any(f.level == "unusable" for f in commands))


def _least_squares(tests: HypothesisTests) -> tuple[Regression, Estimate]:
    measured = tests.measured
    rows = tests.rows
    if not is_blurred(measured.motions):
        rows = adapted(measured.balances, measured.motions).without(measured.dead)
    torque = rows.means(measured.torque, tests.shift)
    mechanism, nominal = measured.mechanism, measured.nominal
    estimate = regress(rows, torque, mechanism, nominal)
    if tests.longer is not None:
        estimate = widened(
            estimate,
            regress(
                tests.longer,
                tests.longer.means(measured.torque, tests.shift),
                mechanism,
                nominal,
            ),
        )
    return Regression(measured, rows, torque), estimate


def _compared(regression: Regression, estimate: Estimate, published: Friction) -> Compared:
    parameters = plant_of(regression.measured.dataset, published.parameters).p
    return compared(regression.rows, regression.torque, estimate, parameters, published)


def _passivity_findings(tests: HypothesisTests, estimate: Estimate) -> list[Finding]:
    """Findings of energy and loads at rest, where no tested error explains them already."""
    if not tests.done or tests.findings:
        return []
    return [*energy_findings(tests.measured), *rest_findings(tests, estimate)]


def _torque_findings(
    sources: Sequence[TorqueSource],
    tests: HypothesisTests,
    regression: Regression,
    estimate: Estimate,
) -> list[Finding]:
    """Findings of torques that are not measured, where the motion is known well enough."""
    coarse = bool(sampling_findings(tests.measured))
    if not tests.done or coarse or any(f.kind == "constant_angle" for f in tests.findings):
        return []
    return unmeasured(sources, regression, estimate, tests.delay)


def _worst_first(findings: Iterable[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda f: -LEVELS.index(f.level))


def _identifiable(
    screening: Screening, tests: HypothesisTests, facts: Sequence[JointFacts], estimate: Estimate
) -> list[Identifiable]:
    if tests.done:
        return identifiable(tests, facts, estimate)
    reason = "the torque is a command" if screening.command else "no joint slides long enough"
    return [Identifiable("everything", False, reason)]
