"""frictionid.machines and frictionid.machine: cards of identified machines, which come along."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.data.servo import PositionControl
from frictionid.files import model_path, read_json, shipped, shipped_names
from frictionid.friction import Friction
from frictionid.mechanics import Mechanism, mechanism_of

from .fitted import Fit
from .models import friction_of


class HeldOut(NamedTuple):
    """Error on motion that the judged fit has not seen, the same without friction, and of what."""

    error: float
    without: float
    unit: str
    what: str


class Nearest(NamedTuple):
    """Coulomb and viscous friction (n, 2) nearest to a law along the recordings, and its cost.

    published : whether it is somebody's in place of that
    """

    theta: Array
    cost: str
    published: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Machine:
    """A card: an identified machine, or a published model of one.

    Attributes
    ----------
    name, title : str
    fit : Fit
        Friction and calibration with intervals, where these are known.
    joints : tuple of str
    mechanism : Mechanism or None
        With the identified inertias; None of robots that a file describes, which is not shipped.
    drive : PositionControl or None
        Position control at the joints, of servos.
    held_out : HeldOut or None
        None where no recordings of it are public.
    nearest : Nearest or None
        Of laws that most engines do not hold.
    verdict : str
    published : bool
        Whether the numbers are somebody's and were not fitted here.
    dataset, recordings, seconds
        Name of the data set, its recordings, and their length [s].
    origin, licence, citation : str
        Of the recordings.
    """

    name: str
    title: str
    fit: Fit
    joints: tuple[str, ...]
    mechanism: Mechanism | None
    drive: PositionControl | None
    held_out: HeldOut | None
    nearest: Nearest | None
    verdict: str
    published: bool
    dataset: str
    recordings: tuple[str, ...]
    seconds: float
    origin: str
    licence: str
    citation: str

    @property
    def friction(self) -> Friction:
        """The friction, by which a card is a model wherever one is asked for."""
        return self.fit.friction

    def __repr__(self) -> str:
        held, count = self.held_out, len(self.recordings)
        lines = [f"{self.name}: {self.title}", repr(self.fit), self.verdict]
        if held is not None:
            lines += [
                f"held out: {held.error:.3g} {held.unit}, without friction {held.without:.3g} "
                f"({held.what})",
                f"{self.dataset}: {count} recording{'s' * (count > 1)}, {self.seconds:g} s",
            ]
        return "\n".join([*lines, f"licence: {self.licence}"])


def machine(name: str) -> Machine:
    """The card of a machine that comes with the package.

    Examples
    --------
    >>> xl330 = machine("xl330_m1")
    >>> xl330.published, xl330.fit.law, xl330.fit.frame.value.round(4).tolist()
    (True, 'coulomb_viscous', [0.0128, 0.0037])
    """
    path = model_path(Path(f"machine:{name}"))
    card: dict[str, Any] = read_json(path)["machine"]
    mechanism, drive = card.pop("mechanism"), card.pop("drive")
    stated = {k: v for k, v in (drive or {}).items() if v is not None}
    numbers: dict[str, Any] = {k: np.asarray(v, dtype=float)[()] for k, v in stated.items()}
    nearest, held = card.pop("nearest", None), card.pop("held_out")
    if nearest is not None:
        nearest = Nearest(np.array(nearest["theta"]), nearest["cost"], card["published"])
    listed: dict[str, Any] = {key: tuple(card.pop(key)) for key in ("joints", "recordings")}
    return Machine(
        name=name,
        fit=Fit(friction_of(path)),
        mechanism=mechanism_of(mechanism) if mechanism else None,
        drive=PositionControl(**numbers) if drive else None,
        held_out=HeldOut(**held) if held else None,
        nearest=nearest,
        **listed,
        **card,
    )


def machines() -> pd.DataFrame:
    """The machines that `machine` knows, a line for each by its name.

    Columns: title, law, joints (their number), error and without (held out, see the card; NaN
    without recordings), unit, published, licence.

    Examples
    --------
    >>> machines().loc["xl330_m6", ["law", "unit"]].tolist()
    ['gear_load', 'rad']
    """
    columns = "title law joints error without unit published licence".split()
    rows = {}
    for card in map(machine, shipped_names("machines")):
        held = card.held_out or HeldOut(np.nan, np.nan, "", "")
        about = (card.title, card.fit.law, len(card.joints), held.error, held.without, held.unit)
        rows[card.name] = [*about, card.published, card.licence]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


def card_of(model: Any) -> Machine | None:
    """The card that a model is, or whose path it is; None of other models."""
    if isinstance(model, Machine):
        return model
    path = model_path(Path(model)) if isinstance(model, str | Path) else Path()
    return machine(path.stem) if path.parent == shipped("machines") else None
