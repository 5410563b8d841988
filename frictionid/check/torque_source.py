"""Where the torque of each motor comes from: measured, commanded, modelled, or cannot tell.

Friction that is fitted to a command includes what the drive adds to it or loses of it; friction
fitted to a motor model includes that model's error. Where the drive follows and the machine is
known, the motion bears a command out, and friction may be fitted to it.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from frictionid.arrays import Array, rms
from frictionid.data.plants import LINK_TORQUE, LINK_TORQUE_REMEDY
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import BY_CONTROLLER
from frictionid.data.signals import Signal, sample
from frictionid.data.state_estimators import resolution

from .facts import noise_of, unexplained_noise
from .findings import Finding, finding, percent
from .hypothesis_tests import HypothesisTests, sampling_findings
from .motion import DISTINCT
from .passive import GravityShares, gravity_shares
from .regression import Estimate, Regression, row_rms, unit_columns

Source = Literal["measured", "commanded", "modelled", "cannot tell"]

# No torque sensor has less noise than this share of the torque's root mean square.
NOISELESS = 3e-4
# A quantisation step below this share may be the digits of a table.
COARSE = 3e-4
# Noise beyond rounding, in steps; rounding alone leaves 0.29.
BEYOND = 0.45
# Root mean square of a torque in steps, below which its noise says nothing.
STEPS = 8.0
# Noise that readings explain but for this share was computed from them (real drives: 0.3 and more).
COMPUTED = 0.15
# Noise above this share of the torque is as likely the command's own.
LOUD = 0.1
# Share of repeated readings from which a torque is held between the controller's samples.
HELD = 0.8
# A column that a covariate and the velocity leave this share of was computed from that covariate.
MODELLED = 3e-3
# Fewest samples that a statement needs, and the most that it uses.
FEWEST, MOST = 60, 20000


# What one recording shows of one motor's torque, and the sentence that shows it.
Evidence = tuple[Source, str]


class TorqueSource(NamedTuple):
    """Source of one motor's torque, from all recordings in which it acts.

    joint : from 1; words : the evidence; recordings : those that show it
    """

    joint: int
    source: Source
    words: str
    recordings: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The statement in one sentence."""
        verdict = "may be measured or not" if self.source == "cannot tell" else f"is {self.source}"
        return f"torque {self.joint} {verdict}: {self.words}"


def torque_sources(
    dataset: Dataset, commanded: GravityShares | None = None
) -> tuple[TorqueSource, ...]:
    """Source of each motor's torque; none for joints without motor or without any torque.

    Examples
    --------
    >>> time = np.arange(500) * 0.002
    >>> angle, torque = np.sin(3 * time)[:, None], np.cos(5 * time)[:, None]
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(torque.shape)
    >>> machine = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 1.0}}
    >>> for value in (torque, np.round((torque + noise) / 0.005) * 0.005):
    ...     swing = Recording("a", Signal(time, angle), Signal(time, value))
    ...     print(torque_sources(Dataset("d", machine, (swing,)))[0].source)
    commanded
    measured
    """
    commanded = gravity_shares(dataset) if commanded is None else commanded
    out = []
    for j in dataset.driven_joints:
        if dataset.torque_at == "command":
            names = tuple(r.name for r in dataset.recordings if r.torque.value[:, j].any())
            declared = 'it is declared so (torque.at = "command")'
            out += [TorqueSource(j + 1, "commanded", declared, names)] if names else []
            continue
        shown = [(r.name, _evidence(r, j, commanded.get((r.name, j)))) for r in dataset.recordings]
        evident = [(name, evidence) for name, evidence in shown if evidence is not None]
        if evident:
            out.append(_together(j + 1, evident))
    return tuple(out)


def source_sentences(sources: Sequence[TorqueSource]) -> tuple[str, ...]:
    """A sentence for each statement, once for all joints of which it is the same.

    >>> both = [TorqueSource(j, "modelled", "by the gains", ("a",)) for j in (1, 2)]
    >>> source_sentences(both)
    ('torque 1, 2 is modelled: by the gains',)
    """
    alike: dict[tuple[str, str], list[TorqueSource]] = {}
    for source in sources:
        alike.setdefault((source.source, source.words), []).append(source)
    return tuple(
        each[0].sentence.replace(
            f"torque {each[0].joint} ", f"torque {', '.join(str(s.joint) for s in each)} ", 1
        )
        for each in alike.values()
    )


def _together(joint: int, shown: Sequence[tuple[str, Evidence]]) -> TorqueSource:
    """The statement of all recordings: one column has one source, unless recordings contradict."""
    decided = [(name, *evidence) for name, evidence in shown if evidence[0] != "cannot tell"]
    if not decided:
        name, (source, words) = shown[0]
        return TorqueSource(joint, source, words, (name,))
    first = {source: (name, words) for name, source, words in reversed(decided)}
    if len(first) == 1:
        name, source, words = decided[0]
        return TorqueSource(joint, source, words, tuple(name for name, _, _ in decided))
    each = sorted(first.items())
    text = "; ".join(f"{source} in {name!r} ({words})" for source, (name, words) in each)
    return TorqueSource(joint, "cannot tell", text, tuple(name for _, (name, _) in each))


def _evidence(recording: Recording, j: int, share: float | None) -> Evidence | None:
    """What a recording shows of motor j; None where its torque is zero or too short.

    share : of the torque that a gravity model leaves, None where it is no such function
    """
    torque = recording.torque
    time, value = torque.time[:MOST], torque.value[:MOST, j]
    level = float(rms(value))
    if level == 0.0 or len(value) < FEWEST:
        return None
    computed = _modelled(recording, time, value)
    if computed is not None:
        return computed
    if recording.servo is not None:
        return "modelled", BY_CONTROLLER
    if share is not None:
        return "commanded", f"it equals a gravity model to {percent(share)}"
    return next(_by_noise(recording.angle, time, value, level))


def _by_noise(angle: Signal, time: Array, value: Array, level: float) -> Iterator[Evidence]:
    """Evidence of steps and noise, the clearest first."""
    step, changes = resolution(value, DISTINCT), np.append(True, np.diff(value) != 0.0)
    held = np.mean(~changes[1:])  # share of the readings that equal the one before
    if step > COARSE * level:
        yield _of_steps(time, value, level, step)
    if held == 1.0:
        yield "cannot tell", "it never changes"
    if held > HELD:
        usual = np.median(np.diff(np.flatnonzero(changes)))
        yield "commanded", f"it is held for {usual:.0f} samples at a time, without noise"
    if changes.sum() < FEWEST:
        yield "cannot tell", "it changes too rarely to show any noise"
    noise = noise_of(time[changes], value[changes])
    same_clock = np.array_equal(time, angle.time[: len(time)])
    readings = angle.value[: len(time)]
    left = unexplained_noise(time, value, readings) if same_clock else 1.0
    share = min(noise.floor, noise.level * left) / level
    if share < NOISELESS:
        yield (
            "commanded",
            f"no quantisation step, and noise of only {share:.1g} of its root mean square",
        )
    if left < COMPUTED:
        yield (
            "commanded",
            f"its noise is that of the angle readings but for {percent(left)}, as of a controller",
        )
    steady = noise.steady and noise.level < LOUD * level and held < 0.05
    size = percent(noise.level / level)
    if steady and same_clock and left > 0.8:
        yield "measured", f"steady white noise of {size} that no angle reading explains"
    yield (
        "cannot tell",
        f"no quantisation step, and noise of {size} that a sensor or a controller may make",
    )


def _of_steps(time: Array, value: Array, level: float, step: float) -> Evidence:
    noise = noise_of(time, value)
    size = f"quantised in steps of {step:.2g} ({percent(step / level)} of its root mean square)"
    if level < STEPS * step:
        return "cannot tell", f"{size}, too small a torque to show more"
    if noise.level > BEYOND * step:
        return "measured", f"{size}, with noise of {noise.level / step:.1f} steps"
    return "cannot tell", f"{size}, without noise beyond rounding"


def _modelled(recording: Recording, time: Array, value: Array) -> Evidence | None:
    """Evidence of a motor model: while it acts, the torque is a covariate plus the velocity."""
    velocity = np.gradient(sample(recording.angle, time), time, axis=0)
    acts = value != 0.0
    columns, value = np.column_stack([velocity, np.ones(len(time))])[acts], value[acts]
    if len(value) < FEWEST or _left(columns, value) < MODELLED:
        return None
    shares = {
        name: _left(np.column_stack([sample(signal, time)[acts], columns]), value)
        for name, signal in recording.covariates.items()
    }
    name = min(shares, key=lambda key: shares[key], default="")
    if not name or shares[name] > MODELLED:
        return None
    covariate = sample(recording.covariates[name], time)[acts]
    alone = _left(np.column_stack([covariate, columns[:, -1:]]), value)
    share, motion = (alone, " alone") if alone <= MODELLED else (shares[name], " and the velocity")
    exactly = "exactly" if share < 1e-6 else f"to {percent(share)}"
    return "modelled", f"it is computed from {name!r}{motion}, {exactly}"


def _left(columns: Array, value: Array) -> float:
    """Share of a torque that least squares on some columns leave, in most samples."""
    level = float(rms(value))
    columns, _ = unit_columns(columns)
    left = value - columns @ np.linalg.lstsq(columns, value, rcond=1e-10)[0]
    return float(np.quantile(np.abs(left), 0.8)) / level


# Coulomb friction in the torques of links: this many standard errors, and residuals of its joint.
ERRORS, RESIDUALS = 5.0, 2.0


def place_findings(tests: HypothesisTests, estimate: Estimate) -> Iterator[Finding]:
    """Findings of torques at links and of commands; none of torques at motors."""
    place = tests.measured.dataset.torque_at
    if place == "link":
        yield finding("link_torque", {}, {"sentence": LINK_TORQUE, "remedy": LINK_TORQUE_REMEDY})
        yield from _friction_at_links(tests, estimate)
    elif place == "command":
        yield finding("declared_command", {})


def _friction_at_links(tests: HypothesisTests, estimate: Estimate) -> Iterator[Finding]:
    """Friction that sensors behind the gears cannot feel, and yet shows."""
    if not tests.done:
        return
    for j, unit in enumerate(tests.measured.mechanism.torque_units):
        level, error = estimate.at(f"coulomb_{j + 1}")
        if level > ERRORS * error and level > RESIDUALS * float(estimate.spread[j]):
            numbers = {"coulomb": level, "error": error}
            yield finding("friction_at_link", numbers, {"unit": unit}, j + 1)


# Least squares may leave this share of a joint's torque, or this many times the noise of the motion
# (simulated drives that follow: up to 0.09 and 4.6; a real arm under its commands: 0.13 to 0.27).
LEFT, NOISE = 0.1, 3.0


def unmeasured_findings(
    sources: Sequence[TorqueSource],
    tests: HypothesisTests,
    regression: Regression,
    estimate: Estimate,
) -> Iterator[Finding]:
    """Findings of commanded and modelled torques that the motion does not bear out.

    None where the motion is not known well enough.
    """
    wrong = any(f.kind in ("constant_angle", "zero") for f in tests.findings)
    if not tests.done or wrong or sampling_findings(tests.measured):
        return
    share, times = _motion_left(regression, estimate)
    low, high = tests.delay.interval if tests.delay else (0.0, 0.0)
    lag = f" and follows it by {1e3 * low:.0f} to {1e3 * high:.0f} ms" if low > 0 else ""
    for source in sources:
        j = source.joint - 1
        if source.source in ("commanded", "modelled") and share[j] >= LEFT and times[j] >= NOISE:
            yield finding(
                "unmeasured_torque",
                {"left": float(share[j]), "noise": float(times[j])},
                {"sentence": source.sentence, "lag": lag},
                source.joint,
                kind=f"{source.source}_torque",
            )


def _motion_left(regression: Regression, estimate: Estimate) -> tuple[Array, Array]:
    """Residual (n,) of the least squares: as a share of the torque, and over the motion's noise."""
    measured, rows = regression.measured, regression.rows
    change = estimate.value[: measured.nominal.shape[1]] - measured.nominal[0]
    needed = rows.required(measured.nominal + change)
    size = np.maximum(*(row_rms(x, rows.moving) for x in (regression.torque, needed)))
    noise = measured.momentum_noise / float(np.median(rows.stop - rows.start))
    tiny = np.finfo(float).tiny
    return estimate.spread / np.maximum(size, tiny), estimate.spread / np.maximum(noise, tiny)
