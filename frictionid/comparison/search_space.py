"""What tuning searches: ranges and choices of settings, how many trials, by which sampler."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from frictionid.config import Strict

Sampler = Literal["tpe", "gp", "random"]


def _number(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"it should be a number, not {value!r}")
    return value


Number = Annotated[int | float, BeforeValidator(_number)]


class Space(Strict):
    """Values that a setting may take: a range from `low` to `high`, or some `choices`.

    A range of two whole numbers has whole numbers only, on request in steps; `log` spreads the
    values evenly over their logarithm.

    >>> Space(low=1e-4, high=1e-2, log=True).words
    '0.0001 to 0.01, log'
    """

    low: Number = 0
    high: Number = 0
    log: bool = False
    step: Number = 0
    choices: Annotated[list[Any], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Space:
        low, high, keys = self.low, self.high, self.model_fields_set
        if self.choices is not None:
            if keys != {"choices"}:
                raise ValueError("choices stand alone: no low, high, log, step beside them")
            texts = [text_of(choice) for choice in self.choices]
            if len(set(texts)) < len(texts):
                raise ValueError(f"choices must differ, they are {self.choices}")
            return self
        if not keys >= {"low", "high"}:
            raise ValueError("needs low and high, or choices")
        if not low < high:
            raise ValueError(f"low = {low} must be below high = {high}")
        if self.step < 0 or ("step" in keys and self.step == 0):
            raise ValueError(f"step = {self.step} must be positive")
        if self.log and (low <= 0 or self.step):
            raise ValueError("log needs a positive low, and no step")
        if self.whole and isinstance(self.step, float):
            raise ValueError(f"step = {self.step} of whole numbers must be a whole number")
        return self

    @property
    def whole(self) -> bool:
        """Whether the range has whole numbers only."""
        return isinstance(self.low, int) and isinstance(self.high, int)

    @property
    def ends(self) -> list[Any]:
        """Values to try whether a setting takes them: all choices, or both ends of the range."""
        return list(self.choices) if self.choices is not None else [self.low, self.high]

    @property
    def words(self) -> str:
        """The space as a table tells it."""
        if self.choices is not None:
            return " | ".join(map(text_of, self.choices))
        step = f", step {self.step:g}" if self.step else ""
        return f"{self.low:g} to {self.high:g}{step}{', log' if self.log else ''}"

    def holds(self, value: Any) -> bool:
        """Whether a value is one of the space."""
        if self.choices is not None:
            return text_of(value) in map(text_of, self.choices)
        if isinstance(value, bool) or not isinstance(value, int | float):
            return False
        if not self.low <= value <= self.high or (self.whole and isinstance(value, float)):
            return False
        return not self.step or (value - self.low) % self.step == 0


Search = Annotated[Mapping[str, Space], Field(min_length=1)]


class Objective(Strict):
    """Score that tuning lowers, on held-out parts of what it may see."""

    score: Literal["rollout_angle", "one_step_euler", "one_step_integral"] = "one_step_integral"
    statistic: Literal["mean", "rms", "median", "q90"] | None = None
    horizon: Annotated[float, Field(gt=0)] | None = None

    @model_validator(mode="after")
    def _of_a_score(self) -> Objective:
        rollout = self.score == "rollout_angle"
        if rollout and self.horizon is None:
            raise ValueError("rollout_angle needs a horizon [s], e.g. horizon = 0.5")
        if rollout and self.statistic in ("mean", "rms"):
            raise ValueError(f"rollout_angle has no {self.statistic}: choose median or q90")
        if not rollout and self.horizon is not None:
            raise ValueError(f"horizon belongs to rollout_angle, not to {self.score}")
        return self

    @property
    def key(self) -> tuple[str, str, float | None]:
        """Score, statistic and horizon [s] as results have them."""
        usual = {"rollout_angle": "median", "one_step_euler": "mean", "one_step_integral": "rms"}
        return self.score, self.statistic or usual[self.score], self.horizon

    @property
    def words(self) -> str:
        """The objective as a sentence names it."""
        score, statistic, horizon = self.key
        if horizon is not None:
            return (
                f"{'median' if statistic == 'median' else '90 %'} angle error after {horizon:g} s"
            )
        return f"{score.removeprefix('one_step_')} one-step loss, {statistic}"


class Tuning(Strict):
    """How settings are searched.

    trials : of each study; samplers : one study for each; folds : inner ones; nested : whether each
    outer fold is tuned for itself, without its held-out recordings, beside the tuning on all data
    """

    trials: Annotated[int, Field(ge=1)] = 30
    samplers: Annotated[list[Sampler], Field(min_length=1)] = ["tpe"]
    folds: Annotated[int, Field(ge=2)] = 3
    objective: Objective = Objective()
    seed: Annotated[int, Field(ge=0)] = 0
    nested: bool = True

    @model_validator(mode="after")
    def _each_once(self) -> Tuning:
        if len(set(self.samplers)) < len(self.samplers):
            raise ValueError(f"samplers must differ, they are {self.samplers}")
        return self


def text_of(value: Any) -> str:
    """A choice as text, the same for equal choices: TOML's own way for what is no table.

    >>> text_of([16, 16]), text_of("tanh"), text_of(True)
    ('[16, 16]', 'tanh', 'true')
    """
    return value if isinstance(value, str) else json.dumps(value)
