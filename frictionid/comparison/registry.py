"""What suites, commands and model files can name: kinds of tables, and what each of them makes.

A table is validated against the dataclass that it makes: names, types and defaults of settings are
declared there and nowhere else.
"""

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_type_hints

from pydantic import ValidationError, create_model

from frictionid.config import STRICT, mistake, nearest, unknown
from frictionid.data.state_estimators import RTS, Backward, SavitzkyGolay
from frictionid.errors import InputError
from frictionid.fitting.identifiers import (
    BlackBox,
    Frictionless,
    LeastSquares,
    Published,
    Regressor,
    SINDy,
    SparseDynamics,
)
from frictionid.fitting.identifiers.compressed import CompressedNetwork
from frictionid.fitting.identifiers.network import Network
from frictionid.fitting.identifiers.regressor import estimator_named
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, Recipe
from frictionid.fitting.parameter_block import ParameterBlock
from frictionid.fitting.parameters import (
    ActuatorBlock,
    BacklashBlock,
    BiasBlock,
    DelayBlock,
    EnvelopeBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
    TargetDelayBlock,
)
from frictionid.friction import Friction
from frictionid.friction.laws import (
    LSTM,
    MLP,
    Library,
    NoFriction,
    StateLSTM,
    StateMLP,
    Table,
    WindowMLP,
)
from frictionid.friction.model_files import LAWS, load_model

Part = Callable[..., Any]  # a dataclass, or a function whose arguments are settings


class Choice(NamedTuple):
    """A setting that chooses other parts of a `Kind` where it has this value."""

    key: str
    value: bool | str
    parts: tuple[Part, ...]


class Kind(NamedTuple):
    """What tables of a kind make: an object of dataclasses, or functions, one within the other.

    The first argument of each part takes what the next part makes. All other arguments are settings
    of the table, under their own names and with their own types and defaults.

    parts : from the outside in
    choices : settings that choose other parts; the first one counts that has its value
    internal : arguments that no table sets

    Examples
    --------
    >>> from frictionid.friction.laws import Stribeck
    >>> from frictionid.fitting.identifiers import LeastSquares
    >>> kind = Kind((LeastSquares, Stribeck))
    >>> kind.build({"symmetric": False, "width": 0.1, "iterations": 9}, "identifier").law
    Stribeck(width=0.1, shape='tanh', symmetric=False)
    """

    parts: tuple[Part, ...]
    choices: tuple[Choice, ...] = ()
    internal: frozenset[str] = frozenset()

    @property
    def forms(self) -> tuple[tuple[Part, ...], ...]:
        """Parts by default, and those of each choice."""
        return self.parts, *(choice.parts for choice in self.choices)

    @property
    def settings(self) -> tuple[str, ...]:
        """Names of all settings, whatever is chosen."""
        names = [name for parts in self.forms for name in self._arguments(parts)]
        return tuple(dict.fromkeys([*(choice.key for choice in self.choices), *names]))

    def defaults(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """Settings that a table may leave out, and their values then."""
        arguments = self._arguments(self._chosen(table))
        return {name: a.default for name, a in arguments.items() if a.default is not a.empty}

    def build(self, table: Mapping[str, Any], where: str) -> Any:
        """What a table makes; `where` it stands begins every complaint.

        Raises
        ------
        InputError
            For a setting that is unknown, missing, of another type, or belongs to parts that are
            not chosen, and whatever the parts themselves complain about.
        """
        try:
            values = self.values(table)
            inner: tuple[Any, ...] = ()
            for part in reversed(self._chosen(values)):
                names = list(inspect.signature(part).parameters)[len(inner) :]
                inner = (part(*inner, **{key: values[key] for key in values if key in names}),)
            return inner[0]
        except InputError as error:  # of a part that does not know what it is in
            text = str(error)
            raise InputError(text if text.startswith(where) else f"{where}: {text}") from None

    def values(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """Values of a table's settings, of the types that the parts declare."""
        parts = self._chosen(table)
        arguments = self._arguments(parts)
        # settings of parts that other choices lead to, by the first such choice
        other = {key: c for c in reversed(self.choices) for key in self._arguments(c.parts)}
        fields: dict[str, Any] = {
            name: (a.annotation, ... if a.default is a.empty else None)
            for name, a in arguments.items()
        }
        for key in {choice.key for choice in self.choices} - {*arguments, *other}:
            values = tuple(choice.value for choice in self.choices if choice.key == key)
            fields[key] = bool if isinstance(values[0], bool) else Literal[values], None
        for key in table:
            if key in other and key not in arguments:
                choice = other[key]
                if table[key] != self._arguments(choice.parts)[key].default:
                    raise InputError(
                        f"{key} = {json.dumps(table[key], default=str)} needs "
                        f"{choice.key} = {json.dumps(choice.value)}"
                    )
            elif key not in fields:
                raise InputError(unknown(key, self.settings))
        return _validated(fields, {key: table[key] for key in table if key in fields})

    def _chosen(self, table: Mapping[str, Any]) -> tuple[Part, ...]:
        """The parts that a table chooses."""
        hits = (c.parts for c in self.choices if _same(table.get(c.key), c.value))
        return next(hits, self.parts)

    def _arguments(self, parts: tuple[Part, ...]) -> dict[str, inspect.Parameter]:
        """Arguments of parts that are settings, with resolved types."""
        out = {}
        for part in parts:
            types = get_type_hints(part, include_extras=True)
            arguments = list(inspect.signature(part).parameters.values())
            for a in arguments if part is parts[-1] else arguments[1:]:
                if a.name not in self.internal:
                    out[a.name] = a.replace(annotation=types[a.name])
        return out


def _validated(fields: Mapping[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """The table's values, of the types of the fields; lists become tuples where these ask so."""
    model = create_model("Settings", __config__=STRICT, **fields)
    try:
        # strict JSON: arrays become tuples, and nothing else is converted
        settings = model.model_validate_json(json.dumps(table, default=str))
    except ValidationError as invalid:
        raise InputError(mistake(invalid)) from None
    return {name: getattr(settings, name) for name in settings.model_fields_set}


def _same(setting: Any, value: bool | str) -> bool:
    return type(setting) is type(value) and bool(setting == value)


def built(table: Mapping[str, Any], kinds: Mapping[str, Kind], where: str) -> Any:
    """What the kind that the key `kind` names makes of the other keys of a table."""
    if not isinstance(table.get("kind"), str):
        raise InputError(f"{where}: the key 'kind' is missing; {nearest('', kinds)}")
    kind = table["kind"]
    if kind not in kinds:
        raise InputError(f"{where}: kind = {kind!r} is unknown; {nearest(kind, kinds)}")
    return kinds[kind].build({k: v for k, v in table.items() if k != "kind"}, where)


def _published(file: str) -> Friction:
    """The friction of a model `file`."""
    return load_model(Path(file))


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
    "sindy": _kind(SINDy, Library),
    "sklearn": _kind(Regressor, estimator_named, without=["inputs"]),
    "sindy_dynamics": _kind(BlackBox, SparseDynamics),
    "mlp": _kind(CompressedNetwork, MLP, choices=_SOLVERS, without=_OF_SEQUENCES),
    "window_mlp": _kind(Network, WindowMLP, without=["inputs", *_OF_SEQUENCES]),
    "lstm": _kind(Network, LSTM, without=["inputs"]),
    "blackbox_mlp": _kind(*(BlackBox, Network, StateMLP), without=["inputs", *_OF_SEQUENCES]),
    "blackbox_lstm": _kind(BlackBox, Network, StateLSTM, without=["inputs"]),
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
    block.name: block
    for block in (
        FrictionBlock,
        InertiaBlock,
        DelayBlock,
        GainBlock,
        BiasBlock,
        OffsetBlock,
        ActuatorBlock,
        TargetDelayBlock,
        BacklashBlock,
        EnvelopeBlock,
    )
}
