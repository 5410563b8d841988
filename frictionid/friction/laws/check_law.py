"""What every friction law keeps to, as a check that users run on their own laws."""

import pickle
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Inputs, Law

_SPEEDS = np.array([-9.0, -2.0, -0.4, -0.05, 0.05, 0.3, 1.5, 8.0])  # [rad/s]
_DRAWS = 3
_FEW = 16  # parameters, with derivatives by differences
_ROUNDING = 1e-12
_NARROW, _CREEP, _SLOW = 1e-9, 1e-6, 0.1  # [rad/s]


def check_law(law: Law, *, level: bool = True) -> None:
    """Raises AssertionError if a law violates the contract of `Law`, for trial parameters.

    So it does if the law would be treated otherwise than a built-in law of the same equations.

    Parameters
    ----------
    law : Law
    level : bool
        False for a static law whose `limit` is, on purpose, not its torque just above rest.

    Raises
    ------
    AssertionError
        With one sentence that names the violated rule.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> check_law(CoulombViscous())
    """
    _require(law, _description(law))
    _check_identity(law)
    for n in (1, 2):
        theta, x = _theta(law, n), _inputs(n)
        for rules in (_fixed_inputs, _batches, _load, _limit):
            _require(law, rules(law, theta, x))
        if not law.has_memory:
            _require(law, _gradient(law, theta, x))
            if level:
                _check_level(law, theta, x)
        elif law.reads_window:
            _require(law, _window(law, theta, x))


Rules = Iterator[tuple[Any, str]]  # whether each holds, and what it says


def _require(law: Law, rules: Rules) -> None:
    for holds, rule in rules:
        if not holds:
            raise AssertionError(f"{law}: {rule}")


def _description(law: Law) -> Rules:
    """Entries fit together; what steers how a law is treated is declared so that it has effect."""
    rule = "it must subclass frictionid.friction.Law, which declares how laws are treated"
    yield isinstance(law, Law), rule
    P = len(law.names)
    yield len(set(law.names)) == P, f"names must differ, they are {law.names}"
    for name in ("units", "bounds"):
        count = len(getattr(law, name))
        yield count == P, f"{name} needs {P} entries, one for each of names; it has {count}"
    for name, (low, high) in zip(law.names, law.bounds, strict=True):
        yield low < high, f"bounds of {name} must increase, they are ({low}, {high})"
    yield len(law.initial) > 0, "initial needs at least one start"
    for start in law.initial:
        yield len(start) == P, f"each start in initial needs {P} values; one is {start}"
        for name, value, (low, high) in zip(law.names, start, law.bounds, strict=True):
            inside = low <= value <= high and np.isfinite(value)
            yield inside, f"initial {name} = {value} must lie in its bounds {(low, high)}"
    yield isinstance(law.uses_load, bool), "uses_load must be True or False"
    sampled = law.sample_time
    yield sampled is None or sampled > 0, "sample_time must be None, or positive [s]"
    width, shape = law.width, law.shape
    narrowed = width == 0 or shape != "tanh" or "width" in {field.name for field in fields(law)}
    rule = 'must be a field, by which the physics step narrows it (or shape = "", if it must not)'
    yield narrowed, f"width {rule}"
    few = law.has_gradient or law.is_network or P <= _FEW
    rule = (
        f"{P} parameters need a gradient, or is_network = True: shooting then refines "
        "combinations of them that the motion shows, else each by itself"
    )
    yield few, rule
    yield law.has_gradient or not law.is_sparse, "is_sparse is True, so it needs a gradient"


def _check_identity(law: Law) -> None:
    try:
        copy = pickle.loads(pickle.dumps(law))
    except Exception as error:
        raise AssertionError(f"{law}: it must pickle ({error}): define it in a module") from None
    if repr(copy) != repr(law):
        raise AssertionError(f"{law}: repr must say its settings: results are known by it")


def _theta(law: Law, n: int) -> Array:
    """Parameters within the bounds, shape (3, 1, n, P)."""
    share = np.random.default_rng(0).uniform(0.1, 0.9, (_DRAWS, 1, n, len(law.names)))
    for i, (low, high) in enumerate(law.bounds):
        bottom = low if np.isfinite(low) else min(high, 0.0) - 1.0
        top = high if np.isfinite(high) else bottom + 1.0 + np.isinf(low)
        share[..., i] = bottom + (top - bottom) * share[..., i]
    return share


def _inputs(n: int) -> Inputs:
    """Inputs of shape (8, n), each joint at its own speeds."""
    w = np.stack([np.roll(_SPEEDS, j) for j in range(n)], axis=-1)
    q, u, load = np.random.default_rng(1).uniform(-1.0, 1.0, (3, *w.shape))
    return Inputs(q, w, u, 1.0 + load, 25.0 + 10.0 * q)


def _values(law: Law, theta: Array, x: Inputs) -> Iterator[tuple[str, Array]]:
    """Everything that a law computes, by name."""
    memory = law.start(theta, x)
    dt = np.full((1,), law.sample_time or 0.01)
    later = law.advance(theta, x, memory, dt)
    if not isinstance(memory, tuple):
        raise AssertionError(f"{law}: start must give a tuple, () for a static law")
    if len(later) != len(memory):
        raise AssertionError(f"{law}: advance must keep the number of entries of the memory")
    yield from ((f"entry {i} of start", value) for i, value in enumerate(memory))
    yield from ((f"entry {i} of advance", value) for i, value in enumerate(later))
    yield "torque", law.torque(theta, x, memory)
    yield "torque after advance", law.torque(theta, x, later)
    yield "limit", law.limit(theta, x, memory)
    yield "limit after advance", law.limit(theta, x, later)
    if not memory and law.has_gradient:
        yield "gradient", law.gradient(theta, x)


def _batches(law: Law, theta: Array, x: Inputs) -> Rules:
    """Batches (3, 1) of theta against (8,) of x are (3, 8), and each entry is what it is alone."""
    together = dict(_values(law, theta, x))
    V, n = x.w.shape
    for b, v in np.ndindex(_DRAWS, V):
        point = x.each(lambda field, v=v: field[v])
        for name, value in _values(law, theta[b, 0], point):
            last = (n, len(law.names)) if name == "gradient" else (n,)
            alone = _shaped(law, name, value, last)
            full = _shaped(law, f"{name} of batches", together[name], (_DRAWS, V, *last))
            yield np.isfinite(alone).all(), f"{name} must be finite, it is {value}"
            close = np.allclose(full[b, v], alone, rtol=1e-9, atol=_ROUNDING)
            yield close, f"{name} of a point must not depend on the others in its batch"
    shape, actual = (_DRAWS, V, n), np.shape(together["torque"])
    right = actual == shape or law.start(theta, x)
    yield right, f"torque must have the shape {shape}, not {actual}"


def _shaped(law: Law, name: str, value: Array, shape: tuple[int, ...]) -> Array:
    try:
        return np.broadcast_to(value, shape)
    except ValueError:
        actual = np.shape(value)
    raise AssertionError(f"{law}: {name} must have shape {shape}, or broadcast to it, not {actual}")


def _present(x: Inputs) -> list[Array]:
    return [a for a in x if a is not None]


def _fixed_inputs(law: Law, theta: Array, x: Inputs) -> Rules:
    before = [theta.copy(), *(np.copy(a) for a in _present(x))]
    first = dict(_values(law, theta, x))
    second = dict(_values(law, theta, x))
    same = all(np.array_equal(a, b) for a, b in zip(before, (theta, *_present(x)), strict=True))
    yield same, "its methods must not change theta or the inputs"
    again = all(np.array_equal(first[name], second[name]) for name in first)
    yield again, "the same numbers must give the same torque: a law holds none of its own"


def _load(law: Law, theta: Array, x: Inputs) -> Rules:
    other = dict(_values(law, theta, x._replace(load=2.0 * x.load + 1.0)))
    same = all(np.array_equal(value, other[name]) for name, value in _values(law, theta, x))
    yield same or law.uses_load, "uses_load is False, so nothing may depend on the load"


def _limit(law: Law, theta: Array, x: Inputs) -> Rules:
    # a torque of the position, as cogging, is more to one side and less to the other
    others = dict(_values(law, theta, x._replace(w=-x.w)))
    for name, value in _values(law, theta, x):
        if name.startswith("limit"):
            least = np.min(value + others[name]) / 2
            yield least >= 0, f"{name} must not be negative, it is {least}"
    memory = law.start(theta, x)
    for sign in (1.0, -1.0):
        slow, fast = (x._replace(w=sign * speed + 0.0 * x.w) for speed in (1.0, 2.0))
        same = np.array_equal(law.limit(theta, slow, memory), law.limit(theta, fast, memory))
        yield same, "limit must not depend on the speed, only on the sign of x.w"


def _window(law: Law, theta: Array, x: Inputs) -> Rules:
    memory = law.start(theta, x)
    later = (law.advance(t, x, memory, np.full((1,), 0.01)) for t in (theta, theta[::-1]))
    same = all(np.array_equal(a, b) for a, b in zip(*later, strict=True))
    yield same, "reads_window is True, so its memory must not depend on theta"


def _gradient(law: Law, theta: Array, x: Inputs) -> Rules:
    """Where there is a gradient, it is the slope of the torque in each parameter."""
    if not law.has_gradient:
        return
    gradient = np.broadcast_to(
        law.gradient(theta, x), (*theta.shape[:1], *x.w.shape, len(law.names))
    )
    for i, name in enumerate(law.names):
        step = np.zeros_like(theta)
        step[..., i] = 1e-6 * np.maximum(1e-2, np.abs(theta[..., i]))
        rise = law.torque(theta + step, x, ()) - law.torque(theta - step, x, ())
        slope = rise / (2 * step[..., i])
        error = np.abs(gradient[..., i] - slope).max()
        close = error <= 1e-5 * max(np.abs(slope).max(), 1.0)
        yield close, f"gradient by {name} is {error:.2g} off the slope of its torque"
    if law.is_sparse:
        sums = (gradient * theta).sum(-1)
        close = np.allclose(sums, law.torque(theta, x, ()), rtol=1e-9, atol=_ROUNDING)
        yield close, "is_sparse is True, so the torque must be gradient times theta"


def _check_level(law: Law, theta: Array, x: Inputs) -> None:
    """The limit is the size of the torque just above rest, in each direction."""
    if law.shape and law.width:
        narrow, speed, tolerance = law.with_width(_NARROW), _CREEP, 0.01
    else:
        narrow, speed, tolerance = law, _SLOW, 0.25
        _require(law, _smoothing(law, theta, x))

    def torque(w: float) -> Array:
        return narrow.torque(theta, x._replace(w=w + 0.0 * x.w), ())

    for sign, side in ((1.0, "positive"), (-1.0, "negative")):
        # extrapolated to rest, without the rise of the smoothing and the slope of viscous friction
        near = sign * (2 * torque(sign * speed) - torque(2 * sign * speed))
        limit = law.limit(theta, x._replace(w=sign + 0.0 * x.w), ()) + 0.0 * near
        close = np.abs(near - limit) <= tolerance * np.abs(limit) + 1e-3 * np.abs(near).max()
        if not close.all():
            first = f"{limit[~close][0]:.3g}, the torque {near[~close][0]:.3g} N m"
            rule = f"limit must be the torque just above rest, for {side} velocity it is {first}"
            raise AssertionError(f"{law}: {rule}")


def _smoothing(law: Law, theta: Array, x: Inputs) -> Rules:
    """A law without a width has its break-away level at any speed but zero."""
    creep = np.abs(law.torque(theta, x._replace(w=_CREEP + 0.0 * x.w), ()))
    limit = law.limit(theta, x._replace(w=1.0 + 0.0 * x.w), ())
    rule = (
        "its torque is smoothed at rest, but declares no width [rad/s]: the physics step takes "
        "the smoothing for a part of friction"
    )
    yield law.width or (creep >= 0.9 * limit).all(), rule
