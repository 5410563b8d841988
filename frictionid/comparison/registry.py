"""The only place where parts have names: laws of model files, what suites and commands can name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from frictionid.comparison.kinds import Choice, Kind, Part
from frictionid.data.state_estimators import RTS, Backward, SavitzkyGolay
from frictionid.fitting.identifiers import (
    BlackBox,
    Frictionless,
    LeastSquares,
    Linear,
    Published,
    Regressor,
    SINDy,
    SparseDynamics,
)
from frictionid.fitting.identifiers.estimators import estimator_named
from frictionid.fitting.networks.compressed import CompressedNetwork
from frictionid.fitting.networks.network import Network
from frictionid.fitting.networks.state_network import StateNetwork
from frictionid.fitting.one_step.formulation import INTEGRAL, STUDY, Recipe
from frictionid.fitting.parameters import (
    ActuatorBlock,
    BacklashBlock,
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
    ParameterBlock,
    TargetDelayBlock,
)
from frictionid.friction import Friction
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
    DahlMotorLoad,
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
    PerJoint,
    Play,
    Quadratic,
    Ripple,
    Spline,
    StateLibrary,
    StateLSTM,
    StateMLP,
    Stribeck,
    Sum,
    Table,
    Thermal,
    WindowMLP,
)
from frictionid.friction.model_files import load_model, own_law

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
    "per_joint": PerJoint,
    "play": Play,
    "sum": Sum,
    "library": Library,
    "table": Table,
    "thermal": Thermal,
    "state_library": StateLibrary,
    "film_lag": FilmLag,
    "film_lag_asymmetric": AsymmetricFilmLag,
    "dahl": Dahl,
    "dahl_motor_load": DahlMotorLoad,
    "lugre": LuGre,
    "lugre_asymmetric": AsymmetricLuGre,
    "ensemble": Ensemble,
    "mlp": MLP,
    "window_mlp": WindowMLP,
    "lstm": LSTM,
    "state_mlp": StateMLP,
    "state_lstm": StateLSTM,
}


def friction_of(path: Path, own_laws: Sequence[str] = ()) -> Friction:
    """Friction of a model file, whose law is built in or one of `module:Class`."""
    own = {law.__name__: law for law in map(own_law, own_laws)}
    return load_model(path, {**LAWS, **own})


def _published(file: str) -> Friction:
    """The friction of a model `file`."""
    return friction_of(Path(file))


_FROM_THE_PROBLEM = ("sample_time", "joints", "others")
_OF_SEQUENCES = ("burn_in", "targets")


def _kind(*parts: Part, choices: Sequence[Choice] = (), without: Sequence[str] = ()) -> Kind:
    """A kind, without the arguments that its identifier takes from the problem, and others."""
    return Kind(parts, tuple(choices), frozenset((*_FROM_THE_PROBLEM, *without)))


def _law(symmetric: type, asymmetric: type, identifier: Part = LeastSquares) -> Kind:
    """A law whose levels differ by direction with `symmetric = false`."""
    other = Choice("symmetric", False, (identifier, asymmetric))
    return _kind(identifier, symmetric, choices=[other])


def _variant(law: type, key: str, variant: type) -> Kind:
    """A law, and another one with `key = true`."""
    return _kind(LeastSquares, law, choices=[Choice(key, True, (LeastSquares, variant))])


_SOLVERS = (
    Choice("solver", "levenberg_marquardt", (CompressedNetwork, MLP)),
    Choice("solver", "adam", (Network, MLP)),
    Choice("inputs", "all", (Network, MLP)),
)

IDENTIFIERS: Mapping[str, Kind] = {
    "none": _kind(Frictionless),
    "coulomb_viscous": _law(CoulombViscous, AsymmetricCoulombViscous),
    "motor_load": _variant(MotorLoad, "squared", MotorLoadQuadratic),
    "gear_load": _kind(LeastSquares, GearLoad),
    "load_dependent": _variant(LoadDependent, "stribeck", LoadDependentStribeck),
    "quadratic": _kind(LeastSquares, Quadratic),
    "stribeck": _law(Stribeck, AsymmetricStribeck),
    "spline": _law(Spline, AsymmetricSpline, Linear),
    "ripple": _kind(LeastSquares, Ripple),
    "per_joint": _kind(LeastSquares, PerJoint),
    "play": _kind(LeastSquares, Play),
    "sum": _kind(LeastSquares, Sum),
    "thermal": _kind(LeastSquares, Thermal),
    "sindy": _kind(SINDy, Library),
    "sklearn": _kind(Regressor, estimator_named, without=["inputs"]),
    "sindy_dynamics": _kind(BlackBox, SparseDynamics),
    "film_lag": _law(FilmLag, AsymmetricFilmLag),
    "dahl": _kind(LeastSquares, Dahl),
    "dahl_motor_load": _kind(LeastSquares, DahlMotorLoad),
    "lugre": _law(LuGre, AsymmetricLuGre),
    "mlp": _kind(CompressedNetwork, MLP, choices=_SOLVERS, without=_OF_SEQUENCES),
    "window_mlp": _kind(Network, WindowMLP, without=["inputs", *_OF_SEQUENCES]),
    "lstm": _kind(Network, LSTM, without=["inputs"]),
    "blackbox_mlp": _kind(
        *(BlackBox, StateNetwork, Network, StateMLP), without=["inputs", *_OF_SEQUENCES]
    ),
    "blackbox_lstm": _kind(BlackBox, StateNetwork, Network, StateLSTM, without=["inputs"]),
    "published": _kind(Published, _published),
}
ESTIMATORS: Mapping[str, Kind] = {
    "backward": Kind((Backward,), internal=frozenset({"support"})),
    "savgol": Kind((SavitzkyGolay,)),
    "rts": Kind((RTS,), internal=frozenset({"support"})),
}
RECIPES: Mapping[str, Recipe] = {recipe.name: recipe for recipe in (STUDY, INTEGRAL)}
BLOCKS: Mapping[str, Callable[..., ParameterBlock]] = {
    "friction": FrictionBlock,
    "inertia": InertiaBlock,
    "delay": DelayBlock,
    "gain": GainBlock,
    "bias": BiasBlock,
    "offset": OffsetBlock,
    "actuator": ActuatorBlock,
    "target_delay": TargetDelayBlock,
    "backlash": BacklashBlock,
}
