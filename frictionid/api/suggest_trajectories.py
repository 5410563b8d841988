"""frictionid.suggest_trajectories: positions for a controller to follow, within limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import Any

import numpy as np
import pandas as pd

from frictionid import excitation
from frictionid.api.suggest import option
from frictionid.excitation import TrajectoryDesign
from frictionid.mechanics import Plant, as_mechanism
from frictionid.report.figures.style import drawn
from frictionid.report.figures.trajectory_design import trajectory_figure
from frictionid.report.trajectory_design import trajectory_document, trajectory_text


@dataclass(frozen=True, eq=False, repr=False)
class SuggestedTrajectories:
    """Designed trajectories; `design` has all of them.

    Attributes
    ----------
    design : TrajectoryDesign
    """

    design: TrajectoryDesign

    def __repr__(self) -> str:
        return trajectory_text(self.design)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"

    def frames(self, rate: float = 100.0) -> dict[str, pd.DataFrame]:
        """One period of each trajectory at so many samples per second [Hz], by its name.

        Columns time [s] and, for each joint j, qj, wj and aj: position, velocity, acceleration, SI.
        """
        out = {}
        for number, trajectory in enumerate(self.design.trajectories, start=1):
            time = np.arange(round(self.design.task.length * rate) + 1) / rate
            columns = {"time": time}
            for j, reference in enumerate(trajectory.references, start=1):
                motion = zip("qwa", reference.motion(time), strict=True)
                columns |= {f"{name}{j}": values for name, values in motion}
            out[f"trajectory {number}"] = pd.DataFrame(columns)
        return out

    @property
    def errors(self) -> pd.DataFrame:
        """Expected standard errors of friction relative to the prior, one row for each joint."""
        return pd.DataFrame(trajectory_document(self.design)["joints"])

    def plot(self) -> Any:
        """Position, velocity and torque over time against the limits, as a Matplotlib figure."""
        return drawn(partial(trajectory_figure, self.design))


def suggest_trajectories(
    mechanism: Any,
    limits: Mapping[str, float | Sequence[float]] | str,
    friction: Mapping[str, float | Sequence[float]] | str = "",
    *,
    recordings: int = 1,
    length: float = 10.0,
    harmonics: int = 5,
    torque_noise: float = 0.01,
    effort: int = 600,
    seed: int = 0,
    done: Callable[[str], None] = lambda _: None,
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
    machine = as_mechanism(getattr(mechanism, "mechanism", mechanism))
    most = excitation.limits_of(option(limits, "limits"), machine)
    task = excitation.TrajectoryTask(
        Plant.from_parameters(machine, machine.nominal()),
        excitation.prior_friction_of(option(friction, "friction"), most),
        most,
        length,
        recordings,
        harmonics,
        torque_noise,
    )
    return SuggestedTrajectories(excitation.design_trajectories(task, effort, seed, done))
