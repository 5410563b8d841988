"""A small pendulum without dry friction, and what networks without physics make of it."""

from __future__ import annotations

from functools import cache

import numpy as np

from frictionid.compare import view_of
from frictionid.friction import Friction
from frictionid.identifiers import Identifier
from frictionid.recipe import INTEGRAL, training_problem
from frictionid.recordings import Dataset
from frictionid.simulate import Camera, Curve, Rig, Run, Sine, Stribeck, simulate

MASS, LENGTH, VISCOUS = 0.5, 0.4, 0.05


@cache
def pendulum() -> Dataset:
    """A driven pendulum with viscous friction alone."""
    runs = [Run(f"{i}", (0.5 + 0.2 * i,), (), (Sine(3.0, 0.4 + 0.2 * i),)) for i in range(6)]
    viscous = Stribeck(Curve((0.0,), (0.0,), (VISCOUS,)))
    machine = {"kind": "pendulum", "parameters": {"mass": MASS, "length": LENGTH}}
    return simulate(Rig("viscous", machine, viscous, Camera(120, 60.0, 1e-4), tuple(runs)))


def found(identifier: Identifier) -> Friction:
    """What it finds in all of the pendulum's recordings."""
    plant, recipe = view_of(identifier, pendulum(), INTEGRAL)
    problem = training_problem(pendulum(), plant, recipe)
    return identifier.fit(problem, np.ones((1, len(problem.r))), 0)[0]


def acceleration(q: np.ndarray, w: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The pendulum's true acceleration."""
    torque = u - MASS * 9.81 * LENGTH * np.sin(q) - VISCOUS * w
    return torque / (MASS * LENGTH**2)
