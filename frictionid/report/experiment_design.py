"""A designed experiment: as text, as tables that a drive can play, and in pictures."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import zip_longest
from typing import Any

import numpy as np
import pandas as pd

from frictionid.excitation.design import OTHER_SCALES, Design
from frictionid.excitation.experiment import DECIMALS
from frictionid.excitation.information import MARGIN
from frictionid.excitation.trajectory_design import TrajectoryDesign

from .figures import style
from .numbers import NOTHING, either
from .tables import Column, Table, render, table_of, terminal_text, text_columns

GROUPS = {"friction_alone": False, "inertia_free": True}  # whether the inertia is free
BINDING = 0.9  # of what the search allows


def command_frame(design: Design, recording: int) -> pd.DataFrame:
    """Torques of one recording: time [s], a column u1, u2 ... per motor, each held to the next."""
    columns = {"time": design.experiment.commands}
    columns |= {f"u{j + 1}": design.torque[:, recording, j] for j in design.experiment.motors}
    return pd.DataFrame(columns)


def trajectory_frame(design: TrajectoryDesign, number: int, rate: float) -> pd.DataFrame:
    """One period of a trajectory at so many samples per second [Hz].

    Columns: time [s], then position, velocity and acceleration of each joint, q1 w1 a1 q2 ..., SI.
    """
    time = np.arange(round(design.task.length * rate) + 1) / rate
    columns = {"time": time}
    for j, reference in enumerate(design.trajectories[number].references, start=1):
        motion = zip("qwa", reference.motion(time), strict=True)
        columns |= {f"{name}{j}": values for name, values in motion}
    return pd.DataFrame(columns)


def csv_of(frame: pd.DataFrame, decimals: int = DECIMALS) -> str:
    """CSV text of a table over time; no zero has a sign."""
    shown = (frame + 0.0).assign(time=frame["time"].map("{:.9g}".format))
    return shown.to_csv(index=False, float_format=f"%.{decimals}f", lineterminator="\n")


def described(design: Design) -> str:
    """The signals, their motion against the limits, and the expected standard errors."""
    e = design.experiment
    units = e.plant.mechanism.position_units
    noise = dict.fromkeys(
        f"{math.degrees(sigma):.3g} deg" if unit == "rad" else f"{sigma:.3g} {unit}"
        for sigma, unit in zip(e.noise, units, strict=True)
    )
    families = design.experiment.family_of(design.x)
    context = {
        "experiment": e,
        "search": design.search,
        "noise": ", ".join(noise),
        "friction": str(e.friction).splitlines()[1:],
        "recordings": list(zip(families, design.start.tolist(), strict=True)),
        "unit": either(units),
        "limits": terminal_text(limit_table(design)),
        "repetitions": len(design.monte_carlo.everything),
        "errors": terminal_text(error_table(design)),
        "others": list(exceeded(design)),
    }
    return render("experiment_design.j2", context, markup=False).rstrip("\n")


def limit_table(design: Design) -> Table:
    """Largest torque, velocity and angle of each joint that has a limit."""
    e, m, d = design.experiment, design.motions, design.experiment.plant.mechanism
    rows = (
        ("torque", d.torque_units, design.torque[None], e.limits.torque, 1.0),
        ("velocity", d.velocity_units, m.w, e.limits.velocity, MARGIN),
        ("angle", d.position_units, m.q, e.limits.angle, MARGIN),
    )
    shown = []
    for name, units, values, limit, margin in rows:
        most = np.abs(values).max((0, 1, 2))
        for j in np.flatnonzero((limit > 0) & np.isfinite(limit)):
            binding = "binding" if most[j] >= BINDING * margin * limit[j] else ""
            sizes = f"{most[j]:.4g}", f"{limit[j]:.4g}"
            shown.append([name, f"joint {j + 1}", *sizes, units[j], binding])
    heads = (*text_columns("limit", "joint"), "largest", "allowed", *text_columns("unit", ""))
    return table_of(heads, shown)


def error_table(design: Design) -> Table:
    """Expected standard error and bias of each parameter, with the inertia known and free."""
    words = [group.replace("_", " ") for group in GROUPS]
    heads = [Column(name, group) for group in words for name in ("std error", "bias")]
    rows = []
    for entry in _parameters(design):
        sizes = [entry[group] or {"error": None, "bias": None} for group in GROUPS]
        cells = [NOTHING if v is None else f"{v:.2g}" for size in sizes for v in size.values()]
        rows.append([entry["name"], f"{entry['prior']:.4g}", *cells, entry["unit"]])
    return table_of([*text_columns("parameter"), "prior", *heads, *text_columns("unit")], rows)


def design_document(design: Design) -> dict[str, Any]:
    """The signals and the expected errors of each parameter, for scripts; SI units.

    Errors are null for parameters of the mechanism where it is taken as known.
    """
    families = design.experiment.family_of(design.x)
    return {
        "recordings": [
            {"family": family, "start": start}
            for family, start in zip(families, design.start.tolist(), strict=True)
        ],
        "length": design.experiment.length,
        "parameters": _parameters(design),
        "exceeded": [
            {"friction_scale": level, "limit": name, "joint": joint, "value": value}
            for level, over in exceeded(design)
            for name, joint, value in over
        ],
    }


def _parameters(design: Design) -> list[dict[str, Any]]:
    """Each friction and base parameter: name, unit, prior, and its expected errors by group."""
    e, many = design.experiment, design.monte_carlo
    law, mechanism = e.friction.law, e.plant.mechanism
    torque, velocity = mechanism.torque_units, mechanism.velocity_units
    names = [f"joint {j + 1} {name}" for j in range(e.plant.n) for name in law.names]
    units = [u for t, w in zip(torque, velocity, strict=True) for u in (t, f"{t} / ({w})")]
    values = map(float, (*e.friction.theta.ravel(), *e.plant.p))
    entries: list[dict[str, Any]] = [
        {"name": name, "unit": unit, "prior": value}
        for name, unit, value in zip(
            (*names, *mechanism.base_names), (*units, *mechanism.base_units), values, strict=True
        )
    ]
    for group, inertia in GROUPS.items():
        pairs = zip(many.errors(inertia=inertia), many.bias(inertia=inertia), strict=True)
        for entry, pair in zip_longest(entries, pairs):
            entry[group] = pair and dict(zip(("error", "bias"), pair, strict=True))
    return entries


def exceeded(design: Design) -> Iterator[tuple[float, list[tuple[str, int, float]]]]:
    """Other scales of the prior friction, with the limits exceeded: name, joint, value."""
    limits = design.experiment.limits
    q, w = (np.swapaxes(values, 0, 1) for values in (design.others.q, design.others.w))
    for k, level in enumerate(OTHER_SCALES):
        over = []
        parts = (("velocity", w[k], limits.velocity), ("angle", q[k], limits.angle))
        for name, values, limit in parts:
            most = np.abs(values).max((0, 1))
            over += [(name, int(j) + 1, float(most[j])) for j in np.flatnonzero(~(most <= limit))]
        yield level, over


FINE = 9  # decimals of a trajectory


def trajectory_text(design: TrajectoryDesign) -> str:
    """The motion against the limits, and the expected standard errors of friction."""
    context = {
        "task": design.task,
        "table": terminal_text(trajectory_table(design)),
        "unsure": [design.task.plant.mechanism.joints[j] for j in design.unsure],
    }
    return render("trajectory_design.j2", context, markup=False).rstrip("\n")


def trajectory_table(design: TrajectoryDesign) -> Table:
    """Largest position, velocity and torque of each joint, and the errors of its friction."""
    task, mechanism = design.task, design.task.plant.mechanism
    largest = [
        np.max([np.abs(getattr(t, name)).max(axis=0) for t in design.trajectories], axis=0)
        for name in ("q", "w", "torque")
    ]
    limits = (task.limits.angle, task.limits.velocity, task.limits.torque)
    groups = ("position", "velocity", "torque")
    heads = [*text_columns("joint"), *(Column(h, g) for g in groups for h in ("largest", "limit"))]
    heads += [Column(name, "std error [%]") for name in task.friction.law.names]
    rows = []
    for j, joint in enumerate(mechanism.joints):
        pairs = zip(largest, limits, strict=True)
        sizes = [f"{values[j]:.3g}" for pair in pairs for values in pair]
        rows.append([joint, *sizes, *(f"{100 * e:.2g}" for e in design.error[j])])
    return table_of(heads, rows)


def trajectory_document(design: TrajectoryDesign) -> dict[str, Any]:
    """Coefficients, as `references` of a rig.toml has them, and expected errors; SI units."""
    task, joints = design.task, []
    keys = [f"{name}_relative_error" for name in task.friction.law.names]
    for j, joint in enumerate(task.plant.mechanism.joints):
        errors = dict(zip(keys, map(float, design.error[j]), strict=True))
        joints.append({"joint": joint, **errors, "unsure": j in design.unsure})
    return {
        "length": task.length,
        "trajectories": [
            {"references": [asdict(reference) for reference in trajectory.references]}
            for trajectory in design.trajectories
        ],
        "joints": joints,
    }


# --- Pictures -------------------------------------------------------------------------------------


def design_figure(design: Design) -> Any:
    """Torque, angles and velocities over time, one column for each recording."""
    e = design.experiment
    d = e.plant.mechanism
    looks = _looks([f"joint {j + 1}" for j in range(e.plant.n)])
    rows = (
        ("torque", d.torque_units, e.commands, design.torque, e.limits.torque),
        ("angle", d.position_units, e.images, design.motions.q[:, 0], e.limits.angle),
        ("velocity", d.velocity_units, e.images, design.motions.w[:, 0], e.limits.velocity),
    )

    def draw(axis: Any, row: int, recording: int) -> None:
        axis.grid()
        name, _, time, values, limit = rows[row]
        for j, look in enumerate(looks.values()):
            held = name == "torque"
            if held and limit[j] == 0.0:
                continue  # none is shown without a motor
            drawstyle = "steps-post" if held else "default"
            axis.plot(time, values[:, recording, j], **look, drawstyle=drawstyle)
            for end in (-limit[j], limit[j]) if np.isfinite(limit[j]) else ():
                axis.axhline(end, color=look["color"], linewidth=0.8, linestyle="--")

    labels = [f"{name} [{either(units)}]" for name, units, *_ in rows]
    titles = [f"recording {r + 1}" for r in range(e.recordings)]
    return _over_time(draw, labels, titles, looks)


def trajectory_figure(design: TrajectoryDesign) -> Any:
    """Share of its limit that each joint uses, one column for each trajectory."""
    task, looks = design.task, _looks(design.task.plant.mechanism.joints)
    rows = (("position", "q", "angle"), ("velocity", "w", "velocity"), ("torque",) * 3)

    def draw(axis: Any, row: int, number: int) -> None:
        axis.grid()
        _, name, limit = rows[row]
        values = getattr(design.trajectories[number], name) / getattr(task.limits, limit)
        for j, look in enumerate(looks.values()):
            axis.plot(task.time, values[:, j], **look)
        for end in (-1.0, 1.0):
            axis.axhline(end, color="0.3", linewidth=0.8, linestyle="--")
        axis.set_yticks(np.linspace(-1.0, 1.0, 5))

    titles = [f"trajectory {number + 1}" for number in range(len(design.trajectories))]
    return _over_time(draw, [f"{label} / limit" for label, *_ in rows], titles, looks)


def _looks(joints: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Colour and kind of line of each joint."""
    count = len(style.COLOURS)
    return {
        name: {
            "color": style.COLOURS[j % count],
            "linestyle": "-" if j < count else ":",
            "linewidth": 1,
        }
        for j, name in enumerate(joints)
    }


def _over_time(
    draw: Callable[[Any, int, int], None],
    labels: Sequence[str],
    titles: Sequence[str],
    looks: Mapping[str, Mapping[str, Any]],
) -> Any:
    key = {name: style.line(**look) for name, look in looks.items()}
    size = 2.0, 1.5 + 4.2 * len(titles)
    return style.panels(draw, labels, titles, key, "time [s]", *size, sharex=True, sharey="row")
