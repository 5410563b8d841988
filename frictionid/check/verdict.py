"""The verdict before fitting: facts, faults, what can be identified, what to record next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows, sharp_rows, speeds_of
from frictionid.check.commanded import commanded
from frictionid.check.conventions import Scored
from frictionid.check.coverage import advice, still_joints
from frictionid.check.delay import Delay
from frictionid.check.facts import ClockFacts, JointFacts, clock_of, joints_of
from frictionid.check.findings import LEVELS, Finding
from frictionid.check.frozen_torque import stuck
from frictionid.check.hypothesis_tests import Trial, tried
from frictionid.check.identifiable import Identifiable, identifiable
from frictionid.check.model_errors import Suspect
from frictionid.check.motion import Motion, motions_of
from frictionid.check.passive import energy, gravity_at_rest, passive_time
from frictionid.check.published import Compared, compared, incompatible
from frictionid.check.questions import Answer, answers
from frictionid.check.regression import Estimate, regress
from frictionid.check.sensors import frozen, unwrapped
from frictionid.check.torque_integral import impulse_of
from frictionid.data.recordings import Dataset
from frictionid.friction import Friction
from frictionid.mechanics import plant_of


@dataclass(frozen=True, eq=False)
class Verdict:
    """All that was found out about a data set before any fit; SI units.

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
        Signs, frames and units that were tried; a lower score fits better.
    delay : Delay or None, where no torque varies
    suspects : tuple of Suspect
        Changes of the told mechanism, the one that explains most first.
    answers : tuple of Answer
        To the classic questions, also where nothing is wrong.
    estimate : Estimate
        Least squares of base parameters and friction, conventions and delay put right before.
    identifiable : tuple of Identifiable
    next : tuple of str
        Recordings to make next.
    published : Compared or None
    evidence : Evidence
        What pictures are drawn from.
    """

    dataset: str
    level: str
    findings: tuple[Finding, ...]
    clock: ClockFacts
    joints: tuple[JointFacts, ...]
    passive: float
    conventions: tuple[Scored, ...]
    delay: Delay | None
    suspects: tuple[Suspect, ...]
    answers: tuple[Answer, ...]
    estimate: Estimate
    told: Array
    identifiable: tuple[Identifiable, ...]
    next: tuple[str, ...]
    published: Compared | None
    evidence: Evidence


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the verdict was made from; rows of the least squares, their torque (K, n) [N m]."""

    dataset: Dataset
    motions: tuple[Motion, ...]
    rows: Rows
    torque: Array


def check(dataset: Dataset, published: Friction | None = None) -> Verdict:
    """Verdict on a data set, before any model is fitted.

    Parameters
    ----------
    dataset : Dataset
    published : Friction, optional
        Somebody's model, with mechanism parameters of its own, to hold against the data.

    Examples
    --------
    >>> from frictionid.simulate import Camera, Curve, Rig, Run, Sine, Stribeck, simulate
    >>> runs = [Run(f"{i}", (1.0 + i,), (), (Sine(2.0, 0.4 + 0.3 * i),)) for i in range(3)]
    >>> rig = Rig("demo", {"kind": "pendulum"}, Stribeck(Curve((0.3,), (0.3,), (0.05,))),
    ...           Camera(300, 60.0, 1e-3), (*runs, Run("decay", (2.0,))), substeps=4)
    >>> check(simulate(rig)).level
    'good'
    """
    mended, found = unwrapped(dataset)
    return judge(mended, motions_of(mended.recordings), found, published)


def judge(
    dataset: Dataset,
    motions: Sequence[Motion],
    found: Sequence[Finding] = (),
    published: Friction | None = None,
) -> Verdict:
    """Verdict on a data set without wrapped angles whose motions are known.

    `found` are findings made before; for the rest see `check`.
    """
    facts, clock = joints_of(dataset.recordings, motions), clock_of(dataset.recordings)
    still, where = frozen(dataset, motions)
    dataset, motions = _without(dataset, motions, where)
    held, where = stuck(dataset, plant_of(dataset), motions, impulse_of(dataset.recordings))
    dataset, motions = _without(dataset, motions, where)
    plant = plant_of(dataset)
    mechanism, told = plant.mechanism, np.asarray(plant.p)
    command = commanded(dataset, mechanism)
    impulse = impulse_of(dataset.recordings)
    trial = tried(plant, motions, impulse, judged=not any(f.level == "unusable" for f in command))
    sharp = sharp_rows(mechanism, trial.motions)
    felt = trial.impulse.means(sharp, trial.shift)
    estimate = regress(sharp, felt, mechanism.base_names, told)
    rest = speeds_of(trial.motions).rest
    findings = [
        *found,
        *command,
        *still,
        *held,
        *still_joints(trial.given, facts, mechanism.description.angle_unit),
        *trial.findings,
        *_physics(trial, dataset, estimate, told, rest),
    ]
    passive = passive_time(dataset.recordings, trial.motions, rest)
    model = None
    if published is not None:
        theirs = np.asarray(plant_of(dataset, published.parameters).p)
        model = compared(sharp, felt, estimate, theirs, published)
        findings += incompatible(model)
    findings.sort(key=lambda f: -LEVELS.index(f.level))
    return Verdict(
        dataset=dataset.name,
        level=max((f.level for f in findings), key=LEVELS.index, default="good"),
        findings=tuple(findings),
        clock=clock,
        joints=tuple(facts),
        passive=passive,
        conventions=tuple(trial.conventions),
        delay=trial.delay,
        suspects=tuple(trial.suspects),
        answers=tuple(
            answers(trial, dataset.recordings, told, estimate, {f.kind for f in findings})
        ),
        estimate=estimate,
        told=told[0],
        identifiable=tuple(identifiable(mechanism, facts, estimate, trial, bool(command))),
        next=tuple(advice(mechanism, told[0], facts, passive, estimate, trial.delay)),
        published=model,
        evidence=Evidence(dataset, tuple(trial.motions), sharp, felt),
    )


def _without(
    dataset: Dataset, motions: Sequence[Motion], where: set[int]
) -> tuple[Dataset, Sequence[Motion]]:
    """Data without some recordings, where any remain: their fault would look like others."""
    kept = [i for i in range(len(motions)) if i not in where]
    if not where or not kept:
        return dataset, motions
    recordings = tuple(dataset.recordings[i] for i in kept)
    return replace(dataset, recordings=recordings), [motions[i] for i in kept]


def _physics(
    trial: Trial, dataset: Dataset, estimate: Estimate, told: Array, rest: Array
) -> list[Finding]:
    """What physics forbids, looked at only where nothing explains it already."""
    if not trial.judged or trial.findings:
        return []
    return [
        *energy(trial.mechanism, dataset.recordings, trial.motions, told),
        *gravity_at_rest(trial.rows, trial.impulse, told, rest, estimate),
    ]
