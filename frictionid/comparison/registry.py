"""What suites, commands and model files can name: the laws by their kinds, and other parts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

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
from frictionid.fitting.identifiers.regressor import estimator_named
from frictionid.fitting.networks.compressed import CompressedNetwork
from frictionid.fitting.networks.network import Network, StateNetwork
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
from frictionid.friction import Friction, Law, laws
from frictionid.friction.laws import (
    LSTM,
    MLP,
    Library,
    NoFriction,
    Spline,
    StateLSTM,
    StateMLP,
    Table,
    WindowMLP,
)
from frictionid.friction.model_files import load_model, own_law


def _built_in() -> Iterator[type[Law]]:
    """The laws of the files in `friction/laws` that model files can hold."""
    for module in iter_modules(laws.__path__, f"{laws.__name__}."):
        for law in vars(import_module(module.name)).values():
            if not (isinstance(law, type) and issubclass(law, Law)):
                continue
            if law.kind and law.__module__ == module.name and "__dataclass_params__" in vars(law):
                yield law


LAWS: Mapping[str, type[Law]] = dict(sorted((law.kind, law) for law in _built_in()))


def friction_of(path: Path, own_laws: Sequence[str] = ()) -> Friction:
    """Friction of a model file, whose law is built in or one of `module:Class`."""
    user_laws = {law.__name__: law for law in map(own_law, own_laws)}
    return load_model(path, {**LAWS, **user_laws})


def _published(file: str) -> Friction:
    """The friction of a model `file`."""
    return friction_of(Path(file))


_FROM_THE_PROBLEM = ("sample_time", "joints", "others")
_OF_SEQUENCES = ("burn_in", "targets")


def _kind(*parts: Part, choices: Sequence[Choice] = (), without: Sequence[str] = ()) -> Kind:
    """A kind, without the arguments that its identifier takes from the problem, and others."""
    return Kind(parts, tuple(choices), frozenset((*_FROM_THE_PROBLEM, *without)))


_SOLVERS = (
    Choice("solver", "levenberg_marquardt", (CompressedNetwork, MLP)),
    Choice("solver", "adam", (Network, MLP)),
    Choice("inputs", "all", (Network, MLP)),
)


# Laws of identifiers of their own; all others are fitted by nonlinear least squares.
_FITTED_OTHERWISE: Mapping[str, Kind] = {
    "spline": _kind(Linear, Spline),
    "sindy": _kind(SINDy, Library),
    "sklearn": _kind(Regressor, estimator_named, without=["inputs"]),
    "sindy_dynamics": _kind(BlackBox, SparseDynamics),
    "mlp": _kind(CompressedNetwork, MLP, choices=_SOLVERS, without=_OF_SEQUENCES),
    "window_mlp": _kind(Network, WindowMLP, without=["inputs", *_OF_SEQUENCES]),
    "lstm": _kind(Network, LSTM, without=["inputs"]),
    "blackbox_mlp": _kind(
        *(BlackBox, StateNetwork, Network, StateMLP), without=["inputs", *_OF_SEQUENCES]
    ),
    "blackbox_lstm": _kind(BlackBox, StateNetwork, Network, StateLSTM, without=["inputs"]),
    "published": _kind(Published, _published),
}
IDENTIFIERS: Mapping[str, Kind] = {
    "none": _kind(Frictionless),
    **{
        kind: _kind(LeastSquares, law)
        for kind, law in LAWS.items()
        if not (law.is_network or law.is_sparse or law in (NoFriction, Table))
    },
    **_FITTED_OTHERWISE,
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
