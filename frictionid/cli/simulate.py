"""frictionid simulate: a data set with known friction from a simulated rig."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Replace
from frictionid.cli.paths import present


def simulate(
    rig: Annotated[Path, typer.Argument(help="Settings of the rig, a rig.toml.", callback=present)],
    out: Annotated[Path, typer.Option(help="Folder of the data set to write.")],
    seed: Annotated[int | None, typer.Option(min=0, help="Seed, in place of the rig's.")] = None,
    noise_free: Annotated[bool, typer.Option("--noise-free", help="Exact angles.")] = False,
    json: Json = False,
    replace: Replace = False,
) -> None:
    """Simulate recordings of a rig with known friction."""
    from frictionid import simulate as rigs
    from frictionid.files import json_text

    rigs.check_dataset_folder(out, replace=replace)
    settings = rigs.load_rig(rig)
    settings = rigs.noise_free(settings) if noise_free else settings
    dataset = rigs.simulate(settings, seed)
    # the rig.toml is kept only with the data that it makes as it stands
    same = seed in (None, settings.seed) and not noise_free
    rigs.write_dataset(dataset, out, {"rig.toml": rig.read_bytes()} if same else {})
    samples = sum(len(recording.angle.time) for recording in dataset.recordings)
    if json:
        names = [recording.name for recording in dataset.recordings]
        said = {"dataset": dataset.name, "recordings": names, "samples": samples}
        print(json_text(said | {"written": [out]}), end="")
        return
    print(f"{dataset.name}: {len(dataset.recordings)} recordings, {samples} samples")
    print(f"written to {out}")
