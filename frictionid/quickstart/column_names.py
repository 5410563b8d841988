"""What the name of a column says: its quantity, its unit, and whether it was measured."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.readers.column_toml import SPELLINGS, UNITS
from frictionid.data.readers.table import Table

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
# Said to be of the end of an arm.
ENDS = frozenset("ee eef tcp cartesian".split())
# Said to be a sensor's.
SENSED = frozenset("meas measured act actual sensor sensed ist".split())
FILTERED = frozenset("filt filtered smooth smoothed".split())


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


# --- Columns of an IMU ----------------------------------------------------------------------------


_CALLED = {
    "angular_velocity": (
        frozenset("gyro gyroscope gyr gx gy gz wx wy wz".split()),
        (frozenset({"angular", "velocity"}), frozenset({"angular", "vel"})),
    ),
    "specific_force": (
        frozenset("acc accel accelerometer ax ay az".split()),
        (frozenset({"linear", "acceleration"}), frozenset({"specific", "force"})),
    ),
}
_IN_G = (0.5, 2.0)  # median size of a specific force in units of g
_FAST = 35.0  # [rad/s]: gyroscopes show less, unless it is deg/s


def imu_columns(table: Table) -> dict[str, Any]:
    """The [base] table of an IMU whose columns have usual names, or nothing.

    >>> names = [f"imu_{kind}_{axis}" for kind in ("gyro", "acc") for axis in "xyz"]
    >>> base = imu_columns(Table("a.csv", np.arange(2), {name: np.ones(2) for name in names}))
    >>> base["angular_velocity"], base["units"]
    (['imu_gyro_x', 'imu_gyro_y', 'imu_gyro_z'], {'specific_force': 'g'})
    >>> sorted(names_of(base)) == sorted(names)
    True
    """
    out: dict[str, Any] = {}
    for quantity in _CALLED:
        names = list(_columns(table, quantity))
        if len(names) != 3:
            return {}
        out[quantity] = names
    units = {}
    if _size(table, out["angular_velocity"]).max() > _FAST:
        units["angular_velocity"] = "deg/s"
    if _IN_G[0] < np.median(_size(table, out["specific_force"])) < _IN_G[1]:
        units["specific_force"] = "g"
    at_origin = {key: [0.0, 0.0, 0.0] for key in ("sensor_position", "sensor_rotation")}
    return {**out, **({"units": units} if units else {}), **at_origin}


def names_of(base: Mapping[str, Any]) -> list[str]:
    """Columns of an IMU."""
    return [name for quantity in _CALLED for name in base.get(quantity, ())]


def _columns(table: Table, quantity: str) -> Iterator[str]:
    single, several = _CALLED[quantity]
    for name in table.columns:
        said = set(words(name))
        if is_measured(name) and (said & single or any(each <= said for each in several)):
            yield name


def _size(table: Table, names: list[str]) -> Array:
    """Length (T,) of vectors where all their columns have numbers."""
    vectors = np.stack([table.columns[name] for name in names])
    return np.linalg.norm(vectors[:, np.isfinite(vectors).all(axis=0)], axis=0)
