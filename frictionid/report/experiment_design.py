"""A suggested experiment: as text, and as tables that a drive can play."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.advice import OTHERS, Advice
from frictionid.excitation.motion import MARGIN
from frictionid.excitation.signals import DECIMALS
from frictionid.report.numbers import NOTHING
from frictionid.report.render import render
from frictionid.report.tables import Column, Table, line, terminal_text, words

BINDING = 0.9  # of what the search allows


def command_csv(advice: Advice, recording: int) -> str:
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
    e = advice.experiment
    unit = e.plant.mechanism.description.angle_unit
    noise = math.degrees(e.angle_noise) if unit == "rad" else e.angle_noise
    families = advice.waves.family(advice.x)
    context = {
        "experiment": e,
        "search": advice.search,
        "noise": f"{noise:.3g} {'deg' if unit == 'rad' else unit}",
        "friction": str(e.friction).splitlines()[1:],
        "recordings": list(zip(families, advice.start.tolist(), strict=True)),
        "unit": unit,
        "limits": terminal_text(limit_table(advice)),
        "repetitions": len(advice.repeated.free),
        "errors": terminal_text(error_table(advice)),
        "others": list(exceeded(advice)),
    }
    return render("experiment_design.j2", context, markup=False).rstrip("\n")


def limit_table(advice: Advice) -> Table:
    """Largest torque, velocity and angle of each joint that has a limit."""
    e, m, d = advice.experiment, advice.motions, advice.experiment.plant.mechanism.description
    rows = (
        ("torque", d.torque_unit, np.abs(advice.torque).max((0, 1)), e.limits.torque, 1.0),
        ("velocity", f"{d.angle_unit}/s", np.abs(m.w).max((0, 1, 2)), e.limits.velocity, MARGIN),
        ("angle", d.angle_unit, np.abs(m.q).max((0, 1, 2)), e.limits.angle, MARGIN),
    )
    lines = []
    for name, unit, most, limit, margin in rows:
        for j in np.flatnonzero((limit > 0) & np.isfinite(limit)):
            binding = "binding" if most[j] >= BINDING * margin * limit[j] else ""
            values = f"{most[j]:.4g}", f"{limit[j]:.4g}"
            lines.append(line([name, f"joint {j + 1}", *values, unit, binding]))
    columns = [*words("limit", "joint"), Column("largest"), Column("allowed"), *words("unit", "")]
    return Table("", "limits", tuple(columns), tuple(lines))


def error_table(advice: Advice) -> Table:
    """Expected standard error and bias of each parameter, with the inertia known and free."""
    e, many = advice.experiment, advice.repeated
    law, mechanism = e.friction.law, e.plant.mechanism
    d = mechanism.description
    names = [f"joint {j + 1} {name}" for j in range(e.plant.n) for name in law.names]
    units = [d.torque_unit, f"{d.torque_unit} / ({d.angle_unit}/s)"] * e.plant.n
    units += [base.unit for base in d.base]
    values = [*e.friction.theta.ravel(), *e.plant.p]
    columns = [*words("parameter"), Column("guess")]
    results: list[Sequence[float]] = []
    for inertia, group in ((False, "friction alone"), (True, "inertia free")):
        columns += [Column("std error", group), Column("bias", group)]
        results += [many.errors(inertia=inertia), many.bias(inertia=inertia)]
    lines = []
    for i, name in enumerate([*names, *mechanism.base_names]):
        cells = [f"{own[i]:.2g}" if i < len(own) else NOTHING for own in results]
        lines.append(line([name, f"{values[i]:.4g}", *cells, units[i]]))
    return Table("", "errors", (*columns, *words("unit")), tuple(lines))


def exceeded(advice: Advice) -> Iterator[tuple[float, list[tuple[str, int, float]]]]:
    """Other levels of friction than guessed, with the limits exceeded: name, joint, value."""
    limits = advice.experiment.limits
    q, w = (np.swapaxes(values, 0, 1) for values in (advice.others.q, advice.others.w))
    for k, level in enumerate(OTHERS):
        pairs = (("velocity", w[k], limits.velocity), ("angle", q[k], limits.angle))
        yield level, [over for pair in pairs for over in _over(*pair)]


def _over(name: str, values: Array, limit: Array) -> list[tuple[str, int, float]]:
    most = np.abs(values).max((0, 1))
    return [(name, int(j) + 1, float(most[j])) for j in np.flatnonzero(~(most <= limit))]
