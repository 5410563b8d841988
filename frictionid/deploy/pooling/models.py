"""Fitted models of several specimens, pooled parameter by parameter to one friction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.deploy.pooling.random_effects import random_effects
from frictionid.errors import InputError
from frictionid.evaluation import known_speeds
from frictionid.friction import Friction, Groups

Key = tuple[str, str, int | None]
_NORMAL = 1.96  # half-widths of 95 % over standard errors


class Estimate(NamedTuple):
    """A parameter as one model has it.

    key : block, name without the joint's, and joint, None for the machine as a whole
    name : with the joint's; reason : why it is no estimate, "" where it is one
    """

    key: Key
    name: str
    unit: str
    value: float
    error: float
    reason: str

    @property
    def joint_name(self) -> str:
        """Name of the joint, "" of the machine as a whole."""
        return "" if self.key[2] is None else self.name.rpartition(" of ")[2]


def pooled(models: Sequence[Friction], names: Sequence[str], equal: Groups = ()) -> Friction:
    """One friction for all specimens: means of the parameters; the spread in its provenance.

    `provenance["pooled"]` has for each parameter the mean with its interval, the 95 % range of
    another specimen, tau, Q and its p-value, and the estimates (`entry`), and as `left_out` the
    sentences on what is no estimate. Parameters with fewer than two estimates stay at the median of
    the models.

    Parameters
    ----------
    models : list of Friction, theta (n, P)
        Of the same law, one of each specimen.
    names : list of str
        Of the models, for sentences.
    equal : groups of joints, from 1, each of which is a specimen of the same kind

    Raises
    ------
    InputError
        Where the models are not alike, have no intervals, or one is given twice.
    """
    check_alike(models, names, equal)
    given = [estimates(model, name) for model, name in zip(models, names, strict=True)]
    first = models[0]
    theta = np.median([model.theta for model in models], axis=0)
    entries, sentences = [], []
    for key in dict.fromkeys(e.key for own in given for e in own):
        rows = _rows(given, names, key, equal)
        known = [(n, e) for n, e in rows if not e.reason]
        block, name, joint = key
        mine = block == "friction" and joint is not None and name in first.law.names
        place = (joint, first.law.names.index(name)) if mine else None
        stays = "" if place is None else f", it stays at the median, {theta[place]:.3g}"
        if rows[0][1].key == key:  # said once of equal joints
            sentences += _sentences(rows, len(known), stays)
        if len(known) > 1:
            title = next(e.name for own in given for e in own if e.key == key)
            entries.append(entry(first, known, title, joint))
            if place is not None:
                theta[place] = entries[-1]["value"]
    if not entries:
        raise InputError(f"pool: no parameter has two estimates; {'; '.join(sentences)}")
    document = {"models": list(names), "parameters": entries, "left_out": sentences}
    return Friction(
        *(first.law, theta, _common_parameters(models), _source(models, names, document)),
        first.position_units,
        load_unit=first.load_unit,
    )


def _rows(
    given: Sequence[Sequence[Estimate]], names: Sequence[str], key: Key, equal: Groups
) -> list[tuple[str, Estimate]]:
    """Estimates of a parameter with the names of their models; of all joints equal to its own."""
    block, name, joint = key
    group = next((g for g in equal if joint is not None and joint + 1 in g), ())
    if not group:
        return [(n, e) for n, own in zip(names, given, strict=True) for e in own if e.key == key]
    return [
        (f"{n} ({e.joint_name})", e)
        for n, own in zip(names, given, strict=True)
        for e in own
        if e.key[:2] == (block, name) and e.key[2] is not None and e.key[2] + 1 in group
    ]


def entry(
    first: Friction, known: Sequence[tuple[str, Estimate]], title: str, joint: int | None
) -> dict[str, Any]:
    """A pooled parameter of its estimates (model's name, estimate), as a document.

    Intervals and the range are cut to the bounds of the law.
    """
    block, name, _ = known[0][1].key
    values, errors = ([getattr(e, part) for _, e in known] for part in ("value", "error"))
    found = random_effects(np.array(values), np.array(errors))
    low, high = bounds_of(first, block, name)
    return {
        "block": block,
        "name": title,
        "joint": joint,
        "unit": known[0][1].unit,
        "value": found.mean,
        "error": found.error,
        "interval_90": np.clip(found.interval(0.9), low, high).tolist(),
        "interval_95": np.clip(found.interval(0.95), low, high).tolist(),
        "range_95": np.clip(found.range(0.95), low, high).tolist(),
        "tau": found.tau,
        "tau_95": [found.tau_low, found.tau_high],
        "Q": found.Q,
        "p_value": found.p_value,
        "identified": True,
        "at_bound": False,
        "models": [n for n, _ in known],
        "values": values,
        "errors": errors,
    }


def bounds_of(friction: Friction, block: str, name: str) -> tuple[float, float]:
    """Bounds of a parameter of the law; none of others."""
    if block == "friction" and name in friction.law.names:
        low, high = friction.law.bounds[friction.law.names.index(name)]
        return float(low), float(high)
    return -np.inf, np.inf


def estimates(model: Friction, name: str) -> list[Estimate]:
    """Estimates of a fitted model: those of shooting, else of its one-step fit.

    Raises
    ------
    InputError
        Where the model has no intervals, or is pooled.
    """
    source = model.provenance
    if "pooled" in source:
        raise InputError(f"pool: {name} is pooled itself: give the models that it was made of")
    try:
        if source.get("refined"):
            return [_shot(e) for e in source["refined"]["parameters"]]
        if source.get("half_widths"):
            half = np.array(source["half_widths"], dtype=float)  # None becomes NaN
            own = np.argwhere(model.law.has_parameters(model.n)).tolist()
            return [_one_step(model, j, i, float(half[j, i])) for j, i in own]
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"pool: {name}: its intervals cannot be read ({type(error).__name__} {error}): fit "
            "it again"
        ) from None
    raise InputError(f"pool: {name} has no intervals of its parameters: fit it by frictionid fit")


def _shot(e: Any) -> Estimate:
    name, joint = str(e["name"]), e["joint"]
    plain = name if joint is None else name.rpartition(" of ")[0] or name
    value, error = float(e["value"]), float(e["error"])
    reason = _reason(value, error, at_bound=e["at_bound"], identified=e["identified"])
    key = (str(e["block"]), plain, joint if joint is None else int(joint))
    return Estimate(key, name, str(e["unit"]), value, error, reason)


def _one_step(model: Friction, j: int, i: int, half: float) -> Estimate:
    name, value = model.law.names[i], float(model.theta[j, i])
    bound, error = value in model.law.bounds[i], half / _NORMAL
    reason = _reason(value, error, at_bound=bound, identified=half <= abs(value))
    key, unit = ("friction", name, j), model.units_at(j)[i]
    return Estimate(key, f"{name} of joint {j + 1}", unit, value, error, reason)


def _reason(value: float, error: float, *, at_bound: bool, identified: bool) -> str:
    """Why a value is no estimate, "" where it is one."""
    if at_bound:
        return "lies at its bound"
    known = identified and np.isfinite(value) and 0.0 < error < np.inf
    return "" if known else "is not identified"


def _sentences(rows: Sequence[tuple[str, Estimate]], known: int, stays: str) -> list[str]:
    """What is left out of a parameter's estimates (model's name, estimate)."""
    out = []
    end = f"pooled over the other {known}" if known > 1 else f"not pooled{stays}"
    for reason in dict.fromkeys(e.reason for _, e in rows if e.reason):
        where = ", ".join(n for n, e in rows if e.reason == reason)
        out.append(f"{rows[0][1].name} {reason} in {where}: {end}")
    if known == len(rows) == 1:
        out.append(f"{rows[0][1].name} is free in {rows[0][0]} only: not pooled{stays}")
    return out


# --- Models that are alike ------------------------------------------------------------------------


def check_alike(models: Sequence[Friction], names: Sequence[str], equal: Groups = ()) -> None:
    """Check that models are fits of one law to equal machines.

    Raises
    ------
    InputError
        With the first that is not, or is given twice.
    """
    if len(models) < (1 if equal else 2):
        raise InputError(
            f"pool: needs two models or more, of as many specimens, not {len(models)}; of one, "
            "name its equal joints"
        )
    first = models[0]
    if first.law.is_network or first.law.is_sparse or first.mechanism or not first.law.names:
        raise InputError(
            f"pool: {first.law} has no parameters that mean the same in every fit: pool models of "
            "a law such as stribeck"
        )
    for model, name in zip(models, names, strict=True):
        if model.theta.ndim != 2:
            raise InputError(f"pool: {name} holds several frictions: give one of each specimen")
        if model.law != first.law:
            raise InputError(
                f"pool: {name} has the law {model.law}, {names[0]} has {first.law}: fit the same"
            )
        kinds = (model.n, model.position_units, model.load_unit)
        if kinds != (first.n, first.position_units, first.load_unit):
            raise InputError(f"pool: {name} and {names[0]} have other joints: pool equal machines")
    for k, one in enumerate(models):
        for i, other in enumerate(models[:k]):
            if np.array_equal(one.theta, other.theta):
                raise InputError(f"pool: {names[i]} and {names[k]} are the same fit: give it once")
    for group in equal:
        if not all(1 <= j <= first.n for j in group):
            raise InputError(f"pool: equal = {list(group)} must be joints from 1 to {first.n}")
        for model, name in zip(models, names, strict=True):
            if len(np.unique(model.theta[np.array(group) - 1], axis=0)) < len(group):
                raise InputError(
                    f"pool: joints {', '.join(map(str, group))} of {name} were fitted as one: "
                    "give the fit in which each has parameters of its own"
                )


def joint_names(friction: Friction, name: str) -> list[str]:
    """Names of the joints, as the parameters of a fitted model have them."""
    known = {e.key[2]: e.joint_name for e in estimates(friction, name)}
    return [known.get(j) or f"joint {j + 1}" for j in range(friction.n)]


def _common_parameters(models: Sequence[Friction]) -> dict[str, float]:
    """Parameters of the mechanism that all models bring alike."""
    return {
        k: v
        for k, v in models[0].parameters.items()
        if all(model.parameters.get(k) == v for model in models)
    }


def _source(
    models: Sequence[Friction], names: Sequence[str], document: dict[str, Any]
) -> dict[str, Any]:
    """Where the pooled friction is from: its models, their recordings, the speeds of all."""
    hashes = {
        f"{name}: {file}": digest
        for model, name in zip(models, names, strict=True)
        for file, digest in (model.provenance.get("data") or {}).items()
    }
    known = [known_speeds(model) for model in models]
    alike = all(len(own) == models[0].n for own in known)
    speeds = {"speeds": np.min(known, axis=0).tolist()} if alike else {}
    return {"dataset": f"{len(names)} specimens", "data": hashes, **speeds, "pooled": document}
