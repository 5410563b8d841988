"""Simulated sets for `intervals.py`: each law's own truth, on one joint and on the acrobot.

Truths are set-valued where the law sticks, and finely integrated; the fit knows neither. For
shooting the torque acts 12 ms late and the rotor's inertia is missing from the nominal mechanism,
except where friction depends on bearing forces, which follow from the nominal parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictionid.data.recordings import Dataset
from frictionid.friction.laws import (
    CoulombViscous,
    Dahl,
    FilmLag,
    GearLoad,
    LoadDependent,
    LuGre,
    MotorLoad,
    Spline,
    Stribeck,
)
from frictionid.mechanics import mechanism_of
from frictionid.simulate import (
    Camera,
    Curve,
    Drive,
    LoadFriction,
    Multisine,
    Noise,
    Rig,
    Run,
    Steps,
    simulate,
)
from frictionid.simulate import FilmLag as TrueFilmLag
from frictionid.simulate import LuGre as TrueLuGre
from frictionid.simulate import Stribeck as TrueStribeck

Array = np.ndarray
DELAY = 0.012  # [s]
MOMENT = 0.5 * 9.81 * 0.3  # [N m], of gravity on the pendulum
NOISE = {"joint": 0.0008, "acrobot": 0.0016}  # [rad]
KNOTS = (1.0, 2.0, 3.5, 5.0, 8.0)
MACHINES = {
    "joint": {"kind": "pendulum", "parameters": {"mass": 0.5, "length": 0.3}},
    "acrobot": {"kind": "acrobot"},
}
SAMPLES = {"joint": 181, "acrobot": 121}
STATED = 5.0  # [%], tolerance of masses that are off
JOINTS = {"joint": 1, "acrobot": 2}
TORQUE = {"joint": 0.6, "acrobot": 0.14}  # [N m], largest


@dataclass(frozen=True)
class Case:
    """A law on a machine: what is fitted, the true friction, and its parameters in the law's terms.

    values : (n, P), or None for a spline, whose truth depends on the motion
    """

    law: Any
    machine: str
    truth: Any
    values: Array | None


def _curve(values: dict[str, Sequence[float]]) -> Curve:
    both = ("coulomb_positive", "coulomb_negative", "peak_positive", "peak_negative")
    sides = {name: values.get(name, values.get(name.split("_")[0], ())) for name in both}
    own = {name: tuple(values[name]) for name in ("viscous", "stribeck_velocity") if name in values}
    return Curve(**{name: tuple(of) for name, of in sides.items()}, **own)


def _static(values: dict[str, Sequence[float]]) -> Any:
    return TrueStribeck(_curve(values))


def _film(values: dict[str, Sequence[float]]) -> Any:
    return TrueFilmLag(_curve(values), tuple(values["lag"]))


def _bristles(values: dict[str, Sequence[float]]) -> Any:
    """A bristle without damping is Dahl's."""
    peak = values.get("peak", np.zeros(len(values["coulomb"])))
    stiffness = (np.array(values["coulomb"]) + peak) / np.array(values["presliding"])
    none = (0.0,) * len(stiffness)
    return TrueLuGre(
        _curve(values),
        tuple(map(float, stiffness)),
        tuple(values.get("damping", none)),
        tuple(values.get("damping_velocity", (1.0,) * len(stiffness))),
    )


def _loaded(values: dict[str, Sequence[float]]) -> Any:
    names = {"load_coefficient": "bearing", "loss": "motor"}
    plain = ("coulomb", "peak", "viscous", "stribeck_velocity", "exponent")
    own = {names.get(k, k): tuple(v) for k, v in values.items() if k not in plain}
    return LoadFriction(_curve(values), **own, moment=MOMENT)


_C = {"coulomb": (0.12, 0.05), "viscous": (0.008, 0.001)}
_P = {**_C, "peak": (0.06, 0.03), "stribeck_velocity": (1.2, 2.0)}
_SIDED = {
    "coulomb_positive": (0.13, 0.055),
    "coulomb_negative": (0.11, 0.045),
    "peak_positive": (0.06, 0.03),
    "peak_negative": (0.05, 0.025),
    "stribeck_velocity": (1.2, 2.0),
    "viscous": (0.008, 0.001),
}
# a peak so wide, and no viscous friction, that a spline follows it
_WIDE = {**_P, "viscous": (0.0, 0.0), "stribeck_velocity": (2.5, 3.0)}
_BRISTLES = {"presliding": (0.03, 0.05)}
_LUGRE = {**_P, **_BRISTLES, "damping": (0.06, 0.01), "damping_velocity": (1.0, 1.0)}
_GEAR = {
    **{name: of[:1] for name, of in _P.items()},
    **{"motor": (0.2,), "external": (0.12,), "peak_motor": (0.1,), "peak_external": (0.06,)},
    **{"quadratic_motor": (0.1,), "quadratic_external": (0.05,), "exponent": (2.0,)},
}
LAWS: dict[str, tuple[Any, Callable[[dict[str, Sequence[float]]], Any], dict[str, Any]]] = {
    "coulomb_viscous": (CoulombViscous(), _static, _C),
    "stribeck": (Stribeck(), _static, _P),
    "stribeck_asymmetric": (Stribeck(symmetric=False), _static, _SIDED),
    "spline": (Spline(knots=KNOTS), _static, _WIDE),
    "load_dependent": (LoadDependent(), _loaded, {**_C, "load_coefficient": (0.008, 0.006)}),
    "motor_load": (MotorLoad(), _loaded, {**_C, "loss": (0.15, 0.15)}),
    "gear_load": (GearLoad(moment=MOMENT), _loaded, _GEAR),
    "film_lag": (FilmLag(), _film, {**_P, "lag": (0.06, 0.06)}),
    "dahl": (Dahl(), _bristles, {**_C, **_BRISTLES}),
    "lugre": (LuGre(), _bristles, _LUGRE),
}


def case_of(law: str, machine: str) -> Case:
    """The case of a law by name on a machine by name."""
    fitted, made, values = LAWS[law]
    own = {name: tuple(of[: JOINTS[machine]]) for name, of in values.items()}
    known = all(name in own for name in fitted.names)
    theta = np.array([own[name] for name in fitted.names]).T if known else None
    return Case(fitted, machine, made(own), theta)


def runs_of(machine: str, seed: int, recordings: int) -> list[Run]:
    """Recordings of one set: two free decays, the others driven."""
    draw, runs, most = np.random.default_rng([seed, 7]), [], TORQUE[machine]
    for k in range(recordings):
        start = draw.uniform(1.8, 2.9) * draw.choice([-1, 1]), draw.uniform(-1.5, 1.5)
        kinds = (
            Multisine(most, tuple(map(float, draw.uniform(0.6, 2.0, 3)))),
            Steps(most, float(draw.uniform(0.25, 0.5))),
            Noise(most, (0.5, float(draw.uniform(0.9, 1.4)))),
        )
        torques = () if k < 2 else (kinds[k % 3],)
        angle = tuple(map(float, start[: JOINTS[machine]]))
        runs.append(Run(f"{seed:04d}_{k:02d}", angle, torques=torques))
    return runs


def rig_of(
    case: Case, seeds: Sequence[int], recordings: int, *, late: bool, rotor_known: bool = False
) -> Rig:
    """The rig with the recordings of some sets, 3 s each at 60 Hz (the acrobot 2 s)."""
    rotor = 2e-6 if case.machine == "acrobot" else 0.003
    known = (
        rotor_known or not late or case.law.uses_load
    )  # bearing forces follow from the nominal parameters
    return Rig(
        "coverage",
        MACHINES[case.machine],
        case.truth,
        Camera(samples=SAMPLES[case.machine], angle_noise=NOISE[case.machine]),
        tuple(run for seed in seeds for run in runs_of(case.machine, seed, recordings)),
        true_parameters={} if known else {"rotor": rotor},
        drive=Drive(delay=DELAY if late else 0.0),
        substeps=24,
    )


def parts_of(data: Dataset, recordings: int) -> list[Dataset]:
    """The data sets of so many recordings each that were simulated side by side."""
    at = range(0, len(data.recordings), recordings)
    return [replace(data, recordings=data.recordings[i : i + recordings]) for i in at]


def sets_of(
    case: Case,
    seeds: Sequence[int],
    recordings: int,
    *,
    late: bool,
    wrong: float = 0.0,
    substeps: int = 24,
) -> list[Dataset]:
    """Simulated sets, moved side by side: as they come alone, sooner.

    wrong : how far nominal masses are off, either way [%]; with those, all inertia is masses
    substeps : of the simulation, between two samples
    """
    rig = rig_of(case, seeds, recordings, late=late, rotor_known=wrong > 0.0)
    parts = parts_of(simulate(replace(rig, substeps=substeps)), recordings)
    return parts if not wrong else [_off(*pair, wrong) for pair in zip(parts, seeds, strict=True)]


def _off(dataset: Dataset, seed: int, wrong: float) -> Dataset:
    """The set with nominal masses so many % off, and `STATED` as their tolerance."""
    mechanism = dataset.mechanism
    nominal, sign = mechanism.nominal(), np.random.default_rng([seed, 3]).choice([-1, 1])
    masses = {name: v for name, v in nominal.items() if name.startswith("mass")}
    defaults = {name: v * (1.0 + sign * wrong / 100.0) for name, v in masses.items()}
    table = {
        **mechanism.table,
        "parameters": {**mechanism.table.get("parameters", {}), **defaults},
        "tolerances": dict.fromkeys(masses, STATED),
    }
    return replace(dataset, mechanism=mechanism_of(table))
