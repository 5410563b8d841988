"""What a method makes of data: friction, parameters with their covariance, and how the fit went.

`Fit` is what every method gives; `Fit.estimates` is what files, tables and pictures need of it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.data.plants import Calibration, plant_of
from frictionid.data.recordings import Dataset
from frictionid.friction import Friction, present
from frictionid.friction.provenance import Bands, Estimate, Estimates

from .one_step.residual import Problem
from .parameter_block import IDEAL, Parameter

_NORMAL = 1.96, 1.645  # half-widths of 95 and 90 % over standard errors
_DRAWS = 2000
UNEXPLAINED = "what is fitted does not explain the motion"
BEYOND = 1.5  # of the curves' velocities: that far the bands reach, to be seen growing


@dataclass(frozen=True, eq=False)
class Covariance:
    """Parameters of a fit with their covariance.

    parameters, values : (D,) of the free parameters
    matrix : (D, D), of the t distribution with `freedom` degrees; rows of parameters at a bound or
        in an undetermined combination are infinite on the diagonal
    singular : (D,) singular values of the normal equations, scaled to ones on the diagonal
    undetermined : combinations of parameters that the data do not determine, in words
    bound : (D,) true where a parameter lies at a bound
    clusters : number of recordings, or stretches of time, whose scatter was taken
    meaningless : (D,) true for parameters that mean nothing where others may be zero, and for these
    """

    parameters: tuple[Parameter, ...] = ()
    values: Array = field(default_factory=lambda: np.zeros(0))
    matrix: Array = field(default_factory=lambda: np.zeros((0, 0)))
    freedom: int = 1
    singular: Array = field(default_factory=lambda: np.zeros(0))
    undetermined: tuple[str, ...] = ()
    bound: Array = field(default_factory=lambda: np.zeros(0, dtype=bool))
    clusters: int = 0
    meaningless: Array = field(default_factory=lambda: np.zeros(0, dtype=bool))

    @property
    def error(self) -> Array:
        """Standard errors (D,)."""
        return np.sqrt(np.diag(self.matrix))

    @property
    def correlation(self) -> Array:
        """Correlation (D, D), NaN for parameters without a finite error."""
        error = np.where(np.isfinite(self.error) & (self.error > 0), self.error, np.nan)
        return self.matrix / np.outer(error, error)

    @property
    def determined(self) -> Array:
        """True (D,) for parameters with a finite error, at no bound and not held."""
        loose = np.array([p.tolerance > 0 for p in self.parameters], dtype=bool)
        return np.isfinite(self.error) & ~self.bound & loose

    def interval(self, level: float = 0.95) -> Array:
        """Lower and upper ends (D, 2) of each parameter's interval; its bounds limit it."""
        half = stdtrit(self.freedom, 0.5 + level / 2) * self.error
        low, high = np.array([(p.low, p.high) for p in self.parameters]).reshape(-1, 2).T
        return np.stack(
            [np.maximum(self.values - half, low), np.minimum(self.values + half, high)], axis=-1
        )

    @property
    def each(self) -> "Covariance":
        """The covariance with a shared parameter at each of its places, correlated by one."""
        at = np.repeat(np.arange(len(self.values)), [len(p.places) for p in self.parameters])
        if len(at) == len(self.values):
            return self
        matrix = np.asarray(self.matrix[np.ix_(at, at)])
        forget(matrix, np.flatnonzero(~np.isfinite(matrix).all(axis=1)))  # also of each other
        return replace(
            self,
            parameters=tuple(single for p in self.parameters for single in p.each),
            values=self.values[at],
            matrix=matrix,
            bound=self.bound[at],
            meaningless=self.meaningless[at],
        )

    @property
    def identified(self) -> Array:
        """True (D,) for parameters that the data determine.

        Not at a bound, and with a 95 % interval no wider, to either side, than the value: of a
        delay, a bias or an offset, whose value may well be zero, the interval must only be finite.
        Nor does a parameter count that means nothing where others may be zero, such as a Stribeck
        velocity, nor these others: a peak that is not there is found at some velocity by chance.
        """
        return self.significant() & ~self.meaningless

    def significant(self, trials: int = 1) -> Array:
        """True (D,) for parameters with an interval that tells them from zero, where that matters.

        trials : in so many independent ones together chance exceeds the interval in 5 % of cases
        """
        half = stdtrit(self.freedom, 1.0 - 0.025 / trials) * self.error
        zero = np.array([IDEAL.get(p.block) == 0.0 for p in self.parameters], dtype=bool)
        small = half <= np.abs(self.values)
        return np.asarray(np.isfinite(half) & ~self.bound & (small | zero), dtype=bool)

    def draws(self) -> Array:
        """Parameters (2000, D) drawn from their t distribution; those without an error stay."""
        finite = np.isfinite(self.error)
        value, vector = np.linalg.eigh(self.matrix[np.ix_(finite, finite)])
        root = vector * np.sqrt(np.maximum(value, 0.0))
        generator = np.random.default_rng(0)
        normal = generator.standard_normal((_DRAWS, int(finite.sum())))
        chi = generator.chisquare(self.freedom, _DRAWS) / self.freedom
        out = np.repeat(self.values[None], _DRAWS, axis=0)
        out[:, finite] += (normal @ root.T) / np.sqrt(chi)[:, None]
        return out


def forget(matrix: Array, which: Array | list[int]) -> None:
    """Make the covariance of some parameters infinite, in place."""
    matrix[which], matrix[:, which] = 0.0, 0.0
    matrix[which, which] = np.inf


@dataclass(frozen=True, eq=False)
class Fit:
    """What a method makes of data: friction (n, P) of all of them, and how well it is known.

    covariance : of the free parameters; of none for networks by one-step recipes
    diagnostics : of shooting and inverse dynamics: how the fit went; None of one-step fits
    fitted : the friction as a function of the free parameters, of a network that of a few
        combinations of its weights
    folds : friction (F + 1, n, P) of the folds and, last, of all data
    problem, weights : the one-step problem that was fitted, with the weights (K,) of all data
    beside : number of parameters of the calibration that corrected its data, which these determined
    """

    friction: Friction
    covariance: Covariance = Covariance()
    diagnostics: Estimates | None = None
    fitted: Friction | None = None
    folds: Friction | None = None
    problem: Problem | None = None
    weights: Array | None = None
    beside: int = 0

    @property
    def calibration(self) -> Calibration:
        """Base parameters, and what the sensors do."""
        assert self.friction.calibration is not None
        return self.friction.calibration

    def bands(self, w: Array) -> tuple[Array, Array]:
        """Half-widths (V, n) [N m] of 95 % bands of each joint's curve at velocities w (V, n).

        Pointwise, and simultaneous over all its velocities.
        """
        slope = self._slopes(w)
        covariance = self.covariance
        finite = np.isfinite(covariance.error)
        inner, slope = covariance.matrix[np.ix_(finite, finite)], slope[..., finite]
        error = np.sqrt(np.einsum("vnd,de,vne->vn", slope, inner, slope))
        point = stdtrit(covariance.freedom, 0.975) * error
        off = (covariance.draws() - covariance.values)[:, finite]
        size = np.abs(np.einsum("vnd,bd->bvn", slope, off))
        ratio = (size / np.maximum(error, 1e-300)).max(axis=1)
        return point, np.quantile(ratio, 0.95, axis=0) * error

    def _slopes(self, w: Array) -> Array:
        """Derivatives (V, n, D) of each joint's curve in the free parameters."""
        covariance = self.covariance
        assert self.fitted is not None
        out = np.zeros((*w.shape, len(covariance.parameters)))
        theta = np.asarray(self.fitted.theta, dtype=float)
        places = {k: p.place for k, p in enumerate(covariance.parameters) if p.block == "friction"}
        for j in range(len(theta)):
            columns = [k for k, place in places.items() if place[0] == j]
            if not columns:
                continue
            step = np.zeros((len(columns), *theta.shape))
            for i, k in enumerate(columns):
                step[i][places[k]] = 1e-6 * max(1e-3, abs(theta[places[k]]))
            both = (
                replace(self.fitted, theta=theta + s * step, calibration=None) for s in (1.0, -1.0)
            )
            up, down = (friction.curve(w)[..., j] for friction in both)
            out[:, j, columns] = ((up - down) / (2 * step.sum(axis=(1, 2))[:, None])).T
        return out

    def errors(self) -> Array:
        """Standard errors (n, P) of the friction's parameters, NaN where none are known."""
        out = np.full(np.shape(self.friction.theta), np.nan)
        for p, error in zip(self.covariance.parameters, self.covariance.error, strict=True):
            if p.block == "friction":
                out[p.place] = error
        return out

    def half_widths(self) -> Array:
        """Half the width (n, P) of 95 % intervals; of one-step fits, of the noise alone."""
        return stdtrit(self.covariance.freedom, 0.975) * self.errors()

    def estimates(self, dataset: Dataset, grid: Array) -> Estimates:
        """Parameters with intervals, correlation, curves with bands, and how it went.

        Each parameter has its nominal value beside it: the data set's mechanism gives base
        parameters, its servo a motor's constants, a log without faults the rest; friction has none.
        Where recordings have masses of their own, base parameters are those of their mean. A
        network's combinations, whose values mean nothing, are left out: its uncertainty is in its
        bands. Bands reach half as far again as the velocities of the grid (V, n).
        """
        covariance, friction, w = self.covariance, self.friction, BEYOND * grid
        unnamed = "friction" if friction.law.is_network else ""
        named = [k for k, p in enumerate(covariance.parameters) if p.block != unnamed]
        curve = friction.curve(w)
        return replace(
            self.diagnostics or Estimates(),
            parameters=tuple(_estimates(covariance, dataset, named)),
            correlation=covariance.correlation[np.ix_(named, named)],
            covariance=covariance.matrix[np.ix_(named, named)],
            freedom=covariance.freedom,
            clusters=covariance.clusters,
            singular_values=covariance.singular,
            undetermined=covariance.undetermined,
            driven=bool(dataset.actuated.any()),
            bands=Bands(w, curve, *self.bands(w)),
        )


def _estimates(
    covariance: Covariance, dataset: Dataset, named: Sequence[int]
) -> Iterator[Estimate]:
    """Some of the parameters with intervals and nominal values."""
    inner, outer = covariance.interval(0.9), covariance.interval(0.95)
    identified, error = covariance.identified, covariance.error
    base_shift = recordings_own(dataset)
    for k in named:
        p = covariance.parameters[k]
        shift = base_shift[p.place[0]] if p.block == "inertia" else 0.0
        (a, b), (low, high) = inner[k] + shift, outer[k] + shift
        yield Estimate(
            *(p.block, p.name, p.unit),
            p.place[0] if p.block != "inertia" and p.place else None,
            float(covariance.values[k] + shift),
            float(error[k]),
            (float(a), float(b)),
            (float(low), float(high)),
            bool(covariance.bound[k]),
            bool(identified[k]),
            p.tolerance if 0.0 < p.tolerance < np.inf else None,
            _nominal(p, dataset, shift),
            p.tolerance == 0.0,
        )


def recordings_own(dataset: Dataset) -> Array:
    """What the recordings' own parameters add to the table's base parameters (nb,), on average."""
    return plant_of(dataset).p.mean(axis=0) - dataset.mechanism.nominal_base


def own_base(dataset: Dataset, parameters: Mapping[str, float]) -> dict[str, float]:
    """Base parameters under parameters that a model brings, on average over the recordings."""
    if not parameters:
        return {}
    p = plant_of(dataset, parameters).p.mean(axis=0)
    return dict(zip(dataset.mechanism.base_names, map(float, p), strict=True))


def _nominal(parameter: Parameter, dataset: Dataset, shift: float) -> float | None:
    if parameter.block == "inertia":
        return float(dataset.mechanism.nominal_base[parameter.place[0]] + shift)
    if parameter.block == "actuator":
        value = getattr(dataset.recordings[0].servo, parameter.name, None)
        return None if value is None else float(value)
    return IDEAL.get(parameter.block)


def estimates_of(friction: Friction, joints: Sequence[str] = ()) -> tuple[Estimate, ...]:
    """Estimates of a fitted friction (n, P): those of shooting or of pooling, else of its numbers.

    Intervals of a one-step fit are those of its provenance; where that has none, nothing is said
    to be unidentified. A network's weights and terms that a sparse law does not have are left out.

    joints : names; those of the friction where they are missing
    """
    source, law = friction.provenance, friction.law
    fitted = source.refined or source.pooled
    if fitted is not None or law.is_network:
        return () if fitted is None else fitted.parameters
    theta, half = np.asarray(friction.theta, dtype=float), source.half_widths
    names = joints or friction.joints
    return tuple(
        _estimate(friction, names[j], (j, i), None if half is None else float(half[j, i]))
        for j, i in np.argwhere(present(law, theta)).tolist()
    )


def _estimate(
    friction: Friction, joint: str, place: tuple[int, int], half: float | None
) -> Estimate:
    """A parameter of a one-step fit with half the width of its interval, NaN for an endless one."""
    j, i = place
    name, value = friction.law.names[i], float(friction.theta[place])
    reach = np.inf if half is None or np.isnan(half) else half
    error = reach / _NORMAL[0]
    inner = _NORMAL[1] * error
    return Estimate(
        *("friction", f"{name} of {joint}", friction.units_at(j)[i], j, value, error),
        (value - inner, value + inner),
        (value - reach, value + reach),
        identified=half is None or reach <= abs(value),
    )
