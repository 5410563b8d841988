"""Exported friction in the engines: MuJoCo replays real motion beside our own rollouts.

    FRICTIONID_DATA=FOLDER python comparisons/exported.py

Models are fitted to some recordings and predict others 1 s ahead, from the states that a filter
estimates, under the recorded torques: by our physics step, in MuJoCo with frictionloss and damping
alone, and with the callback. The table of docs/export.md is what this prints. The published M6 of
the servo stands beside ours: read by its own file format, and replayed in MuJoCo in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import mujoco
import numpy as np

import frictionid as fid
from frictionid.data.recordings import Dataset
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.nearest import at_horizon, reaching
from frictionid.evaluation.initial_states import InitialStates
from frictionid.evaluation.predicted_motion import predict
from frictionid.friction import Friction

STEP = 0.0005  # [s], at most, of MuJoCo's RK4
STARTS = 60  # rollouts of each data set


class Row(NamedTuple):
    """Median errors 1 s ahead [rad] over so many starts, and how far the engine is from ours."""

    data: str
    model: str
    ours: float
    joints_alone: float
    callback: float
    apart: float
    starts: int


def with_starts(initial: InitialStates, most: int) -> InitialStates:
    """At most so many initial states that reach the horizon, evenly, all under recorded torque."""
    chosen = reaching(initial)
    rows = np.unique(np.linspace(0, len(chosen.q) - 1, min(most, len(chosen.q))).astype(int))
    return chosen.take(rows)._replace(servos=())


def replay(xml: str, code: str, initial: InitialStates, joints: tuple[str, ...]) -> np.ndarray:
    """Angles (S, n) at the horizon in MuJoCo, under the recorded torques.

    code : of the callback's module; "" for the joints' own friction alone
    """
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    places = [int(model.joint(name).qposadr[0]) for name in joints]
    dofs = [int(model.joint(name).dofadr[0]) for name in joints]
    driven = {model.actuator(k).name: k for k in range(model.nu)}
    out = np.empty_like(initial.q)
    module = ModuleType("callback")
    exec(code, vars(module))
    for s, (q, w) in enumerate(zip(initial.q, initial.w, strict=True)):
        mujoco.mj_resetData(model, data)
        data.qpos[places], data.qvel[dofs] = q, w
        mujoco.set_mjcb_passive(module.Friction(model) if code else None)
        try:
            for k in range(initial.last[-1, s]):
                steps = int(np.ceil(initial.dt[k, s] / STEP - 1e-9))
                model.opt.timestep = initial.dt[k, s] / steps
                for j, name in enumerate(joints):
                    if name in driven:
                        data.ctrl[driven[name]] = initial.u[k, s, j]
                mujoco.mj_step(model, data, steps)
        finally:
            mujoco.set_mjcb_passive(None)
        out[s] = data.qpos[places]
    return out


def files(friction: Friction, data: Dataset) -> Mapping[str, str]:
    """MJCF and callback of a friction at the data's mechanism, by the endings of their names."""
    own = exported(friction, data.mechanism.friction_names, data=data)
    written = writer_of("mujoco")(own, ExportSettings())
    return {ending: content.decode() for ending, content in written.files.items()}


def row(
    name: str, friction: Friction, training: Dataset, data: Dataset, starts: int = STARTS
) -> Row:
    """Errors on one data set of a friction whose joints' numbers are those of the training data."""
    joints = tuple(data.mechanism.joints)
    prepared = exported(friction, data=data).prepared
    assert prepared is not None
    initial = with_starts(prepared.initial_states, starts)
    each = friction[None][np.zeros(len(initial.q), dtype=int)]
    own = at_horizon(predict(prepared.plant[initial.recording], each, initial).q, initial)
    made = files(friction, training)
    code = made.get("_callback.py", "")
    alone = replay(made[".xml"], "", initial, joints)
    called = replay(made[".xml"], code, initial, joints) if code else alone
    measured = at_horizon(initial.measured, initial)

    def off(q: np.ndarray, reference: np.ndarray) -> float:
        return float(np.median(np.linalg.norm(q - reference, axis=-1)))

    errors = [off(q, measured) for q in (own, alone, called)]
    return Row(data.name, name, *errors, off(called, own), len(own))


def halves(data: Dataset) -> tuple[Dataset, Dataset]:
    """Every second recording, and the others."""
    runs = data.recordings
    return replace(data, recordings=runs[::2]), replace(data, recordings=runs[1::2])


def rows() -> Iterator[Row]:
    """All rows of the table."""
    rig, swingups = fid.load_dataset("dfki_c1"), fid.load_dataset("dfki_c1_swingup")
    for law in ("coulomb_viscous", "stribeck", "motor_load"):
        yield row(law, fid.fit(rig, law, method="one_step").friction, rig, swingups)
    shot = fid.fit(
        rig,
        "motor_load",
        method="shooting",
        free=["inertia", "bias", "delay"],
        sample_time=0.01,
        windows=[0.1, 0.3],
    )
    yield row("motor_load, shooting, with inertia", shot.friction, rig, swingups)
    training, held_out = halves(fid.load_dataset("bam_xl330"))
    passive = fid.load_dataset("bam_xl330_passive")
    models: dict[str, Any] = {
        "coulomb_viscous": fid.fit(training, "coulomb_viscous", method="one_step").friction,
        "motor_load": fid.fit(training, "motor_load", method="one_step").friction,
        "gear_load": fid.fit(training, fid.GearLoad(moment=0.48052585), method="one_step").friction,
        "published M6": fid.load_model(
            Path(__file__).parents[1] / "data" / "bam_xl330" / "m6.json"
        ).friction,
    }
    for data in (held_out, passive):
        for name, friction in models.items():
            yield row(name, friction, training, data)


def main() -> None:
    """Print the table in Markdown."""
    print("| data | model | ours | frictionloss, damping | with callback | apart | starts |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for r in rows():
        numbers = (r.ours, r.joints_alone, r.callback, r.apart)
        texts = " | ".join(f"{v:.4f}" for v in numbers)
        print(f"| {r.data} | {r.model} | {texts} | {r.starts} |", flush=True)


if __name__ == "__main__":
    main()
