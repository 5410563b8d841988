"""Tables of one's own: their files, and what the names of their columns say."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from frictionid.data.readers.column_toml import CURRENTS, SPELLINGS, UNITS
from frictionid.data.readers.formats import ros
from frictionid.data.readers.table import Table, numeric_table, with_times
from frictionid.errors import InputError
from frictionid.files import BAGS, TABLES, is_table, read_bytes


class Tables(NamedTuple):
    """Tables of recordings with the same columns, in one folder; the first one is read."""

    folder: Path
    files: tuple[str, ...]
    first: Table


def tables_at(paths: Sequence[Path], time: str = "") -> Tables:
    """The tables at some paths: files of one folder, or a folder.

    time : column of the time, or the rate of the rows, "100 Hz"

    Raises
    ------
    InputError
        Where there are none, they lie in several folders, or have other columns than the first.
    """
    each = [f for path in paths for f in (_tables_in(path) if path.is_dir() else [path])]
    files = list(dict.fromkeys(each))
    for file in files:
        if not is_table(file):
            end = ", ".join(TABLES + BAGS)
            raise InputError(
                f"{file}: no table that ends with {end}; name one, or its folder; save others so"
            )
    folders = {file.parent for file in files}
    if len(folders) > 1:
        raise InputError(
            f"the tables lie in {len(folders)} folders; a data set is one folder: move them there"
        )
    first, *others = map(_table, files)
    for other in others:
        for name in first.columns:
            if name not in other.columns:
                raise InputError(
                    f"{other.file} has no column of numbers {name!r}, which {first.file} has; "
                    "name the tables that belong together, or paste columns of the same rows into "
                    "one table"
                )
    names = tuple(sorted(file.name for file in files))
    return Tables(files[0].parent, names, with_times(first, [time]))


def _table(file: Path) -> Table:
    if file.suffix in BAGS:
        return ros.numeric_table(file)
    return numeric_table(read_bytes(file), str(file))


def _tables_in(folder: Path) -> list[Path]:
    files = sorted(file for file in folder.iterdir() if is_table(file))
    if not files and (folder / "meta/info.json").is_file():
        raise InputError(
            f"{folder} is a LeRobot data set: name its data/*/*.parquet, or write a dataset.toml "
            'with [reader] kind = "lerobot", as in data/README.md of frictionid'
        )
    if not files:
        raise InputError(f"{folder} has no table that ends with {', '.join(TABLES + BAGS)}")
    return files


# --- What the name of a column says: its quantity, its unit, and whether it was measured ----------

# Words of names, in lower case. The first quantity counts that has a word of the name.
WORDS: Mapping[str, frozenset[str]] = {
    "time": frozenset("time t timestamp stamp zeit clock seconds".split()),
    "velocity": frozenset("w qd dq vel velocity omega speed rate qdot thetadot dtheta".split()),
    "current": frozenset("i iq current cur amps ampere amperes strom".split()),
    "torque": frozenset("u tau torque tq trq moment effort eff force drehmoment".split()),
    "angle": frozenset(
        "q angle theta phi alpha pos position encoder enc winkel x observation".split()
    ),
}
# Not measured: commands and references, what observers estimate, and the truth of simulations.
COMMANDED = frozenset(
    "action cmd command commanded con des desired ref reference target setpoint goal soll".split()
)
UNMEASURED = COMMANDED | {"ext", "external", "true", "truth"}
# Said to tell runs in one table apart.
RUNS = frozenset("run trial episode experiment test repetition rep session versuch".split())
# Said to be no torque, though it is no other quantity either.
OTHERS = RUNS | frozenset(
    "acc acceleration ddq qdd qddot temp temperature warm volt voltage supply rpm counter count "
    "index sample frame sec".split()
)
# Said to be whole numbers of an encoder.
COUNTS = frozenset("counts ticks tick cnt".split())
# Said to be of the end of an arm.
ENDS = frozenset("ee eef tcp cartesian".split())
# Said to be a sensor's.
SENSED = frozenset("meas measured act actual sensor sensed ist".split())
FILTERED = frozenset("filt filtered smooth smoothed".split())
# Said to tell no joint from others.
_PLAIN = {
    *"joint link motor raw rad mrad deg mm nm".split(),
    *(UNMEASURED | SENSED | FILTERED | COUNTS),
    *frozenset().union(*WORDS.values()),
}


def words(name: str) -> list[str]:
    """Words of a column's name, in lower case, without numbers.

    >>> words("joint1_Position [deg]"), words("motorCurrent_A")
    (['joint', 'position', 'deg'], ['motor', 'current', 'a'])
    """
    return [word.lower() for word in re.findall(r"[A-Z]?[a-zµ°]+|[A-Z]+(?![a-z])", name)]


def quantity_of(name: str) -> str:
    """Quantity that the name of a column speaks of, or "".

    >>> [quantity_of(name) for name in ("t_ms", "q2 [deg]", "i_motor", "temperature", "ee_pos")]
    ['time', 'angle', 'current', '', '']
    """
    said = set(words(name))
    if said & ENDS and "joint" not in said:
        return ""
    return next((quantity for quantity, usual in WORDS.items() if said & usual), "")


def is_measured(name: str) -> bool:
    """Whether the name speaks of no command, reference or truth.

    >>> is_measured("q1"), is_measured("q1_ref")
    (True, False)
    """
    return not UNMEASURED & set(words(name))


def nameless(names: Iterable[str]) -> list[str]:
    """Columns whose names say no quantity.

    >>> nameless(["M [Nm]", "P", "q", "P_ref"])
    ['M [Nm]', 'P']
    """
    return [name for name in names if not quantity_of(name) and is_measured(name)]


def is_target(name: str) -> bool:
    """Whether the name speaks of an angle that a controller follows.

    >>> is_target("goal_deg"), is_target("q_ref"), is_target("u_cmd"), is_target("q_true")
    (True, True, False, False)
    """
    return bool(COMMANDED & set(words(name))) and quantity_of(name) in ("", "angle")


def unit_of(name: str, quantity: str) -> str:
    """Unit of a quantity that stands in brackets in the name, or at its end; "" where none does.

    >>> unit_of("angle [Deg]", "angle"), unit_of("t/ms", "time"), unit_of("tau_Nm", "torque")
    ('deg', 'ms', 'N m')
    """
    spellings = {unit: unit for unit in UNITS[quantity]} | SPELLINGS[quantity]
    folded = {said.replace(" ", "").lower(): unit for said, unit in spellings.items()}
    bracket = re.search(r"[\[(]([^\])]*)[\])]", name)
    last = bracket[1] if bracket else re.split(r"[_\s./]", name)[-1]
    return folded.get(last.replace(" ", "").lower(), "") if last != name else ""


def tokens(name: str) -> frozenset[str]:
    """What tells a joint from others in a name: words and numbers that say no quantity or unit.

    >>> sorted(tokens("position_arm_1")), sorted(tokens("FL_hip_joint")), sorted(tokens("i_2_A"))
    (['1', 'arm'], ['fl', 'hip'], ['2'])
    >>> sorted(tokens("Z_force_N")), sorted(tokens("Z_act_mm")), sorted(tokens("tau_A"))
    (['z'], ['z'], ['a'])
    """
    numbers = {str(int(number)) for number in re.findall(r"\d+", name)}
    quantity = quantity_of(name)
    kind = "torque" if quantity == "current" else quantity
    unit = unit_of(name, kind) if kind else ""
    if quantity == "torque" and unit in CURRENTS:  # of a joint A
        unit = ""
    return frozenset(({*words(name)} - _PLAIN - {*words(unit)}) | numbers)


def is_sensed(name: str) -> bool:
    """Whether the name speaks of a sensor's samples: a current, or a torque said to be measured.

    >>> is_sensed("i_motor"), is_sensed("tau_meas"), is_sensed("tau"), is_sensed("i_cmd")
    (True, True, False, False)
    """
    sensed = SENSED & set(words(name)) or quantity_of(name) == "current"
    return bool(sensed) and is_measured(name)


def by_trust(names: Iterable[str]) -> tuple[list[str], ...]:
    """Columns said to be a sensor's, those that no filter changed, and all.

    >>> by_trust(["tau_con", "tau_filt", "tau_meas"])
    (['tau_meas'], ['tau_con', 'tau_meas'], ['tau_con', 'tau_filt', 'tau_meas'])
    """
    everything = list(names)
    sensed = [name for name in everything if SENSED & set(words(name))]
    return sensed, [n for n in everything if not FILTERED & set(words(n))], everything
