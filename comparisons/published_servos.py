"""Cards of servos that BAM publishes, M1 to M6 each, taken over as they stand [Duclusaud2025].

    python comparisons/published_servos.py CHECKOUT

CHECKOUT is a clone of github.com/Rhoban/bam. Writes machines/NAME.json where it is not there: of
the XL330 `cards.py` judges M1 and M6. Of the others there are no recordings here, and nothing is
judged. M1 is Coulomb and viscous friction, M2 to M6 are `gear_load` with what they lack at zero.
Each servo carries a pendulum as an example of a load.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from script import call

from frictionid.files import shipped, write_json
from frictionid.friction import Friction
from frictionid.friction.bam_files import GRAVITY as G
from frictionid.friction.bam_files import read_bam
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import model_document

MASS, LENGTH = 0.5, 0.1  # of the example load [kg], [m]
TURN = 2 * np.pi
CITATION = (
    "M. Duclusaud, G. Passault, V. Padois, O. Ly: Extended Friction Models for the Physics "
    "Simulation of Servo Actuators. IEEE International Conference on Robotics and Automation "
    "(ICRA), 12091-12097, 2025"
)


class Servo(NamedTuple):
    """A servo: its title, folder, and its controller's supply [V], gain and greatest duty.

    gain : duty cycle per rad at the firmware's usual gain; None where a log sets the gains
    """

    title: str
    folder: str
    volts: float = 0.0
    gain: float | None = None
    duty: float = 1.0


SERVOS = {
    "mx64": Servo("Dynamixel MX-64, firmware gain 32", "mx64", 15.0, 32 * 0.158, 0.9625),
    "mx106": Servo("Dynamixel MX-106, firmware gain 32", "mx106", 15.0, 32 * 0.158, 0.9625),
    "xl320": Servo("Dynamixel XL-320, firmware gain 32", "xl320", 7.5, 32 * 0.05048199),
    "sts3215": Servo(
        "Feetech STS3215, 7.4 V, firmware gain 32", "feetech_sts3215_7_4V", 7.4, 32 * 0.166, 0.97
    ),
    "erob80_50": Servo("eRob80:50", "erob80_50"),
    "erob80_100": Servo("eRob80:100", "erob80_100"),
    "xl330": Servo(
        "Dynamixel XL330-M288, firmware gain 100", "xl330", 7.4, 100 * 4096 / TURN / (256 * 885)
    ),
}


def friction_of(numbers: dict[str, Any], source: str) -> Friction:
    """The published friction."""
    friction = read_bam({**numbers, "moment": MASS * G * LENGTH}, source)
    return replace(friction, provenance={"source": source})


def drive_of(servo: Servo, numbers: dict[str, Any]) -> dict[str, Any] | None:
    """Position control at the joint; None where a log sets the gains."""
    if servo.gain is None:
        return None
    per_volt = numbers["kt"] / numbers["R"]
    return {
        "kp": [per_volt * servo.volts * servo.gain],
        "kv": [0.0],
        "limit": [per_volt * servo.volts * servo.duty],
        "back_emf": [per_volt * numbers["kt"]],
        "delay": 0.0,
        "bias": [0.0],
    }


def card(servo: Servo, numbers: dict[str, Any], first: Friction, source: str) -> dict[str, Any]:
    """The document of a card; `first` is the servo's M1."""
    friction = friction_of(numbers, source)
    simple = isinstance(friction.law, CoulombViscous)
    load = {"mass": MASS, "length": LENGTH, "rotor": numbers["armature"], "g": G}
    cost = "the published M1 is in its place; no recordings here say what that costs"
    name = numbers["model"].upper()
    machine = {
        "title": f"{servo.title}, BAM's {name}",
        "published": True,
        "joints": ["joint 1"],
        "mechanism": {"kind": "pendulum", "parameters": load},
        "drive": drive_of(servo, numbers),
        "held_out": None,
        "nearest": None if simple else {"theta": first.theta, "cost": cost},
        "dataset": "",
        "recordings": [],
        "seconds": 0.0,
        "origin": source,
        "licence": "Apache-2.0",
        "citation": CITATION,
        "verdict": "As published, neither fitted nor judged here; "
        f"{MASS:g} kg at {LENGTH:g} m are an example of a load.",
    }
    return {**model_document(friction), "machine": machine}


def main(checkout: Path) -> None:
    """Write all cards."""
    git = ["git", "-C", str(checkout), "rev-parse", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    for name, servo in SERVOS.items():
        folder = checkout / "bam" / "params" / servo.folder
        first = friction_of(json.loads((folder / "m1.json").read_text()), "")
        for file in sorted(folder.glob("m?.json")):
            place = file.relative_to(checkout).as_posix()
            source = f"github.com/Rhoban/bam, commit {commit}, {place}"
            path = shipped("machines") / f"{name}_{file.stem}.json"
            if not path.exists():
                write_json(path, card(servo, json.loads(file.read_text()), first, source))


if __name__ == "__main__":
    call(main)
