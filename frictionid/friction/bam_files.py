"""Parameter files of BAM, the friction models M1 to M6 of servos [Duclusaud2025].

A file is a JSON object with "model": "m1" to "m6", "actuator", and numbers by name. What loads the
gear is not in it but in its test bench: "moment" = m g l [N m] of the pendulum, a key that BAM
passes over, says it here.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.errors import InputError, located

from .friction import Friction
from .law import Law
from .laws import CoulombViscous, GearLoad

# names in BAM of what each model has, in the order of the parameters of `GearLoad`
GEAR = (
    *("friction_base", "friction_viscous", "load_friction_motor", "load_friction_external"),
    *("friction_stribeck", "load_friction_motor_stribeck", "load_friction_external_stribeck"),
    *("load_friction_motor_quad", "load_friction_external_quad", "dtheta_stribeck", "alpha"),
)
_PLAIN = ("friction_base", "friction_viscous")
_STRIBECK = ("friction_stribeck", "dtheta_stribeck", "alpha")
MODELS: Mapping[str, tuple[str, ...]] = {
    "m1": _PLAIN,
    "m2": (*_PLAIN, *_STRIBECK),
    "m3": (*_PLAIN, "load_friction_base"),
    "m4": (*_PLAIN, *_STRIBECK, "load_friction_base", "load_friction_stribeck"),
    "m5": tuple(name for name in GEAR if not name.endswith("_quad")),
    "m6": GEAR,
}
MOTOR = {"armature": "rotor", "kt": "kt", "R": "R"}  # and our names
GRAVITY = 9.80665  # [m/s^2], of BAM's test bench


def is_bam(document: Mapping[str, Any]) -> bool:
    """Whether a JSON object is such a file.

    >>> is_bam({"model": "m1", "friction_base": 0.1}), is_bam({"format": "frictionid model 1"})
    (True, False)
    """
    return "format" not in document and "model" in document and "friction_base" in document


def read_bam(document: Mapping[str, Any], where: str) -> Friction:
    """Friction of a parameter file of BAM; `where` is named in errors.

    M1 is Coulomb and viscous friction; M2 to M6 are `GearLoad`, of which they use what they have.

    Raises
    ------
    InputError
        For unknown models, and numbers that are missing or none.

    >>> print(read_bam({"model": "m1", "friction_base": 0.1, "friction_viscous": 0.02}, "m1.json"))
    CoulombViscous(width=0.02, shape='tanh', symmetric=True)
      joint 1  coulomb 0.1 N m, viscous 0.02 N m s/rad
    """
    model = str(document["model"])
    if model not in MODELS:
        raise InputError(
            f"{where}: BAM's model {model!r} is unknown; known are {', '.join(MODELS)}"
        )
    values = {name: _number(document, name, where) for name in MODELS[model]}
    law: Law = CoulombViscous()
    theta = [values[name] for name in _PLAIN]
    if model != "m1":
        law, theta = _gear(document, values, where)
    parameters = {ours: _number(document, k, where) for k, ours in MOTOR.items() if k in document}
    if parameters:
        parameters["g"] = GRAVITY
    source: dict[str, Any] = {"source": f"BAM, model {model} of {document.get('actuator', '?')}"}
    if document.get("q_offset"):
        offset = _number(document, "q_offset", where)
        source["note"] = f"its angle offset of {offset:.4g} rad is not used: the data set has it"
    return Friction(law, np.array([theta]), parameters).noted(source)


def _gear(
    document: Mapping[str, Any], values: dict[str, float], where: str
) -> tuple[Law, list[float]]:
    """Law and parameters of M2 to M6."""
    both = {
        "load_friction_base": ("load_friction_motor", "load_friction_external"),
        "load_friction_stribeck": (
            "load_friction_motor_stribeck",
            "load_friction_external_stribeck",
        ),
    }
    for name, names in both.items():
        values |= {side: values[name] for side in names if name in values}
    loaded = any(values.get(name) for name in GEAR if name.startswith("load_"))
    if loaded and "moment" not in document:
        raise InputError(
            f'{where}: BAM\'s {document["model"]} rubs by the load of the gear: add "moment", mass '
            "times gravity times length of the pendulum on the servo [N m], 0 for none"
        )
    moment = _number(document, "moment", where) if "moment" in document else 0.0
    missing = {"dtheta_stribeck": 1.0, "alpha": 2.0}
    with located(where):
        law = GearLoad(moment=moment)
    return law, [values.get(name, missing.get(name, 0.0)) for name in GEAR]


def _number(document: Mapping[str, Any], name: str, where: str) -> float:
    value = document.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        state = "is missing" if name not in document else f"is {value!r}"
        raise InputError(
            f"{where}: BAM's {document['model']} needs the number {name!r}, it {state}"
        )
    if value < 0 and name != "q_offset":
        raise InputError(f"{where}: {name} = {value} must not be negative")
    return float(value)
