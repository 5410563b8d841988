"""A design as text, and as a table that a drive can play."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.design import OTHER_SCALES, Design
from frictionid.excitation.motion import MARGIN
from frictionid.excitation.signals import DECIMALS

_BINDING = 0.9  # of what the search allows


def torque_table(design: Design, recording: int) -> str:
    """CSV text of one recording: time [s], a torque column per motor, each held to the next."""
    motors = design.space.motors
    lines = ["time," + ",".join(f"u{j + 1}" for j in motors)]
    for time, row in zip(
        design.experiment.commands, design.torque[:, recording, motors], strict=True
    ):
        cells = (f"{v + 0.0:.{DECIMALS}f}" for v in row)
        lines.append(f"{time:.9g}," + ",".join(cells))
    return "\n".join(lines) + "\n"


def describe(design: Design) -> str:
    """The signals, their motion against the limits, and the expected standard errors."""
    parts = (_plan(design), _prior(design), _recordings(design), _limits(design), _errors(design))
    return "\n".join(line for part in (*parts, _other_friction(design)) for line in part)


def _units(design: Design) -> tuple[str, str, str]:
    d = design.experiment.plant.mechanism.description
    return d.torque_unit, f"{d.angle_unit}/s", d.angle_unit


def _plan(design: Design) -> Iterator[str]:
    e, s = design.experiment, design.search
    unit = _units(design)[2]
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


def _prior(design: Design) -> Iterator[str]:
    yield "prior friction (measure, fit, and give the result as --friction for a better signal):"
    yield from str(design.experiment.friction).splitlines()[1:]


def _recordings(design: Design) -> Iterator[str]:
    unit = _units(design)[2]
    for r, (start, names) in enumerate(
        zip(design.start, design.space.family(design.x), strict=True), start=1
    ):
        angles = ", ".join(f"{a:g}" for a in start)
        yield f"recording {r}: {' and '.join(names)}; start at rest from {angles} {unit}"


def peaks(design: Design) -> list[tuple[str, Array, Array, str]]:
    """Name, largest magnitude (n,), limit (n,) and unit of torque, velocity and angle."""
    e, m, (torque, velocity, angle) = design.experiment, design.motions, _units(design)
    return [
        ("torque", np.abs(design.torque).max((0, 1)), e.limits.torque, torque),
        ("velocity", np.abs(m.w).max((0, 1, 2)), e.limits.velocity, velocity),
        ("angle", np.abs(m.q).max((0, 1, 2)), e.limits.angle, angle),
    ]


def _limits(design: Design) -> Iterator[str]:
    yield "limits:"
    for name, most, limit, unit in peaks(design):
        allowed = limit if name == "torque" else MARGIN * limit
        for j in np.flatnonzero((limit > 0) & np.isfinite(limit)):
            binds = "  binding" if most[j] >= _BINDING * allowed[j] else ""
            yield f"  {name:8s} joint {j + 1}  {most[j]:.4g} of {limit[j]:.4g} {unit}{binds}"


def _errors(design: Design) -> Iterator[str]:
    e = design.experiment
    law, mechanism = e.friction.law, e.plant.mechanism
    names = [f"joint {j + 1} {name}" for j in range(e.plant.n) for name in law.names]
    torque, velocity, _ = _units(design)
    units = [torque, f"{torque} / ({velocity})"] * e.plant.n
    units += [b.unit for b in mechanism.description.base]
    values = [*e.friction.theta.ravel(), *e.plant.p]
    many, blank = design.monte_carlo, [None] * len(mechanism.base_names)
    columns = [
        [*many.errors(inertia=False), *blank],
        [*many.bias(inertia=False), *blank],
        many.errors(inertia=True),
        many.bias(inertia=True),
    ]
    yield f"expected of a fit, by {len(many.everything)} simulated repetitions:"
    yield f"  {'':20s} {'':>10s} {'friction alone':>21s} {'inertia free':>21s}"
    yield f"  {'':20s} {'prior':>10s}" + f" {'std error':>11s} {'bias':>9s}" * 2
    for name, value, unit, *cells in zip(
        [*names, *mechanism.base_names], values, units, *columns, strict=True
    ):
        row = "".join(
            f" {'' if c is None else f'{c:.2g}':>{width}s}"
            for c, width in zip(cells, (11, 9, 11, 9), strict=True)
        )
        yield f"  {name:20s} {value:10.4g}{row}  {unit}"
    yield (
        "bias: error of the smoothing, whatever the noise; more images a second make it smaller, "
        "more recordings do not"
    )


def _other_friction(design: Design) -> Iterator[str]:
    """The motion against the limits if the prior friction is wrong."""
    limits = design.experiment.limits
    for level, q, w in zip(
        OTHER_SCALES,
        np.swapaxes(design.others.q, 0, 1),
        np.swapaxes(design.others.w, 0, 1),
        strict=True,
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
        result = "beyond the limits: " + ", ".join(over) if over else "within the limits"
        yield f"with {level:g} times that friction: {result}"
