"""frictionid suggest and simulate: what to record, and data with known friction."""

from pathlib import Path
from typing import Any

import frictionid as fid

from .command import PresentPath, counted, numbers, show

_TWO = "be two numbers [Hz], e.g. 0.2,4"
_NUMBERS = "be numbers with commas, e.g. 0.5,1"


def suggest(
    *,
    mechanism: PresentPath,
    limits: str,
    out: Path,
    friction: str = "",
    recordings: int = 4,
    length: float = 5.0,
    frequencies: str = "0.2,4",
    start: str = "",
    drive_rate: float = 60.0,
    camera_rate: float = 60.0,
    noise: float = 0.1,
    robust: bool = False,
    effort: int = 600,
    trajectory: bool = False,
    figure: Path | None = None,
    seed: int = 0,
    json: bool = False,
    replace: bool = False,
) -> None:
    """Suggest torque signals or trajectories, and say how well friction will be known from them.

    Parameters
    ----------
    mechanism : Any TOML file with a [mechanism] table.
    limits : E.g. "torque=0.14,velocity=[10,20],angle=3.1"; SI units.
    out : Torque table to write (CSV).
    friction : Prior, e.g. "coulomb=[0.1,0.05],viscous=0.001" [5 % of torque].
    recordings : Number of recordings; several are written to OUT_1.csv ...
    length : Length of each [s].
    frequencies : Lowest and highest [Hz].
    start : Start angles, e.g. 0,0 [searched].
    drive_rate : Commands per second [Hz].
    camera_rate : Images per second [Hz].
    noise : Angle noise, standard deviation [deg], or [mm].
    robust : Design also for half and twice the prior friction.
    effort : Number of random signals that the search starts from.
    trajectory : Design positions for a controller to follow (Fourier series), as for an arm.
    figure : Picture to write (PNG).
    seed : Seed of the search.
    """
    from frictionid.api.suggest import stages
    from frictionid.excitation import load_mechanism
    from frictionid.files import write_bytes, write_text
    from frictionid.outputs import check_outputs
    from frictionid.report.experiment_design import DECIMALS, FINE, csv_of
    from frictionid.report.figures.style import png

    places = _places(out, max(1, recordings))
    check_outputs([*places, figure], [mechanism], replace=replace)
    asked = load_mechanism(mechanism), limits, friction
    steps = recordings if trajectory else stages(effort, seed)
    with counted(steps, "searching") as done:
        size: Any = {"recordings": recordings, "length": length, "effort": effort, "seed": seed}
        if trajectory:
            designed: Any = fid.suggest_trajectories(*asked, done=done, **size)
        else:
            designed = fid.suggest(
                *asked,
                frequencies=numbers("--frequencies", frequencies, _TWO, 2),
                start=numbers("--start", start, _NUMBERS) if start.strip() else None,
                drive_rate=drive_rate,
                camera_rate=camera_rate,
                noise=noise,
                robust=robust,
                done=done,
                **size,
            )
    frames = designed.frames(drive_rate) if trajectory else designed.frames
    decimals = FINE if trajectory else DECIMALS
    for path, frame in zip(places, frames.values(), strict=True):
        write_text(path, csv_of(frame, decimals))
    if figure is not None:
        write_bytes(figure, png(designed.draw))
    show(designed, designed.document, (*places, figure), json=json)


def _places(out: Path, recordings: int) -> list[Path]:
    """The file itself for one recording, else numbered ones: a drive plays one at a time."""
    if recordings == 1:
        return [out]
    return [out.with_name(f"{out.stem}_{r + 1}{out.suffix}") for r in range(recordings)]


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
    counts = {"dataset": dataset.name, "recordings": dataset.names, "samples": samples}
    text = f"{dataset.name}: {len(dataset.names)} recordings, {samples} samples"
    show(text, counts, [out], json=json)
