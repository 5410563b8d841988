"""Fitted models of several specimens, pooled parameter by parameter to one friction."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.fit import estimates_of
from frictionid.friction import Friction, Groups
from frictionid.friction.provenance import Estimate, Pooled, PooledEstimate, Provenance

from .random_effects import random_effects

Key = tuple[str, str, int | None]  # block, name without the joint's, and joint


class Row(NamedTuple):
    """An estimate of a model, by its name; reason : why it is none, "" where it is one."""

    model: str
    estimate: Estimate
    reason: str


def pooled(models: Sequence[Friction], names: Sequence[str], equal: Groups = ()) -> Friction:
    """One friction for all specimens: means of the parameters; the spread in its provenance.

    `provenance.pooled` has for each parameter the mean with its interval, the 95 % range of
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
    groups, first = estimates(models, names), models[0]
    theta = np.median([model.theta for model in models], axis=0)
    entries, sentences = [], []
    for key, rows in groups.items():
        alike, place = _alike(groups, key, equal), place_of(first, *key)
        usable = [row for row in alike if not row.reason]
        stays = "" if place is None else f", it stays at the median, {theta[place]:.3g}"
        if alike[0].estimate is rows[0].estimate:  # said once of equal joints
            sentences += _sentences(alike, len(usable), stays)
        if len(usable) > 1:
            entries.append(entry(first, usable, rows[0].estimate.name, key[2]))
            if place is not None:
                theta[place] = entries[-1].value
    if not entries:
        raise InputError(f"pool: no parameter has two estimates; {'; '.join(sentences)}")
    hashes = {
        f"{name}: {file}": digest
        for model, name in zip(models, names, strict=True)
        for file, digest in model.provenance.data.items()
    }
    source = Provenance(
        dataset=f"{len(names)} specimens",
        data=hashes,
        pooled=Pooled(tuple(names), tuple(entries), tuple(sentences)),
        joints=first.joints,
    )
    speeds = [model.provenance.speeds for model in models]
    if all(len(each) == first.n for each in speeds):
        source = source.but({"speeds": tuple(np.min(speeds, axis=0).tolist())})
    common = set.intersection(*(set(model.parameters.items()) for model in models))
    parameters = {k: v for k, v in first.parameters.items() if (k, v) in common}
    return Friction(
        first.law,
        theta,
        parameters,
        source,
        first.position_units,
        load_unit=first.load_unit,
    )


def _alike(groups: Mapping[Key, Sequence[Row]], key: Key, equal: Groups) -> Sequence[Row]:
    """Estimates of a parameter; of all joints equal to its own, with these in the models' names."""
    *name, joint = key
    group = next((g for g in equal if joint is not None and joint + 1 in g), ())
    if not group:
        return groups[key]
    order = {row.model: k for k, row in enumerate(groups[key])}
    rows = [row for (*n, j), each in groups.items() for row in each if n == name and j is not None]
    rows = [row for row in rows if (row.estimate.joint or 0) + 1 in group]
    rows.sort(key=lambda row: order.get(row.model, len(order)))
    joints = [row.estimate.name.partition(" of ")[2] for row in rows]
    return [
        row._replace(model=f"{row.model} ({joint})")
        for row, joint in zip(rows, joints, strict=True)
    ]


def place_of(
    friction: Friction, block: str, name: str, joint: int | None
) -> tuple[int, int] | None:
    """Place in theta (n, P) of a parameter of the law; None of others."""
    if block != "friction" or joint is None:
        return None
    if name not in friction.law.names:
        raise InputError(
            f"{type(friction.law).__name__} has parameters of its own for each joint ({name}): "
            "fit one law for all joints"
        )
    return joint, friction.law.names.index(name)


def entry(first: Friction, usable: Sequence[Row], title: str, joint: int | None) -> PooledEstimate:
    """A pooled parameter of its estimates.

    Intervals and the range are cut to the bounds of the law.
    """
    listed = [row.estimate for row in usable]
    e, values, errors = listed[0], [e.value for e in listed], [e.error for e in listed]
    effects = random_effects(np.array(values), np.array(errors))
    ends = bounds_of(first, e)
    inner, outer, beyond = (
        tuple(np.clip(pair, *ends).tolist())
        for pair in (effects.interval(0.9), effects.interval(), effects.range())
    )
    return PooledEstimate(
        e.block,
        title,
        e.unit,
        joint,
        effects.mean,
        effects.error,
        inner,
        outer,
        range_95=beyond,
        tau=effects.tau,
        tau_95=(effects.tau_low, effects.tau_high),
        Q=effects.Q,
        p_value=effects.p_value,
        models=tuple(row.model for row in usable),
        values=tuple(values),
        errors=tuple(errors),
    )


def bounds_of(friction: Friction, e: Estimate) -> tuple[float, float]:
    """Bounds of a parameter of the law; none of others."""
    place = place_of(friction, e.block, e.parameter, e.joint)
    return (-np.inf, np.inf) if place is None else friction.law.bounds[place[1]]


def with_parameters(friction: Friction, entries: Sequence[Estimate], draws: Array) -> Array:
    """Parameters (N, n, P) of the law for values (N, D) of some of them, within its bounds."""
    theta = np.repeat(np.asarray(friction.theta, dtype=float)[None], len(draws), axis=0)
    for e, values in zip(entries, draws.T, strict=True):
        if (place := place_of(friction, e.block, e.parameter, e.joint)) is not None:
            theta[:, *place] = values
    return np.clip(theta, *np.array(friction.law.bounds).T)


def estimates(models: Sequence[Friction], names: Sequence[str]) -> dict[Key, list[Row]]:
    """Estimates of fitted models by parameters, one or none of each model.

    Raises
    ------
    InputError
        Where a model has no intervals, or is pooled.
    """
    out: dict[Key, list[Row]] = {}
    for model, name in zip(models, names, strict=True):
        source = model.provenance
        if source.pooled is not None:
            raise InputError(f"pool: {name} is pooled itself: give the models that it was made of")
        if source.refined is None and source.half_widths is None:
            raise InputError(
                f"pool: {name} has no intervals of its parameters: fit it by frictionid fit"
            )
        for e in estimates_of(model):
            row = Row(name, e, _reason(model, e))
            out.setdefault((e.block, e.parameter, e.joint), []).append(row)
    return out


def _reason(model: Friction, e: Estimate) -> str:
    """Why a value is no estimate, "" where it is one."""
    if e.at_bound or (model.provenance.refined is None and e.value in bounds_of(model, e)):
        return "lies at its bound"
    is_known = e.identified and np.isfinite(e.value) and 0.0 < e.error < np.inf
    return "" if is_known else "is not identified"


def _sentences(rows: Sequence[Row], count: int, stays: str) -> list[str]:
    """What is left out of a parameter's estimates."""
    out, title = [], rows[0].estimate.name
    end = f"pooled over the other {count}" if count > 1 else f"not pooled{stays}"
    for reason in dict.fromkeys(row.reason for row in rows if row.reason):
        where = ", ".join(row.model for row in rows if row.reason == reason)
        out.append(f"{title} {reason} in {where}: {end}")
    if count == len(rows) == 1:
        out.append(f"{title} is free in {rows[0].model} only: not pooled{stays}")
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
    for k, model in enumerate(models):
        for i, other in enumerate(models[:k]):
            if np.array_equal(model.theta, other.theta):
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
