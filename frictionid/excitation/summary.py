"""The suggestion in words, and as a table that a drive can play."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.advice import OTHERS, Advice
from frictionid.excitation.motion import MARGIN
from frictionid.excitation.signals import DECIMALS

_BINDS = 0.9  # of what the search allows


def played(advice: Advice, recording: int) -> str:
    """CSV text of one recording: time [s], a torque column per motor, each held to the next."""
    motors = advice.waves.motors
    lines = ["time," + ",".join(f"u{j + 1}" for j in motors)]
    for time, row in zip(
        advice.experiment.commands, advice.torque[:, recording, motors], strict=True
    ):
        cells = (f"{v + 0.0:.{DECIMALS}f}" for v in row)
        lines.append(f"{time:.9g}," + ",".join(cells))
    return "\n".join(lines) + "\n"


def described(advice: Advice) -> str:
    """The suggestion, its motion against the limits, and the expected standard errors."""
    parts = (_plan(advice), _guess(advice), _recordings(advice), _limits(advice), _errors(advice))
    return "\n".join(line for part in (*parts, _elsewhere(advice)) for line in part)


def _units(advice: Advice) -> tuple[str, str, str]:
    d = advice.experiment.plant.mechanism.description
    return d.torque_unit, f"{d.angle_unit}/s", d.angle_unit


def _plan(advice: Advice) -> Iterator[str]:
    e, s = advice.experiment, advice.search
    unit = _units(advice)[2]
    noise = (
        f"{math.degrees(e.angle_noise):.3g} deg" if unit == "rad" else f"{e.angle_noise:.3g} {unit}"
    )
    yield (
        f"{e.recordings} recording{'s' * (e.recordings > 1)} of {e.length:g} s, torque at "
        f"{e.drive_rate:g} Hz with {e.band[0]:g} to {e.band[1]:g} Hz in it; "
        f"camera {e.camera_rate:g} Hz, noise {noise}"
    )
    yield (
        f"searched with seed {s.seed}: {s.pool} signals, then {s.generations} generations of "
        f"{s.children}"
    )


def _guess(advice: Advice) -> Iterator[str]:
    yield "friction that was guessed (measure, fit, and give it as --friction for a better signal):"
    yield from str(advice.experiment.friction).splitlines()[1:]


def _recordings(advice: Advice) -> Iterator[str]:
    unit = _units(advice)[2]
    for r, (start, names) in enumerate(
        zip(advice.start, advice.waves.family(advice.x), strict=True), start=1
    ):
        angles = ", ".join(f"{a:g}" for a in start)
        yield f"recording {r}: {' and '.join(names)}; start at rest from {angles} {unit}"


def peaks(advice: Advice) -> list[tuple[str, Array, Array, str]]:
    """Name, largest magnitude (n,), limit (n,) and unit of torque, velocity and angle."""
    e, m, (torque, velocity, angle) = advice.experiment, advice.motions, _units(advice)
    return [
        ("torque", np.abs(advice.torque).max((0, 1)), e.limits.torque, torque),
        ("velocity", np.abs(m.w).max((0, 1, 2)), e.limits.velocity, velocity),
        ("angle", np.abs(m.q).max((0, 1, 2)), e.limits.angle, angle),
    ]


def _limits(advice: Advice) -> Iterator[str]:
    yield "limits:"
    for name, most, limit, unit in peaks(advice):
        allowed = limit if name == "torque" else MARGIN * limit
        for j in np.flatnonzero((limit > 0) & np.isfinite(limit)):
            binds = "  binding" if most[j] >= _BINDS * allowed[j] else ""
            yield f"  {name:8s} joint {j + 1}  {most[j]:.4g} of {limit[j]:.4g} {unit}{binds}"


def _errors(advice: Advice) -> Iterator[str]:
    e = advice.experiment
    law, mechanism = e.friction.law, e.plant.mechanism
    names = [f"joint {j + 1} {name}" for j in range(e.plant.n) for name in law.names]
    torque, velocity, _ = _units(advice)
    units = [torque, f"{torque} / ({velocity})"] * e.plant.n
    units += [b.unit for b in mechanism.description.base]
    values = [*e.friction.theta.ravel(), *e.plant.p]
    many, blank = advice.repeated, [None] * len(mechanism.base_names)
    columns = [
        [*many.errors(inertia=False), *blank],
        [*many.bias(inertia=False), *blank],
        many.errors(inertia=True),
        many.bias(inertia=True),
    ]
    yield f"expected of a fit, by {len(many.free)} simulated repetitions:"
    yield f"  {'':20s} {'':>10s} {'friction alone':>21s} {'inertia free':>21s}"
    yield f"  {'':20s} {'guess':>10s}" + f" {'std error':>11s} {'bias':>9s}" * 2
    for name, value, unit, *cells in zip(
        [*names, *mechanism.base_names], values, units, *columns, strict=True
    ):
        row = "".join(
            f" {'' if c is None else f'{c:.2g}':>{width}s}"
            for c, width in zip(cells, (11, 9, 11, 9), strict=True)
        )
        yield f"  {name:20s} {value:10.4g}{row}  {unit}"
    yield (
        "bias: what smoothing bends, whatever the noise; more images a second make it smaller, "
        "more recordings do not"
    )


def _elsewhere(advice: Advice) -> Iterator[str]:
    """What the limits see if friction is not as guessed."""
    limits = advice.experiment.limits
    for level, q, w in zip(
        OTHERS, np.swapaxes(advice.others.q, 0, 1), np.swapaxes(advice.others.w, 0, 1), strict=True
    ):
        over = [
            f"{name} of joint {j + 1} {most[j]:.3g}"
            for name, values, limit in (
                ("velocity", w, limits.velocity),
                ("angle", q, limits.angle),
            )
            for most in [np.abs(values).max((0, 1))]
            for j in np.flatnonzero(~(most <= limit))
        ]
        told = "beyond the limits: " + ", ".join(over) if over else "within the limits"
        yield f"with {level:g} times that friction: {told}"
