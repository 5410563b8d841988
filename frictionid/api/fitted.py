"""A fitted friction as an object: it prints itself, predicts, scores, draws, and is saved."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.data.plants import Calibration
from frictionid.data.recordings import Dataset, Recording
from frictionid.errors import InputError
from frictionid.evaluation import EstimatedStates, speeds, torque_frame, velocity_grid
from frictionid.fitting.fit import estimates_of
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.friction import Friction
from frictionid.friction.model_files import kind_of, save_model
from frictionid.friction.provenance import Estimates
from frictionid.pictures import drawn
from frictionid.report import show_fit
from frictionid.report.figures.fits import fit_correlation, fit_figure
from frictionid.report.figures.motion import predicted_figure
from frictionid.report.numbers import estimate_frame
from frictionid.report.terminal import Shown, say

from .evaluate import HORIZONS, evaluate, predict
from .models import dataset_of, numbers

PLOTS = ("friction", "motion", "correlation")
ASSUMED = (
    "one step takes masses, gains, delay and bias as given: what is off in these passes for "
    "friction; by shooting they are free"
)


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Shown):
    """A fitted friction, with the data that it was fitted to, where these are at hand.

    Attributes
    ----------
    friction : Friction, theta (n, P)
        The law with its numbers, with its calibration where that was free.
    data : Dataset or None
        None for a model that was loaded from a file.
    """

    friction: Friction
    data: Dataset | None = None

    @property
    def law(self) -> str:
        """Name of the law, as in model files."""
        return kind_of(self.friction.law)

    @property
    def method(self) -> str:
        """How it was fitted: "shooting", "inverse_dynamics", "one_step", or "pooled" of fits."""
        source = self.friction.provenance
        if source.pooled is not None:
            return "pooled"
        recipe = source.recipe or source.settings.get("recipe", "")
        if str(recipe).startswith("InverseDynamics"):
            return "inverse_dynamics"
        return "one_step" if source.refined is None else "shooting"

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, and of other parts that have friction."""
        if self.data is not None:
            return tuple(self.data.mechanism.friction_names)
        return self.friction.joints

    @property
    def calibration(self) -> Calibration | None:
        """Base parameters, delay, gain, bias and offset, where any of them was free."""
        return self.friction.calibration

    @property
    def convergence(self) -> Estimates | None:
        """How the fit went, where it was shot; see `frictionid.friction.provenance`."""
        return self.friction.provenance.refined

    @cached_property
    def frame(self) -> pd.DataFrame:
        """Parameters with 95 % intervals, a line for each.

        Columns: block, joint, parameter, unit, value, error, low_90, high_90, low_95, high_95,
        identified, at_bound, nominal. `identified` is whether the data determine it: the interval
        is no wider, to either side, than the value.
        """
        frame = estimate_frame(estimates_of(self.friction, self.joints), self.joints)
        source = self.friction.provenance
        intervals = (source.refined, source.pooled, source.half_widths)
        is_given = all(v is None for v in intervals)
        return frame.assign(identified=None) if is_given else frame

    @cached_property
    def torque_left(self) -> pd.DataFrame:
        """Torque that the model leaves of its own data; of other data, `evaluate` has it.

        A line for each joint and, last, one for all; empty where no torque was measured. Columns:
        joint, unit, measured_rms, left_rms, left, nominal_rms, nominal: rms [N m], and as shares of
        the measured torque, of the model and of the nominal mechanism without friction.
        """
        return torque_frame(self.friction.provenance.torque_left)

    @property
    def covariance(self) -> pd.DataFrame | None:
        """Covariance of the free parameters by their names, of a fit by shooting, else None."""
        refined = self.convergence
        if refined is None:
            return None
        names = [e.name for e in refined.parameters]
        return pd.DataFrame(refined.square(refined.covariance), names, names)

    def curve(self, velocity: Any = None) -> pd.DataFrame:
        """Friction torque of each joint over velocity.

        Parameters
        ----------
        velocity : array, shape (V,) [rad/s], optional
            The speeds of the data, where it is missing.

        Returns
        -------
        DataFrame
            Columns velocityj [rad/s] and frictionj [N m] of each joint j.
        """
        if velocity is None:
            grid = self._grid()
        else:
            w = np.array(numbers("velocity", velocity))
            grid = np.repeat(w[:, None], self.friction.n, axis=1)
        out, torque = {}, self.friction.curve(grid)
        for j in range(self.friction.n):
            out[f"velocity{j + 1}"] = grid[:, j]
            out[f"friction{j + 1}"] = torque[:, j]
        return pd.DataFrame(out)

    def predict(
        self,
        run: Any = None,
        start: float | None = None,
        horizon: float = 1.0,
        every: float | None = None,
        *,
        whole: bool = False,
    ) -> pd.DataFrame:
        """Motion that the model predicts under the recorded torques, of servos in closed loop.

        Parameters
        ----------
        run : str, Recording, DataFrame, Dataset or None
            Name of a recording of the fit's data, or other data; None: all of the fit's data.
        start : float [s], optional
            One prediction from so long after the first sample; None: one after the other.
        horizon : float [s]
            How far ahead.
        every : float [s], optional
            Between two starts; None: one prediction begins where the one before ends.
        whole : bool
            Simulate whole recordings from their start instead.

        Returns
        -------
        DataFrame
            See `frictionid.predict`.
        """
        data = self._data_of(run)
        return predict(self.friction, data, horizon, every, start=start, whole=whole)

    def score(
        self,
        test: Any,
        horizons: Sequence[float] = HORIZONS,
        *,
        sample_time: float | None = None,
        whole: bool = False,
        initial_states: Literal["filter", "model"] = "filter",
    ) -> pd.DataFrame:
        """Scores on other data, one step ahead and over seconds; see `frictionid.evaluate`.

        Returns
        -------
        DataFrame
            Columns score, statistic, horizon_s, joint, value, unit.
        """
        scores = evaluate(
            {self.law: self},
            self._data_of(test),
            horizons,
            sample_time=sample_time,
            whole=whole,
            initial_states=initial_states,
        )
        return scores[["score", "statistic", "horizon_s", "joint", "value", "unit"]]

    def plot(
        self,
        kind: str = "friction",
        run: Any = None,
        start: float | None = None,
        horizon: float = 1.0,
    ) -> Any:
        """A Matplotlib figure.

        Parameters
        ----------
        kind : str
            "friction" over velocity, with its 95 % band where it was shot; "motion", predicted over
            measured; "correlation" of the parameters of a fit by shooting.
        run, start, horizon
            Of "motion", as in `predict`; the first recording, if no run is named.
        """
        if kind not in PLOTS:
            raise InputError(f"plot: kind = {kind!r} is unknown; {nearest(kind, PLOTS)}")
        if kind == "motion":
            data = self._data_of(run)
            data = replace(data, recordings=data.recordings[:1])
            table = predict(self.friction, data, horizon, start=start)
            joints, units = data.mechanism.joints, data.mechanism.position_units
            return drawn(partial(predicted_figure, table, joints, units))
        if kind == "correlation":
            if self.convergence is None:
                raise InputError("plot: correlations are known of fits by shooting only")
            return drawn(partial(fit_correlation, self.convergence, self.joints))
        if self.friction.mechanism:
            raise InputError("plot: a model without physics has no friction torque to draw")
        return drawn(partial(fit_figure, self.friction, self._data_of(run)))

    def show(self) -> None:
        """Print it, at the prompt as on the command line."""
        say(self._headline)
        show_fit(self.friction, self.joints)
        if self._assumption:
            say(self._assumption)

    def save(self, path: str | Path) -> None:
        """Write a model file (JSON), weights of a network beside it."""
        save_model(self.friction, Path(path))

    def export(
        self, to: str, out: str | Path, *, settings: Any = None, replace: bool = False
    ) -> Any:
        """Write the friction for a simulator, a controller or a drive.

        Parameters
        ----------
        to : str
            The format, such as "c", "python" or "mujoco"; docs/export.md has all.
        out : str or Path
            File to write.
        settings : dict, optional
            As of `frictionid.export`, such as {"into": "arm.urdf", "joints": ["a", "b"]}.
        replace : bool
            Whether files that exist may be written over.

        Returns
        -------
        Exported
            See `frictionid.export`.
        """
        import frictionid as fid  # whose export knows fits

        return fid.export(self, to, out, settings=settings, replace=replace)

    @property
    def _assumption(self) -> str:
        """What a one-step fit takes for granted; nothing where a calibration was estimated."""
        friction = self.friction
        if self.method != "one_step" or friction.calibration or not friction.provenance.recipe:
            return ""
        return "" if friction.mechanism or not friction.theta.shape[-1] else ASSUMED

    @property
    def _headline(self) -> str:
        method = "one-step" if self.method == "one_step" else self.method.replace("_", " ")
        if published := self.friction.provenance.source:
            return f"{self.law}, {published}"
        if self.data is None:
            source = self.friction.provenance.dataset
            where = f" to {source!r}, from a file" if source else ", from a file"
        else:
            recordings, seconds = self.data.recordings, self.data.seconds
            several = "s" * (len(recordings) > 1)
            where = f" to {self.data.name!r}: {len(recordings)} recording{several}, {seconds:.3g} s"
        apart = self.friction.provenance.sample_time
        thinned = f", samples {1e3 * apart:.3g} ms apart" if apart else ""
        return f"{self.law}, {method} fit{where}{thinned}"

    def _grid(self) -> Array:
        """Velocities (V, n) of the fit's data, or of its bands."""
        if self.data is not None:
            return velocity_grid(speeds(self.data, EstimatedStates(self.data).by(INTEGRAL.states)))
        if self.convergence is not None and self.convergence.bands is not None:
            return np.asarray(self.convergence.bands.velocity)
        raise InputError("the model is from a file and knows no speeds: name the velocities")

    def _data_of(self, run: Any) -> Dataset:
        """Data that a user names."""
        if run is None:
            if self.data is None:
                raise InputError("the model is from a file and has no data: name a data set")
            return self.data
        if isinstance(run, str) and self.data is not None:
            return replace(self.data, recordings=(self.data[run],))
        if isinstance(run, Dataset | str | Path):
            return dataset_of(run)
        if self.data is None:
            raise InputError("the model is from a file: give a data set, by Dataset.from_frames")
        if isinstance(run, Recording):
            return replace(self.data, recordings=(run,), truth=None)
        return self.data.with_frames(run)
