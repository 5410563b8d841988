"""What the report is about: models, data sets and scores of a comparison, sorted for reading."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.comparison.result_folder import Document
from frictionid.comparison.results import Results, task_provenance
from frictionid.evaluation.curves import Beyond
from frictionid.evaluation.hysteresis import HysteresisLoop
from frictionid.evaluation.predicted_motion import HorizonErrors, read_errors
from frictionid.evaluation.reference_model import StartErrors
from frictionid.evaluation.score_frame import score_tables
from frictionid.evaluation.statistics import CorrelatedTest, paired
from frictionid.friction.provenance import Estimate, Estimates, Provenance

from .numbers import either, norm_unit

ROLES = ("none", "fitted", "given", "truth")
RIVALS = ("fitted", "given")  # models that are ranked
ANY = ""  # recipe of a model that no recipe changes
REPORTED = (0.5, 1.0)  # [s], horizons that the findings are about, where a suite has them
EULER, INTEGRAL = "one_step_euler_mean", "one_step_integral_rms"


def rollout(horizon: float, statistic: str = "median", score: str = "rollout_angle") -> str:
    """Column of a rollout score after a horizon [s].

    >>> rollout(0.5)
    'rollout_angle_median_0.5s'
    """
    return f"{score}_{statistic}_{horizon:g}s"


class DataDescription(NamedTuple):
    """A data set as datasets.json describes it; V velocities, n joints and other parts, SI units.

    Attributes
    ----------
    velocity, truth : (V, n), grid of the friction curves, and the true ones or None
    density : (n, B), how often each velocity occurred, in bins over the grid
    measured : (2, n), lowest and highest velocity that occurred
    true_parameters : what a simulation knows of each block of parameters
    velocities, speeds, check : (N, n) samples, their distribution, findings of `check`; or None
    hashes : of its files
    """

    joints: tuple[str, ...]
    torque_units: tuple[str, ...]
    position_units: tuple[str, ...]
    recordings: int
    samples: int
    seconds: float
    velocity: Array
    density: Array
    measured: Array
    truth: Array | None = None
    velocities: Array | None = None
    true_parameters: Document = {}
    speeds: Document | None = None
    check: Document | None = None
    hashes: frozenset[str] = frozenset()

    @property
    def angle_unit(self) -> str:
        """Unit of errors over all joints; where some turn and others slide, their joints' sizes."""
        return norm_unit(self.position_units)

    @property
    def velocity_unit(self) -> str:
        """Unit of velocities, or those of joints of both kinds."""
        return either([f"{unit}/s" for unit in self.position_units])

    @property
    def coordinate(self) -> str:
        """What the joints' coordinates are called."""
        return "angle" if self.angle_unit == "rad" else "position"

    @property
    def size(self) -> str:
        """How much was recorded, in words."""
        many = "s" if self.recordings != 1 else ""
        return f"{self.recordings} recording{many}, {self.samples} samples, {self.seconds:.0f} s"

    @property
    def true_joints(self) -> tuple[str, ...]:
        """Numbers "1", "2" ... of the joints where true curves are known, else none."""
        return tuple(str(j + 1) for j in range(len(self.joints)) if self.truth is not None)


def description_of(document: Document, hashes: Iterable[object] = ()) -> DataDescription:
    """A data set's description by its entry of datasets.json, and hashes of its files."""
    arrays = ("velocity", "density", "measured", "truth", "velocities")
    values: dict[str, Any] = {
        key: np.asarray(document[key], dtype=float) if key in arrays else document[key]
        for key in DataDescription._fields
        if document.get(key) is not None
    }
    for name in ("joints", "torque_units", "position_units"):
        values[name] = tuple(map(str, values[name]))
    return DataDescription(**values, hashes=frozenset(map(str, hashes)))


_LOADS = {"load_coefficient", "loss", "motor"}  # parameters of friction that grows with a load


@dataclass(frozen=True, eq=False)
class Model:
    """A line of the tables: an identifier with the recipe by which it was fitted.

    Attributes
    ----------
    task : position of its task among the results, the index of its scores
    recipe : its name, "" where no recipe plays a part
    role : "none" (no friction), "fitted", "given" (fixed numbers) or "truth"
    label : the identifier's name, with the seed where seeds differ
    name : label, with the recipe where the comparison has several
    curves : (F + 1, V, n) [N m], the friction of all data last
    theta : (F, n, P)
    document, settings : the model file's content; constructor calls of identifier and recipe
    provenance : of the model, and what shooting or inverse dynamics estimated
    base : base parameters by the mechanism's parameters that the model brings, if any
    loops : friction along sinusoids, where the suite asked for it
    method : scheme of the recipe, and what corrects its data
    beyond : friction where no motion was recorded, None of black boxes
    motions, examples : predictions from the same starts as others', and from its own best, median
        and worst start
    errors : of held-out predictions
    torque : over time, measured and modelled, see `frictionid.evaluation.torque_left.torque_parts`
    """

    task: int
    identifier: str
    recipe: str
    role: str
    label: str
    name: str
    curves: Array
    motions: Sequence[Document]
    theta: Array
    document: Document
    settings: Mapping[str, str]
    base: Mapping[str, float] = field(default_factory=dict)
    provenance: Provenance = Provenance()
    loops: Sequence[HysteresisLoop] = ()
    method: Document = field(default_factory=dict)
    beyond: Beyond | None = None
    examples: Sequence[Document] = ()
    errors: HorizonErrors | None = None
    torque: Document = field(default_factory=dict)

    @property
    def curve_name(self) -> str:
        """Its name beside its curve, which is that of joints without load and motor torque."""
        joints = self.document.get("joints", ())
        return f"{self.name}, unloaded" if any(_LOADS & {*joint} for joint in joints) else self.name

    def start_errors(self, horizon: float) -> StartErrors:
        """Errors of held-out predictions after a horizon [s], after NaN the torque left.

        None where they are not on record.
        """
        if self.errors is None:
            return StartErrors(np.empty((0, 1)), np.empty(0, dtype=int))
        return self.errors.after(horizon)

    @property
    def refined(self) -> Estimates | None:
        """What shooting or inverse dynamics estimated, None of other fits."""
        return self.provenance.refined

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Parameters that shooting or inverse dynamics estimated."""
        return () if self.refined is None else self.refined.parameters

    @property
    def scheme(self) -> str:
        """By what it was fitted."""
        return str(self.method.get("scheme", "shooting"))


@dataclass(frozen=True, eq=False)
class SummaryData:
    """Scores of the models on one data set.

    Columns of the frames: "one_step_euler_mean", "rollout_angle_median_0.5s",
    "curve_error_joint1", "n_parameters" ...; indices are positions of tasks.

    Attributes
    ----------
    fitted_on : the data set that the models were fitted to; another one for data that only test
    models : those that were scored on it
    horizons : of the rollouts of the whole comparison [s], ascending
    folds : (task, fold) x columns, scores of each fold
    level : task x columns, as tables have it: mean over the folds one step ahead, else pooled
    scores : score frame of all models with their positions as `task`
    """

    dataset: str
    fitted_on: str
    description: DataDescription
    models: tuple[Model, ...]
    horizons: tuple[float, ...]
    folds: pd.DataFrame
    level: pd.DataFrame
    scores: pd.DataFrame

    @property
    def held_out(self) -> bool:
        """Whether these are the fitted data, judged on held-out folds; else data that only test."""
        return self.dataset == self.fitted_on

    @property
    def novelty(self) -> str:
        """`held_out` in words."""
        return "held out" if self.held_out else "never seen"

    @property
    def reported(self) -> tuple[float, ...]:
        """Horizons [s] that the findings are about: 0.5 and 1 s, or else the last two."""
        return tuple(h for h in REPORTED if h in self.horizons) or self.horizons[-2:]

    @property
    def last_rollout(self) -> str:
        """Column of the median error after the last reported horizon; "" without any."""
        return rollout(self.reported[-1]) if self.reported else ""

    def of_role(self, *roles: str) -> list[Model]:
        """Models of some roles, in their order."""
        return [model for model in self.models if model.role in roles]

    def value(self, model: Model, column: str) -> float:
        """A model's score as it stands in tables; NaN where it has none."""
        if column not in self.level or model.task not in self.level.index:
            return float("nan")
        return float(self.level[column][model.task])

    def best(self, models: Sequence[Model], column: str) -> Model | None:
        """The model of the lowest finite score; None where no model has one."""
        values = np.array([self.value(model, column) for model in models])
        if not np.isfinite(values).any():
            return None
        return models[int(np.argmin(np.where(np.isfinite(values), values, np.inf)))]

    def of_folds(self, model: Model, column: str) -> Array:
        """A model's score in each fold (F,); folds in which nothing was scored are left out."""
        if column not in self.folds:
            return np.empty(0)
        values = self.folds[column].unstack("fold").dropna(axis=1, how="all").sort_index(axis=1)
        return values.loc[model.task].to_numpy() if model.task in values.index else np.empty(0)

    def paired(self, model: Model, other: Model, column: str) -> CorrelatedTest:
        """A model's score less another's, paired over the folds."""
        return paired(self.of_folds(model, column), self.of_folds(other, column))

    def curve_errors(self, model: Model) -> list[float]:
        """Curve error of each joint; empty where no true curve is known."""
        return [self.value(model, f"curve_error_joint{j}") for j in self.description.true_joints]


class Section(NamedTuple):
    """Everything that was fitted to one data set.

    data : scores on that data set first, then on data sets that no fit has seen
    """

    dataset: str
    recipes: tuple[str, ...]
    models: tuple[Model, ...]
    data: tuple[SummaryData, ...]

    @property
    def fitted(self) -> SummaryData:
        """Scores on the data set that was fitted."""
        return self.data[0]

    @property
    def tests(self) -> tuple[SummaryData, ...]:
        """Scores on data sets that no fit has seen."""
        return self.data[1:]

    @property
    def description(self) -> DataDescription:
        """Description of the data set that was fitted."""
        return self.data[0].description

    def of_role(self, *roles: str) -> list[Model]:
        """Models of some roles, in their order."""
        return [model for model in self.models if model.role in roles]

    @property
    def shot(self) -> list[Model]:
        """Models of fits with intervals: by shooting or inverse dynamics."""
        return [model for model in self.models if model.refined is not None]

    def under(self, recipe: str) -> list[Model]:
        """Models that belong beside a recipe: its own, and those that no recipe changes."""
        return [model for model in self.models if model.recipe in (ANY, recipe)]


def sections_of(results: Results) -> tuple[Section, ...]:
    """Sections of a comparison, one for each data set that was fitted."""
    names = dict.fromkeys(task["dataset"] for task in results.tasks)
    return tuple(_section(results, name) for name in names)


def _section(results: Results, dataset: str) -> Section:
    tasks = {i: task for i, task in enumerate(results.tasks) if task["dataset"] == dataset}
    recipes = tuple(dict.fromkeys(str(task["fit"]) for task in tasks.values()))
    models: list[Model] = []
    for number, task in tasks.items():
        model = _model(number, task, tasks.values(), several=len(recipes) > 1)
        if not any(_same(model, other) for other in models):
            models.append(model)
    models.sort(key=lambda model: (ROLES.index(model.role), (ANY, *recipes).index(model.recipe)))
    scored = dict.fromkeys([dataset, *(name for task in tasks.values() for name in task["rows"])])
    scores = results.scores.loc[list(tasks)]
    horizons = tuple(sorted(results.scores["horizon_s"].dropna().unique()))
    data = []
    for name in scored:
        rows = scores[scores["dataset"] == name].rename_axis("task").reset_index()
        hashes = results.provenance.get("data", {}).get(name, {}).values()
        description = description_of(results.datasets[name], hashes)
        shown = tuple(model for model in models if name in tasks[model.task]["rows"])
        frames = *score_tables(rows), rows
        data.append(SummaryData(name, dataset, description, shown, horizons, *frames))
    return Section(dataset, recipes, tuple(models), tuple(data))


def _model(number: int, task: Document, tasks: Iterable[Document], *, several: bool) -> Model:
    """A task's model; `tasks` are all of its section, `several` whether recipes differ there."""
    theta, overall = (
        np.asarray(task[part]["theta"], dtype=float).reshape(task[part]["shape"])
        for part in ("folds", "model")
    )
    source = task_provenance(task)
    identifier, role = str(task["identifier"]), _role(source, theta, overall)
    twins = [t for t in tasks if t["identifier"] == identifier and t["fit"] == task["fit"]]
    differ = any(t["folds"]["theta"] != task["folds"]["theta"] for t in twins)
    label = f"{identifier}, seed {task['seed']}" if differ else identifier
    recipe = str(task["fit"]) if role == "fitted" else ANY
    motions = arrays_of(task["motions"])
    return Model(
        task=number,
        identifier=identifier,
        recipe=recipe,
        role=role,
        label=label,
        name=f"{label} ({recipe})" if several and recipe else label,
        curves=np.asarray(task["curves"], dtype=float),
        motions=[motion for motion in motions if "place" not in motion],
        examples=[motion for motion in motions if "place" in motion],
        errors=read_errors(task["errors"]) if task["errors"] else None,
        torque=arrays_of(task["torque"] or {}),
        theta=theta,
        document=task["model"],
        settings=task["settings"],
        base=task["base"] or {},
        provenance=source,
        loops=[HysteresisLoop(**loop) for loop in arrays_of(task["loops"])],
        method=task["method"],
        beyond=Beyond(**arrays_of(task["beyond"])) if task["beyond"] else None,
    )


def arrays_of(document: Any) -> Any:
    """A document whose lists of numbers are arrays.

    >>> arrays_of([{"name": "a", "values": [1, 2]}])
    [{'name': 'a', 'values': array([1., 2.])}]
    """
    if isinstance(document, Mapping):
        return {key: arrays_of(value) for key, value in document.items()}
    if isinstance(document, list) and document and isinstance(document[0], Mapping):
        return list(map(arrays_of, document))
    return np.asarray(document, dtype=float) if isinstance(document, list) else document


def _role(source: Provenance, theta: Array, overall: Array) -> str:
    if source.source == "truth":
        return "truth"
    if not overall.size:
        return "none"
    # numbers that no fold changes were not fitted
    return "given" if np.array_equal(theta, np.broadcast_to(overall, theta.shape)) else "fitted"


def _same(model: Model, other: Model) -> bool:
    """Whether two models are one: seeds that changed nothing, fixed numbers under two recipes."""
    names = model.identifier == other.identifier and model.recipe == other.recipe
    return names and np.array_equal(model.theta, other.theta)
