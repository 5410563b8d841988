"""Exported friction in the engines: MuJoCo replays real motion beside our own rollouts.

    FRICTIONID_DATA=FOLDER python comparisons/exported.py

Models are fitted to some recordings and predict others 1 s ahead, from the states that a filter
estimates, under logged torques or targets: by our physics step, in MuJoCo by the file as it is, and
with the callback beside it. docs/export.md has rows of this table. The published M6 of
the servo stands beside ours: read by its own file format, and replayed in MuJoCo in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import frictionid as fid
from frictionid.data.recordings import Dataset
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.round_trip import in_mujoco
from frictionid.friction import Friction

STARTS = 60  # rollouts of each data set


class Row(NamedTuple):
    """Median errors 1 s ahead [rad] over so many starts, and mean distances from our predictions.

    alone : of the file as it is; callback : with the module beside it, where there is one
    """

    data: str
    model: str
    ours: float
    alone: float
    alone_apart: float
    callback: float
    callback_apart: float
    starts: int


def files(friction: Friction, data: Dataset) -> Mapping[str, str]:
    """MJCF and callback of a friction at the data's mechanism, by the endings of their names."""
    own = exported(friction, data.mechanism.friction_names, data=data)
    written = writer_of("mujoco")(own, ExportSettings())
    return {ending: content.decode() for ending, content in written.files.items()}


def row(
    name: str, friction: Friction, training: Dataset, data: Dataset, starts: int = STARTS
) -> Row:
    """Errors on one data set of a friction whose joints' numbers are those of the training data."""
    own = exported(friction, data.mechanism.friction_names, data=data)
    made = files(friction, training)
    alone = in_mujoco(own, made[".xml"], most=starts)
    assert alone is not None
    called = alone
    if code := made.get("_callback.py"):
        module = ModuleType("callback")
        exec(code, vars(module))
        called = in_mujoco(own, made[".xml"], module.Friction, starts)
        assert called is not None
    distances = (alone.mean_apart, called.held, called.mean_apart)
    return Row(data.name, name, alone.model, alone.held, *distances, alone.predictions)


def halves(data: Dataset) -> tuple[Dataset, Dataset]:
    """Every second recording, and the others."""
    runs = data.recordings
    return replace(data, recordings=runs[::2]), replace(data, recordings=runs[1::2])


def rows() -> Iterator[Row]:
    """All rows of the table."""
    rig, swingups = fid.load_dataset("dfki_c1"), fid.load_dataset("dfki_c1_swingup")
    for law in ("coulomb_viscous", "stribeck", "lugre", "motor_load"):
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
    models: dict[str, Any] = {
        "coulomb_viscous": fid.fit(training, "coulomb_viscous", method="one_step").friction,
        "motor_load": fid.fit(training, "motor_load", method="one_step").friction,
        "gear_load": fid.fit(training, fid.GearLoad(moment=0.48052585), method="one_step").friction,
        "published M6": fid.load_model(
            Path(__file__).parents[1] / "data" / "bam_xl330" / "m6.json"
        ).friction,
    }
    for name, friction in models.items():
        yield row(name, friction, training, held_out)


def main() -> None:
    """Print the table in Markdown."""
    print("| data | model | ours | MuJoCo | apart | with callback | apart | predictions |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for r in rows():
        texts = " | ".join(f"{v:.4f}" for v in r[2:-1])
        print(f"| {r.data} | {r.model} | {texts} | {r.starts} |", flush=True)


if __name__ == "__main__":
    main()
