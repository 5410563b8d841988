"""Where the numbers of a friction are from: the data, the fit, and how well it knows them.

A `Provenance` stands in model files as it is: `document` writes it, `read_provenance` reads it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from frictionid.arrays import Array
from frictionid.config import mistake
from frictionid.data.envelope import Reached
from frictionid.errors import InputError

_LARGEST = 1e100  # beyond it squares overflow


def _numbers(values: Any) -> Array | None:
    return values if values is None else np.asarray(values, dtype=float)  # null within is NaN


def _speeds(values: Any) -> tuple[float, ...]:
    try:
        speeds = tuple(float(value) for value in values or ())
    except (TypeError, ValueError):
        speeds = (np.nan,)
    if not np.isfinite(speeds).all():
        raise ValueError(f"speeds of the model must be speeds [rad/s], not {values!r}")
    return speeds


Numbers = Annotated[Any, BeforeValidator(_numbers)]  # an array, of lists in files
Finite = Annotated[float, Field(gt=-_LARGEST, lt=_LARGEST)]
Pair = tuple[float, float]


@dataclass(frozen=True)
class Estimate:
    """A parameter of a fit, with its 90 and 95 % intervals.

    block : "friction", "inertia", "delay" ...; name : with the joint's
    joint : index of the joint that it belongs to, None for the machine as a whole
    error : standard error, infinite where the data say nothing
    identified : whether the data determine it: its interval is no wider, to either side, than the
        value
    prior : standard deviation, where it had one; nominal : value by the data set's description
    held : whether it stays at a value that the data do not tell; its intervals are assumed
    """

    block: str
    name: str
    unit: str
    joint: int | None
    value: float
    error: float = np.inf
    interval_90: Pair = (-np.inf, np.inf)
    interval_95: Pair = (-np.inf, np.inf)
    at_bound: bool = False
    identified: bool = True
    prior: float | None = None
    nominal: float | None = None
    held: bool = False

    @property
    def parameter(self) -> str:
        """Name without the joint's."""
        return self.name if self.joint is None else self.name.partition(" of ")[0]

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval."""
        return self.interval_95[0]

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval."""
        return self.interval_95[1]

    def holds(self, value: float) -> bool:
        """Whether the 95 % interval holds a value."""
        return self.low <= value <= self.high


class Segment(NamedTuple):
    """A stretch of a recording: its name, begin and end [s], and size of the residual [noise].

    Times are from the recording's first angle, as start and stop of dataset.toml.
    """

    recording: str
    begin: float
    end: float
    size: float


class Residuals(NamedTuple):
    """Residuals of the angles, of each joint (n,): sums of squares [rad^2] and numbers of them.

    Numbers are less the two that a window's free initial state takes.

    parameters : how many the fit is worth by the scatter between clusters, `sandwich.worth`
    clusters : number of recordings, or of stretches of few
    """

    squares: Numbers
    counts: Numbers
    parameters: float
    clusters: int


class OddRecording(NamedTuple):
    """A recording whose residuals stand off from those of the others.

    size : root mean square of its residuals; usual : that of the others, geometric mean [noise];
    p_value : of the difference, times the number of choices of odd ones
    """

    recording: str
    size: float
    usual: float
    p_value: float


class Dropped(NamedTuple):
    """A block that was left out of the fit, and the p-value of the test that found nothing.

    None where predictions went astray.
    """

    block: str
    p_value: float | None


class Bands(NamedTuple):
    """Curves of all joints at velocities (V, n) with half the widths of their bands [N m].

    pointwise : at each velocity; simultaneous : at all velocities
    """

    velocity: Numbers
    curve: Numbers = None
    pointwise: Numbers = None
    simultaneous: Numbers = None
    level: float = 0.95


@dataclass(frozen=True, eq=False)
class Estimates:
    """Parameters that a fit by shooting or inverse dynamics estimated, and how it went.

    angle_noise, torque_noise : (n,) [rad] or [N m], noise of what is fitted, as residuals show it
    residuals : their size in the windows that count; None where torques are fitted
    windows : their number; left_out : those whose prediction jumps with their initial state (a
        joint just misses or just reaches a standstill) and so do not count; unexplained : those
        with residuals of three times the noise and more, which count little or not at all
    odd : recordings that are not explained as the others are
    settled : whether no parameter moved any more; iterations : how many that took
    warnings : sentences on what makes the numbers doubtful as a whole
    dropped : blocks of sensors that were offered and left out, as they showed nothing
    correlation, covariance : (D, D) of the D parameters, NaN and infinite where nothing is known
    freedom : of the t distribution; clusters : recordings, or stretches, whose scatter was taken
    singular_values : of the normal equations; undetermined : combinations of parameters, in words
    driven : whether a motor pulled
    """

    angle_noise: Numbers = ()
    torque_noise: Numbers = ()
    residuals: Residuals | None = None
    windows: int = 0
    left_out: tuple[Segment, ...] = ()
    unexplained: tuple[Segment, ...] = ()
    odd: tuple[OddRecording, ...] = ()
    settled: bool = True
    iterations: int = 0
    warnings: tuple[str, ...] = ()
    dropped: tuple[Dropped, ...] = ()
    parameters: tuple[Estimate, ...] = ()
    correlation: Numbers = ()
    covariance: Numbers = ()
    freedom: int = 1
    clusters: int = 0
    singular_values: Numbers = ()
    undetermined: tuple[str, ...] = ()
    driven: bool = False
    bands: Bands | None = None

    @property
    def beside_friction(self) -> int:
        """How many parameters are not friction's."""
        return sum(e.block != "friction" for e in self.parameters)

    def square(self, values: Array) -> Array:
        """The correlation or covariance, (D, D) also where there is no parameter."""
        return np.reshape(values, 2 * [len(self.parameters)])

    def document(self) -> dict[str, Any]:
        """The estimates as JSON has them."""
        noise = ("angle_noise", "torque_noise")
        return {k: v for k, v in vars(self).items() if k not in noise or np.size(v)}


@dataclass(frozen=True)
class PooledEstimate(Estimate):
    """A parameter of several specimens: their mean, and what another one may have.

    range_95 : of another specimen; tau : standard deviation between specimens, with its interval
    Q, p_value : heterogeneity; models, values, errors : the estimates that were pooled
    """

    range_95: tuple[Finite, Finite] = (0.0, 0.0)
    tau: Finite = 0.0
    tau_95: tuple[Finite, Finite] = (0.0, 0.0)
    Q: Finite = 0.0
    p_value: Finite = 1.0
    models: tuple[str, ...] = ()
    values: tuple[Finite, ...] = ()
    errors: tuple[Annotated[Finite, Field(gt=0)], ...] = ()


def _whole(e: PooledEstimate) -> PooledEstimate:
    """A pooled parameter whose numbers are those of a parameter."""
    pairs = e.interval_90, e.interval_95, e.range_95, e.tau_95
    alike = len(e.values) == len(e.errors) == len(e.models) > 1
    numbers = np.abs([e.value, e.error, *e.interval_90, *e.interval_95])
    if not (alike and all(a <= b for a, b in pairs) and (numbers < _LARGEST).all()):
        raise ValueError(f"{e.name} has other numbers than were written")
    return e


class Pooled(NamedTuple):
    """What several models were pooled to; left_out : sentences on what is no estimate."""

    models: tuple[str, ...]
    parameters: tuple[Annotated[PooledEstimate, AfterValidator(_whole)], ...]
    left_out: tuple[str, ...]


def tables_of(files: Mapping[str, str]) -> dict[str, str]:
    """Hashes of recorded tables among those of a data set's files: a robot's file is no data.

    >>> tables_of({"run1.csv": "1f", "arm.urdf": "c0"})
    {'run1.csv': '1f'}
    """
    return {name: h for name, h in files.items() if not name.lower().endswith((".urdf", ".xml"))}


class Provenance(BaseModel):
    """Where the numbers of a friction are from; others may be noted beside these.

    source, note : of given numbers
    dataset, data : name of the data set, and hashes of its files
    identifier, recipe, seed, sample_time : the fit; settings : identifier and recipe of a task
    equation, equation_errors : of sparse laws, a line for each joint; what stands behind each term
    inclusion : how often draws of the recordings had a term; learning : losses of the folds
    half_widths : (n, P), half the 95 % intervals of a one-step fit, NaN where there is none
    half_widths_hold : what they hold; smoothing_bias : (n, P), where it is in them
    torque : whether each motor's torque is measured; envelopes : what of its torque-speed envelope
    each measured one reaches; limits : how near torques come to those of motors
    equality : tests of equal joints
    torque_left : scores of the torque that the model does not explain of its own data
    refined : of shooting and inverse dynamics; pooled : of several fits
    joints, speeds : names of the parts with friction, and the greatest speed of each in the data
    temperature : at which a law that follows it was taken
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    source: str = ""
    note: str = ""
    dataset: str = ""
    data: Mapping[str, Any] = {}
    identifier: str = ""
    recipe: str = ""
    sample_time: float | None = None
    seed: int = 0
    settings: Mapping[str, Any] = {}
    equation: tuple[str, ...] = ()
    equation_errors: str = "95 % intervals"
    inclusion: tuple[str, ...] = ()
    learning: Mapping[str, Numbers] = {}
    half_widths: Numbers = None
    half_widths_hold: str = ""
    smoothing_bias: Numbers = None
    torque: tuple[str, ...] = ()
    envelopes: tuple[Reached, ...] = ()
    limits: tuple[str, ...] = ()
    torque_left: tuple[tuple[Any, ...], ...] = ()
    refined: Estimates | None = None
    equality: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    speeds: Annotated[Any, BeforeValidator(_speeds)] = ()
    pooled: Pooled | None = None
    temperature: float | None = None

    @property
    def noise_alone(self) -> bool:
        """Whether intervals of a one-step fit leave out the bias of smoothed states."""
        return self.half_widths is not None and self.smoothing_bias is None

    def joint_names(self, count: int) -> tuple[str, ...]:
        """The names of so many joints: as noted, else those of the estimates, else numbers."""
        fitted = self.refined or self.pooled
        read = () if fitted is None else fitted.parameters
        named = {e.joint: e.name.partition(" of ")[2] for e in read if e.block == "friction"}
        return self.joints or tuple(named.get(j) or f"joint {j + 1}" for j in range(count))

    def but(self, notes: Mapping[str, Any]) -> Self:
        """The provenance with other notes."""
        return self.model_copy(update=dict(notes))

    def without(self, names: Iterable[str]) -> Self:
        """The provenance without some notes."""
        return self.model_construct(**{k: v for k, v in self.notes.items() if k not in names})

    @property
    def notes(self) -> dict[str, Any]:
        """What is noted."""
        return {k: v for k, v in self if k in self.model_fields_set}

    def document(self) -> dict[str, Any]:
        """The notes as JSON has them."""
        return self.notes | ({"refined": self.refined.document()} if self.refined else {})


def read_provenance(document: Any, shape: tuple[int, ...]) -> Provenance:
    """Provenance of a document, of a friction whose theta has a shape (..., n, P).

    Raises
    ------
    InputError
        Where a note cannot be read, or is not of such a friction.
    """
    try:
        source = Provenance.model_validate(document)
    except ValidationError as invalid:
        raise InputError(f"provenance.{mistake(invalid)}") from None
    for name in ("half_widths", "smoothing_bias"):
        widths = getattr(source, name)
        if widths is not None and widths.shape != shape[-2:]:
            raise InputError(f"provenance.{name}: it should have shape {shape[-2:]}: fit it again")
    if len(source.joints) not in (0, shape[-2]):
        raise InputError(f"provenance.joints: it should have {shape[-2]} names: fit it again")
    for part in (source.refined, source.pooled):
        for e in () if part is None else part.parameters:
            if e.joint is not None and not 0 <= e.joint < shape[-2]:
                raise InputError(f"provenance: {e.name} is at no joint of the model: fit it again")
    return source
