"""frictionid.suggest: torque signals that identify friction and inertia, within limits."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import Any

import pandas as pd

from frictionid import excitation
from frictionid.excitation import Design, TrajectoryDesign
from frictionid.excitation.experiment import Limits, Named
from frictionid.friction import Friction
from frictionid.mechanics import Plant, as_mechanism
from frictionid.pictures import drawn
from frictionid.progress import Done, say_nothing
from frictionid.report.experiment_design import (
    command_frame,
    described,
    design_document,
    design_figure,
    trajectory_document,
    trajectory_figure,
    trajectory_frame,
    trajectory_text,
)


@dataclass(frozen=True, eq=False, repr=False)
class _Designed:
    """What is designed: its text, all numbers in SI units, and how its picture is drawn."""

    design: Any
    text: str
    document: dict[str, Any]
    draw: Callable[[], Any]

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"

    def plot(self) -> Any:
        """Torque and motion over time, with the limits, as a Matplotlib figure."""
        return drawn(self.draw)


class Suggestion(_Designed):
    """Designed torque signals; `design` has all of them."""

    design: Design

    @property
    def frames(self) -> dict[str, pd.DataFrame]:
        """Torque tables by the names of the recordings, each value held to the next.

        Columns time [s] and, for each motor of joint j, uj [N m].
        """
        count = self.design.experiment.recordings
        return {f"recording {r + 1}": command_frame(self.design, r) for r in range(count)}


def suggest(
    mechanism: Any,
    limits: Named,
    friction: Named = "",
    *,
    recordings: int = 4,
    length: float = 5.0,
    frequencies: Sequence[float] = (0.2, 4.0),
    start: Sequence[float] | None = None,
    drive_rate: float = 60.0,
    camera_rate: float = 60.0,
    noise: float = 0.1,
    robust: bool = False,
    effort: int = 600,
    seed: int = 0,
    done: Done = say_nothing,
) -> Suggestion:
    """Suggest torque signals, and say how well friction will be known from them.

    Parameters
    ----------
    mechanism : Mechanism, or Dataset, whose mechanism it is
    limits : mapping
        "torque" of the motors, "velocity" and, where there is a limit, "angle" of the joints: one
        number, or one for each; SI units.
    friction : mapping, optional
        The prior: "coulomb" and "viscous"; 5 % of the torque where they are missing.
    recordings, length
        How many recordings, and how long each is [s].
    frequencies : lowest and highest [Hz]
    start : start angles, searched where they are missing
    drive_rate, camera_rate : commands and images per second [Hz]
    noise : standard deviation of the angles [deg], or [mm]
    robust : whether the signals shall be good with half and twice the prior friction, too
    effort : number of random signals that the search begins with
    seed : int
    done : function
        Called with a line of text after each stage of the search; see `stages`.

    Raises
    ------
    InputError
        For limits and priors that no machine has.
    """
    plant, prior, most = _asked(mechanism, limits, friction)
    low, high = map(float, frequencies)
    experiment = excitation.Experiment(
        plant,
        prior,
        most,
        length=length,
        recordings=recordings,
        drive_rate=drive_rate,
        camera_rate=camera_rate,
        angle_noise=tuple(
            math.radians(noise) if unit == "rad" else noise / 1000.0
            for unit in plant.mechanism.position_units
        ),
        band=(low, high),
        start=None if start is None else tuple(map(float, start)),
        friction_scales=(0.5, 1.0, 2.0) if robust else (1.0,),
    )
    design = excitation.design_signals(experiment, _search(effort, seed), done)
    draw = partial(design_figure, design)
    return Suggestion(design, described(design), design_document(design), draw)


def stages(effort: int = 600, seed: int = 0) -> int:
    """Number of stages of the search of `suggest`."""
    return _search(effort, seed).generations + 1


def _search(effort: int, seed: int) -> excitation.Search:
    return excitation.Search(pool=effort, children=max(1, effort // 3), seed=seed)


def _asked(mechanism: Any, limits: Named, friction: Named) -> tuple[Plant, Friction, Limits]:
    """The machine, its prior friction and its limits."""
    machine = as_mechanism(getattr(mechanism, "mechanism", mechanism))
    most = excitation.limits_of(limits, machine)
    prior = excitation.prior_friction_of(friction, most)
    return Plant.from_parameters(machine, machine.nominal()), prior, most


class SuggestedTrajectories(_Designed):
    """Designed trajectories; `design` has all of them."""

    design: TrajectoryDesign

    def frames(self, rate: float = 100.0) -> dict[str, pd.DataFrame]:
        """One period of each trajectory at so many samples per second [Hz], by its name.

        Columns time [s] and, for each joint j, qj, wj and aj: position, velocity, acceleration, SI.
        """
        count = len(self.design.trajectories)
        return {f"trajectory {k + 1}": trajectory_frame(self.design, k, rate) for k in range(count)}


def suggest_trajectories(
    mechanism: Any,
    limits: Named,
    friction: Named = "",
    *,
    recordings: int = 1,
    length: float = 10.0,
    harmonics: int = 5,
    torque_noise: float = 0.01,
    effort: int = 600,
    seed: int = 0,
    done: Done = say_nothing,
) -> SuggestedTrajectories:
    """Suggest periodic trajectories, and say which joint's friction stays unsure.

    Parameters
    ----------
    mechanism : Mechanism, or Dataset, whose mechanism it is; every joint has a motor
    limits : mapping
        "torque", "velocity" and "angle" of the joints: one number, or one for each; SI units.
    friction : mapping, optional
        The prior: "coulomb" and "viscous"; 5 % of the torque where they are missing.
    recordings, length
        How many trajectories, and how long each is [s].
    harmonics : of each joint's position
    torque_noise : what stays unexplained of a torque's mean over 0.05 s, relative to its limit
    effort : number of motions that are tried for each
    seed : int
    done : function
        Called with a line of text after each trajectory.

    Raises
    ------
    InputError
        For limits and priors that no machine has, and where no motion keeps the limits.
    """
    asked = _asked(mechanism, limits, friction)
    task = excitation.TrajectoryTask(*asked, length, recordings, harmonics, torque_noise)
    design = excitation.design_trajectories(task, effort, seed, done)
    draw = partial(trajectory_figure, design)
    return SuggestedTrajectories(design, trajectory_text(design), trajectory_document(design), draw)
