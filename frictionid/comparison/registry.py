"""The only place where parts have names: laws of model files, what suites and commands can name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from frictionid.comparison.black_box_settings import blackbox_lstm, blackbox_mlp, sindy_dynamics
from frictionid.comparison.network_settings import lstm, mlp, window_mlp
from frictionid.data.states import RTS, Backward, Estimator, SavitzkyGolay
from frictionid.evaluation import Split
from frictionid.evaluation.hysteresis import HysteresisSettings
from frictionid.friction.laws import (
    LSTM,
    MLP,
    AsymmetricCoulombViscous,
    AsymmetricFilmLag,
    AsymmetricLuGre,
    AsymmetricSpline,
    AsymmetricStribeck,
    CoulombViscous,
    Dahl,
    Ensemble,
    FilmLag,
    GearLoad,
    Library,
    LoadDependent,
    LoadDependentStribeck,
    LuGre,
    MotorLoad,
    MotorLoadQuadratic,
    NoFriction,
    Quadratic,
    Ripple,
    Spline,
    StateLibrary,
    StateLSTM,
    StateMLP,
    Stribeck,
    Table,
    WindowMLP,
)
from frictionid.friction.model_files import load_model
from frictionid.identifiers import (
    Frictionless,
    Identifier,
    LeastSquares,
    Linear,
    Published,
    Regressor,
    SINDy,
)
from frictionid.identifiers.estimators import estimator_named
from frictionid.identifiers.formulation import INTEGRAL, STUDY, Recipe
from frictionid.shooting import Shooting
from frictionid.shooting.parameters import (
    ActuatorBlock,
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
    ParameterBlock,
)

Shape = Literal["tanh", "arctan"]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]

LAWS: Mapping[str, type] = {
    "none": NoFriction,
    "coulomb_viscous": CoulombViscous,
    "coulomb_viscous_asymmetric": AsymmetricCoulombViscous,
    "motor_load": MotorLoad,
    "motor_load_quadratic": MotorLoadQuadratic,
    "gear_load": GearLoad,
    "load_dependent": LoadDependent,
    "load_dependent_stribeck": LoadDependentStribeck,
    "quadratic": Quadratic,
    "stribeck": Stribeck,
    "stribeck_asymmetric": AsymmetricStribeck,
    "spline": Spline,
    "spline_asymmetric": AsymmetricSpline,
    "ripple": Ripple,
    "library": Library,
    "table": Table,
    "state_library": StateLibrary,
    "film_lag": FilmLag,
    "film_lag_asymmetric": AsymmetricFilmLag,
    "dahl": Dahl,
    "lugre": LuGre,
    "lugre_asymmetric": AsymmetricLuGre,
    "ensemble": Ensemble,
    "mlp": MLP,
    "window_mlp": WindowMLP,
    "lstm": LSTM,
    "state_mlp": StateMLP,
    "state_lstm": StateLSTM,
}


def none() -> Identifier:
    """No friction."""
    return Frictionless()


def coulomb_viscous(
    symmetric: bool = True, width: Positive = 0.02, shape: Shape = "tanh"
) -> Identifier:
    """Coulomb and viscous friction by least squares, on request with a level each way."""
    law = CoulombViscous(width, shape) if symmetric else AsymmetricCoulombViscous(width, shape)
    return LeastSquares(law)


def motor_load(squared: bool = False, width: Positive = 0.02, shape: Shape = "tanh") -> Identifier:
    """Coulomb and viscous friction, and a share of the motor torque, by least squares."""
    return LeastSquares((MotorLoadQuadratic if squared else MotorLoad)(width, shape))


def gear_load(
    moment: Annotated[float, Field(ge=0)], width: Positive = 0.02, shape: Shape = "tanh"
) -> Identifier:
    """Friction of a gear that motor and gravity load, by least squares."""
    return LeastSquares(GearLoad(moment, width, shape))


def stribeck(symmetric: bool = True, width: Positive = 0.02, shape: Shape = "tanh") -> Identifier:
    """Stribeck friction by least squares, with levels of its own in each direction on request."""
    law = Stribeck(width, shape) if symmetric else AsymmetricStribeck(width, shape)
    return LeastSquares(law)


def load_dependent(
    stribeck: bool = False, width: Positive = 0.02, shape: Shape = "tanh"
) -> Identifier:
    """Friction that grows with the bearing load by least squares, on request with a peak."""
    return LeastSquares((LoadDependentStribeck if stribeck else LoadDependent)(width, shape))


def quadratic(width: Positive = 0.02, shape: Shape = "tanh") -> Identifier:
    """Coulomb and viscous friction, and a drag that grows with w^2, by least squares."""
    return LeastSquares(Quadratic(width, shape))


def spline(
    symmetric: bool = True,
    knots: Annotated[list[Positive], Field(min_length=2)] | None = None,
    degree: Annotated[int, Field(ge=1, le=3)] = Spline.degree,
    width: Positive = 0.02,
    shape: Shape = "tanh",
) -> Identifier:
    """A friction curve of any shape by least squares, on request one for each direction."""
    law = Spline if symmetric else AsymmetricSpline
    return Linear(law(tuple(knots or Spline.knots), degree, width, shape))


def sindy(
    widths: list[Positive] | None = None,
    powers: list[Count] | None = None,
    velocities: list[Positive] | None = None,
    harmonics: list[Count] | None = None,
    gear: Positive = 1.0,
    load: bool = False,
    direction: bool = False,
    other: bool = False,
    optimizer: Literal["stlsq", "sr3"] = "stlsq",
    thresholds: Annotated[list[Positive], Field(min_length=1)] | None = None,
    sets: bool = True,
    sure: Annotated[float, Field(ge=0)] = SINDy.n_standard_errors,
    ensemble: Annotated[int, Field(ge=0)] = 0,
    width: Positive = 0.02,
    shape: Shape = "tanh",
) -> Identifier:
    """A sparse sum of candidate functions, by pysindy's optimisers.

    sets : try sets of candidates, too: `search` of `SINDy`, which in a suite is a table for tuning
    """
    given = {"widths": widths, "powers": powers, "velocities": velocities, "harmonics": harmonics}
    own = {name: tuple(values) for name, values in given.items() if values is not None}
    settings: dict[str, Any] = {**own, "gear": gear, "load": load, "direction": direction}
    library = Library(width, shape, other=other, **settings)
    limits = tuple(thresholds or SINDy.thresholds)
    return SINDy(library, optimizer, limits, SINDy.ridge, sets, sure, ensemble)


def sklearn(
    estimator: str,
    settings: dict[str, Any] | None = None,
    bins: Annotated[int, Field(ge=2)] = Regressor.bins,
    speeds: Annotated[list[Positive], Field(min_length=2)] | None = None,
) -> Identifier:
    """A regressor of scikit-learn, stored as a tabulated curve."""
    made = estimator_named(estimator, settings or {})
    return Regressor(made, bins=bins, speeds=None if speeds is None else tuple(speeds))


def ripple(
    base: Literal[
        "coulomb_viscous", "coulomb_viscous_asymmetric", "stribeck", "stribeck_asymmetric"
    ] = "coulomb_viscous",
    harmonics: Annotated[list[int], Field(min_length=1)] | None = None,
    gear: Positive = 1.0,
    width: Positive = 0.02,
    shape: Shape = "tanh",
) -> Identifier:
    """A law whose level varies with the angle of the joint, or its gear, by least squares."""
    return LeastSquares(Ripple(base, tuple(harmonics or Ripple.harmonics), gear, width, shape))


def film_lag(symmetric: bool = True, width: Positive = 0.02, shape: Shape = "tanh") -> Identifier:
    """Stribeck friction whose film follows the speed late, by least squares."""
    return LeastSquares((FilmLag if symmetric else AsymmetricFilmLag)(width, shape))


def dahl(width: Positive = 0.02, shape: Shape = "tanh") -> Identifier:
    """Coulomb friction that begins as a spring, by least squares."""
    return LeastSquares(Dahl(width, shape))


def lugre(symmetric: bool = True, width: Positive = 0.02, shape: Shape = "tanh") -> Identifier:
    """Stribeck friction of bristles that bend before they slip, by least squares."""
    return LeastSquares((LuGre if symmetric else AsymmetricLuGre)(width, shape))


def published(file: str) -> Identifier:
    """The friction of a model file, with its own mechanism parameters."""
    return Published(load_model(Path(file), LAWS))


def backward() -> Estimator:
    """Backward differences."""
    return Backward()


def savgol(
    window: int = SavitzkyGolay.window, order: Annotated[int, Field(ge=1)] = SavitzkyGolay.order
) -> Estimator:
    """Local polynomials."""
    return SavitzkyGolay(window, order)


def rts() -> Estimator:
    """Kinematic smoother."""
    return RTS()


def folds(
    count: int = Split.count,
    kind: Literal["recordings", "blocks", "shuffled"] = "recordings",
    gap: float = Split.gap,
    seed: int = Split.seed,
) -> Split:
    """Which samples are held out when."""
    return Split(count, kind, gap, seed)


def loops(
    amplitude: Annotated[list[Positive], Field(min_length=1)] | None = None,
    frequency: Annotated[list[Positive], Field(min_length=1)] | None = None,
    factors: Annotated[list[Positive], Field(min_length=1)] | None = None,
) -> HysteresisSettings:
    """Sinusoids on which friction is shown."""
    sizes, rates = (None if v is None else tuple(v) for v in (amplitude, frequency))
    return HysteresisSettings(sizes, rates, tuple(factors or HysteresisSettings.factors))


IDENTIFIERS: Mapping[str, Callable[..., Identifier]] = {
    "none": none,
    "coulomb_viscous": coulomb_viscous,
    "motor_load": motor_load,
    "gear_load": gear_load,
    "load_dependent": load_dependent,
    "quadratic": quadratic,
    "stribeck": stribeck,
    "spline": spline,
    "ripple": ripple,
    "sindy": sindy,
    "sklearn": sklearn,
    "sindy_dynamics": sindy_dynamics,
    "film_lag": film_lag,
    "dahl": dahl,
    "lugre": lugre,
    "mlp": mlp,
    "window_mlp": window_mlp,
    "lstm": lstm,
    "blackbox_mlp": blackbox_mlp,
    "blackbox_lstm": blackbox_lstm,
    "published": published,
}
ESTIMATORS: Mapping[str, Callable[..., Estimator]] = {
    "backward": backward,
    "savgol": savgol,
    "rts": rts,
}
RECIPES: Mapping[str, Recipe | Shooting] = {
    recipe.name: recipe for recipe in (STUDY, INTEGRAL, Shooting())
}
BLOCKS: Mapping[str, Callable[..., ParameterBlock]] = {
    "friction": FrictionBlock,
    "inertia": InertiaBlock,
    "delay": DelayBlock,
    "gain": GainBlock,
    "bias": BiasBlock,
    "offset": OffsetBlock,
    "actuator": ActuatorBlock,
}
