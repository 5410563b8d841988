"""frictionid.simulate: a data set with known, set-valued friction, from a simulated rig."""

from pathlib import Path

from frictionid.data.recordings import Dataset
from frictionid.simulate import Rig, load_rig
from frictionid.simulate import noise_free as without_noise
from frictionid.simulate import simulate as simulated


def simulate(
    rig: Rig | str | Path, seed: int | None = None, *, noise_free: bool = False
) -> Dataset:
    """Recordings of a rig with known friction.

    Parameters
    ----------
    rig : Rig, or path of a rig.toml
    seed : int, optional
        In place of the rig's.
    noise_free : bool
        Whether angles are free of noise.

    Raises
    ------
    InputError
        Where the file cannot be read, or says what no rig can do.
    """
    settings = rig if isinstance(rig, Rig) else load_rig(Path(rig))
    return simulated(without_noise(settings) if noise_free else settings, seed)
