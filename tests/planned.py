"""A quick experiment for the tests of excitation advice."""

from __future__ import annotations

from frictionid.excitation import Experiment, guessed, limits_of
from frictionid.mechanics import Plant, pendulum


def on_pendulum(torque: str = "0.3", **changes) -> Experiment:
    """A quick experiment: 0.2 kg at 0.3 m, with a motor."""
    machine = pendulum()
    limits = limits_of(f"torque={torque}, velocity=20, angle=3", machine)
    friction = guessed("coulomb=0.05, viscous=0.005", limits)
    plant = Plant.of(machine, {"mass": 0.2, "length": 0.3})
    given = {"length": 3.0, "recordings": 2, **changes}
    return Experiment(plant, friction, limits, **given)
