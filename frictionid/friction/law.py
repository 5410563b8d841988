"""Law: what a friction law declares and computes, with the defaults of a static law.

With the smooth stand-ins for sgn(w), of a width in rad/s, and the checks of temperatures in degC.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cached_property
from itertools import product
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from frictionid.arrays import Array, namespace
from frictionid.config import check_settings
from frictionid.errors import InputError, located

Memory = tuple[Array, ...]

NUMERICAL_WIDTH = 0.02  # [rad/s]: narrower smoothing of sgn(w) is no part of friction
SHARP_WIDTH = 1e-7  # [rad/s], smoothing of a law that is made sharp
SHAPES = ("tanh", "arctan")  # of smooth signs
_COLDEST, _HOTTEST = -100.0, 200.0  # [degC] of a machine; in kelvin a cold one is above
_LEAST = 1.0  # [K]: who changes less shows no dependence


class LawParameter(NamedTuple):
    """A parameter of a law: its name, its unit on a joint that turns, and its bounds.

    neutral, size : what it is where the data do not tell it, and how far from that it usually is,
        in multiples of what the data make usual for its unit, see `friction.constraints`; a size
        of infinity where it has no neutral value
    like : another parameter whose value is the neutral one, such as that of the other direction
    initial : values to start fits from; (): zero, or the bound nearest to it
    beside : another parameter that makes up for it: without that one it is not identified
    optional : whether zero is a term that friction does not have, and that stays out
    stepwise : whether friction at samples changes by steps in it: a derivative does not show where
        the next step is, so that fits try other values of it
    """

    name: str
    unit: str
    low: float = 0.0
    high: float = float("inf")
    initial: tuple[float, ...] = ()
    stepwise: bool = False
    neutral: float = 0.0
    size: float = float("inf")
    like: str = ""
    beside: str = ""
    optional: bool = False


class Inputs(NamedTuple):
    """What friction may depend on: q [rad], w [rad/s], motor torque u [N m], bearing load [N].

    Each has shape (..., n), one entry for each joint; so has `temperature` [degC], None where it is
    not known.
    """

    q: Array
    w: Array
    u: Array
    load: Array
    temperature: Array | None = None

    def each(self, change: Callable[..., Array], *others: Inputs) -> Inputs:
        """The inputs with every array changed, by those of others as further arguments.

        >>> at_rest(np.ones(2)).each(lambda x: x[:1]).w
        array([1.])
        """
        rows = zip(self, *others, strict=True)
        return Inputs._make(None if any(x is None for x in row) else change(*row) for row in rows)


def joined(parts: Sequence[Inputs]) -> Inputs:
    """Inputs (S, n) of several recordings, one after the other."""
    return parts[0].each(lambda *arrays: np.concatenate(arrays), *parts[1:])


def at_rest(w: Array) -> Inputs:
    """Inputs with velocities w (..., n) and all else zero.

    >>> at_rest(np.ones(2)).u
    array([0., 0.])
    """
    zero = 0.0 * w
    return Inputs(zero, w, zero, zero)


class Law(ABC):
    """The form of a friction torque Tf; its numbers are the parameters theta (..., n, P).

    A law is a frozen dataclass: its fields are its settings. It declares its P `parameters`, or as
    columns their `names`, `units` and `bounds`, its torque and its break-away level. All else has a
    default, that of a static law whose derivatives are found by differences. The batch axes of
    theta and of the inputs broadcast against each other; laws compute alike with NumPy and, for
    networks, with torch.

    Parameters mean the same in all laws. `coulomb` is the level of sliding friction at all speeds.
    `peak` is what break-away takes beyond the Coulomb level. `stribeck_velocity` is the speed at
    which 1/e of the peak is left. `viscous` is what friction grows by with each rad/s. `drag` is
    what it grows by with the square of the speed. `presliding` is the angle by which a joint gives
    before it slips. `lag` is the time by which friction follows the speed. `damping` is that of
    bristles at rest. `damping_velocity` is the speed at which 1/e of it is left.

    Attributes
    ----------
    width : float
        Smoothing of sgn(w) [rad/s], a field of laws that smooth it; 0: they do not. Up to 0.02 it
        counts as numerical, the physics step goes round it; a wider one is a part of friction.
    shape : str
        How sgn(w) is smoothed: "tanh", "arctan", or "" in another way. The physics step narrows a
        tanh by setting `width`.
    sample_time : float or None
        Time [s] of the samples at which the memory advances; None: it does so continuously.
    longest_substep : float
        Time [s] within which the physics step must look at the memory again.
    uses_load : bool
        Whether friction depends on the bearing load, which costs time to compute.
    uses_temperature : bool
        Whether friction depends on the temperature; `at_temperature` gives that at one.
    is_sparse : bool
        Whether all parameters are optional, the torque is `gradient` times theta, and friction has
        an `equation` of the parameters that it has.
    is_network : bool
        Whether the parameters are weights: not printed, stored in binary, and refined by shooting
        in those combinations that the motion shows.
    reads_window : bool
        Whether the memory holds samples of the motion, whatever theta is.
    kind : str
        Name in suites, commands and model files: that of the class in snake case; "": it has none.
    left_out_of_files : tuple of str
        Settings that model files leave out; the class has defaults for them.
    cannot_be_saved : str
        Reason why a model file cannot hold the law; "": it can.

    Examples
    --------
    >>> from dataclasses import dataclass, replace
    >>> @dataclass(frozen=True)
    ... class Viscous(Law):
    ...     names = ("viscous",)
    ...     units = ("N m s/rad",)
    ...     bounds = ((0.0, np.inf),)
    ...     def torque(self, theta, x, memory):
    ...         return theta[..., 0] * x.w
    ...     def limit(self, theta, x, memory):
    ...         return 0.0 * (theta[..., 0] + x.w)
    >>> Viscous().initial, Viscous().has_memory
    (((0.0,),), False)
    """

    width: float = 0.0
    shape: str = "tanh"
    sample_time: float | None = None
    longest_substep: float = float("inf")
    uses_load: bool = False
    uses_temperature: bool = False
    is_sparse: bool = False
    is_network: bool = False
    reads_window: bool = False
    kind: ClassVar[str] = ""
    left_out_of_files: tuple[str, ...] = ()
    cannot_be_saved: str = ""
    __dataclass_fields__: ClassVar[dict[str, Any]]  # every law is a dataclass

    def __init_subclass__(cls) -> None:
        """Give a law its name in files, unless it says one itself."""
        if "kind" not in vars(cls):
            words = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", cls.__name__)
            cls.kind = words.lower()

    @cached_property
    def parameters(self) -> tuple[LawParameter, ...]:
        """The P parameters of one joint."""
        if type(self).names is Law.names:
            raise NotImplementedError(f"{type(self).__name__} must declare its parameters")
        rows = zip(self.names, self.units, self.bounds, strict=True)
        return tuple(LawParameter(name, unit, *bounds) for name, unit, bounds in rows)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the P parameters of one joint."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Their units, for joints that turn."""
        return tuple(parameter.unit for parameter in self.parameters)

    @cached_property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """Lower and upper bound of each."""
        return tuple((parameter.low, parameter.high) for parameter in self.parameters)

    def neutral(self, theta: Array, usual: Array) -> Array:
        """Neutral values (..., n, P): the usual ones, or those of the parameters they are like.

        >>> from frictionid.friction.laws import CoulombViscous
        >>> law = CoulombViscous(symmetric=False)
        >>> law.neutral(np.array([[0.1, 0.3, 0.01]]), np.zeros((1, 3)))
        array([[0.3, 0.1, 0. ]])
        """
        out = np.array(np.broadcast_to(usual, theta.shape), dtype=float)
        for i, parameter in enumerate(self.parameters):
            if parameter.like in self.names:
                out[..., i] = theta[..., self.names.index(parameter.like)]
        return out

    @cached_property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        """Values to start a fit from, P for each combination of the parameters' starts."""
        columns = (p.initial or (min(max(0.0, p.low), p.high),) for p in reversed(self.parameters))
        return tuple(start[::-1] for start in product(*columns))

    def __post_init__(self) -> None:
        """Validates the settings by their annotated types, and the smoothing."""
        with located(type(self).__name__):
            check_settings(self)
        if "width" in (setting.name for setting in fields(self)):
            check_smoothing(type(self).__name__, self.width, self.shape or "tanh")

    @property
    def has_memory(self) -> bool:
        """Whether friction depends on the motion before: whether `start` gives anything."""
        return bool(self.start(np.array(self.initial[:1]), at_rest(np.zeros((1, 1)))))

    @property
    def has_gradient(self) -> bool:
        """Whether the law knows its derivatives: by `gradient`, or `slopes` if it has memory."""
        form = type(self)
        return form.gradient is not Law.gradient or form.slopes is not Law.slopes

    @abstractmethod
    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        """Friction torque Tf, shape (..., n) [N m], opposing positive velocity."""

    def sign(self, w: Array) -> Array:
        """sgn(w) smoothed over the law's `width`."""
        return smooth_sign(w, self.width, self.shape)

    @abstractmethod
    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        """Break-away level (..., n) [N m]: smaller loads cannot move the joint from rest.

        Of x.w only the sign counts, the direction of the impending motion; memory is that at this
        moment. Zero where the memory itself holds the joint, as a bristle does, or nothing does.
        """

    def start(self, theta: Array, x: Inputs) -> Memory:
        """Initial memory state, entries (..., n); () for static laws."""
        return ()

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        """Memory after dt [s], shape (..., 1), at inputs x."""
        relaxing = self.relaxation(theta, x, dt)
        if relaxing is None:
            return memory
        target, keep = relaxing
        return (target + (memory[0] - target) * keep,)

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array] | None:
        """Where a memory of one entry relaxes to, and the share of the way that is left after dt.

        For laws that have it, `advance` follows, and long recordings take a fraction of the time;
        None for others.
        """
        return None

    def while_held(self, theta: Array, memory: Memory) -> tuple[Law, Array] | None:
        """A faster law without memory, and its theta, as this one is with that memory; or None."""
        return None

    def gradient(self, theta: Array, x: Inputs) -> Any:
        """Derivatives (..., n, P) of a static law's torque in each joint's theta, or None."""
        return None

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory] | None:
        """Derivatives of the torque in theta (..., n, P) and in each memory entry, or None."""
        return None

    def memory_slopes(self, theta: Array, x: Inputs, memory: Memory) -> Memory | None:
        """Derivatives (..., n) of the torque in each memory entry alone, or None."""
        return None

    def at_temperature(self, theta: Array, temperature: Array) -> tuple[Law, Array]:
        """The law and its theta at a temperature (..., n) [degC]; as they are by default."""
        return self, theta

    def has_parameters(self, joints: int) -> NDArray[np.bool_]:
        """Which of the P parameters each joint has, (joints, P): all, unless joints differ."""
        return np.ones((joints, len(self.names)), dtype=bool)

    def with_width(self, width: float) -> Law:
        """The law smoothed over a width [rad/s]."""
        if width == self.width:
            return self
        law = object.__new__(type(self))  # without validation, which takes as long as the torque
        vars(law).update({field.name: getattr(self, field.name) for field in fields(self)})
        vars(law)["width"] = width
        return law

    def sharpened(self) -> Law:
        """The law without smoothing, where that only stands for a step of friction at w = 0."""
        numerical = self.shape == "tanh" and 0.0 < self.width <= NUMERICAL_WIDTH
        return self._sharp if numerical else self

    def finer(self) -> Law:
        """The law with half of a smoothing that biases its parameters in proportion; or itself."""
        return self

    @cached_property
    def _sharp(self) -> Law:
        return self.with_width(SHARP_WIDTH)

    def equation(
        self, theta: Array, half: Array | None = None, position_units: Sequence[str] = ()
    ) -> list[str]:
        """One line for each joint of a sparse law: its terms with coefficients theta (n, P).

        `half` (n, P) is half the width of an interval of each coefficient, written behind it where
        it is finite; without `position_units` of the joints all are "rad".
        """
        return []


def smooth_sign(w: Array, width: float, shape: str = "tanh") -> Array:
    """sgn(w) smoothed over `width`: tanh(w/width), or (2/pi) arctan(w/width).

    Published models often write cf arctan(100 w): their Coulomb level is cf pi/2, not cf.

    >>> smooth_sign(np.array([-1.0, 0.0, 1.0]), 0.01)
    array([-1.,  0.,  1.])
    """
    xp = namespace(w)
    if shape == "tanh":
        return xp.tanh(w / width)
    if shape == "arctan":
        return xp.atan(w / width) * (2.0 / math.pi)
    raise ValueError(f"the shape of a smooth sign must be 'tanh' or 'arctan', got {shape!r}")


def check_smoothing(law: str, width: float, shape: str) -> None:
    """Raise InputError, naming the law, for settings of a smooth sign that mean nothing.

    >>> check_smoothing("Stribeck", 0.0, "tanh")
    Traceback (most recent call last):
    frictionid.errors.InputError: Stribeck: width = 0.0 rad/s must be positive and finite
    """
    if not 0 < width < math.inf:
        raise InputError(f"{law}: width = {width} rad/s must be positive and finite")
    if shape not in SHAPES:
        raise InputError(f"{law}: shape = {shape!r} is unknown; known are {', '.join(SHAPES)}")


def check_temperature(law: Law, temperature: Array | float | None, *, fitted: bool = False) -> None:
    """Refuse recorded motion without a temperature in degC, for a law that depends on it.

    fitted : whether the law is fitted to it, so that it must change
    """
    if not law.uses_temperature:
        return
    name = type(law).__name__.lower()
    if temperature is None:
        raise InputError(
            f"{name}: friction depends on the temperature, and not all recordings have one: name "
            'its column, e.g. columns.covariates = {temperature = "T"}, in degC'
        )
    T = np.asarray(temperature, dtype=float)
    if not np.isfinite(T).all():
        raise InputError(f"{name}: a temperature is {T[~np.isfinite(T)][0]}: give it in degC")
    low, high = float(T.min()), float(T.max())
    if low < _COLDEST or high > _HOTTEST:
        raise InputError(
            f"{name}: temperatures from {low:g} to {high:g} cannot be in degC: convert the column, "
            "from kelvin less 273.15"
        )
    if fitted and high - low < _LEAST:
        raise InputError(
            f"{name}: the temperature changes by {high - low:.2g} K only, which shows nothing of "
            "what it does: record a warm-up, or fit the law without temperature"
        )


def refuse_temperature(law: Law, what: str) -> None:
    """Raise InputError for a law that depends on the temperature, where one must be chosen."""
    if law.uses_temperature:
        raise InputError(
            f"{what} knows no temperature, on which this friction depends: take it at one, by "
            "--temperature 30 of frictionid export, or fit.friction.at_temperature(30) in Python"
        )
