"""frictionid simulate: a data set with known friction from a simulated rig."""

from pathlib import Path

import frictionid as fid

from .options import PresentPath
from .progress import show


def simulate(
    rig: PresentPath,
    *,
    out: Path,
    seed: int | None = None,
    noise_free: bool = False,
    json: bool = False,
    replace: bool = False,
) -> None:
    """Simulate recordings of a rig with known friction.

    Parameters
    ----------
    rig : Settings of the rig, a rig.toml.
    out : Folder of the data set to write.
    seed : Seed, in place of the rig's.
    noise_free : Exact angles.
    """
    from frictionid.files import read_bytes
    from frictionid.simulate import check_dataset_folder, load_rig, write_dataset

    check_dataset_folder(out, replace=replace)
    settings = load_rig(rig)
    dataset = fid.simulate(settings, seed, noise_free=noise_free)
    # the rig.toml is kept only with the data that it makes as it stands
    same = seed in (None, settings.seed) and not noise_free
    write_dataset(dataset, out, {"rig.toml": read_bytes(rig)} if same else {}, replace=replace)
    samples = sum(len(recording.angle.time) for recording in dataset.recordings)
    numbers = {"dataset": dataset.name, "recordings": dataset.names, "samples": samples}
    text = f"{dataset.name}: {len(dataset.names)} recordings, {samples} samples"
    show(text, numbers, [out], json=json)
