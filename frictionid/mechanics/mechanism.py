"""What every mechanism is: its facts, its equations of motion, its [mechanism] table.

    M(q) dw/dt = h(q, w) + B u - Tf

The parameters of the equations are the *base* parameters, the combinations of masses, lengths and
inertias in which the Lagrangian is linear: motion identifies nothing else [Gautier1990]. Closed
symbolic code and trees of rigid bodies implement the same interface; `check_mechanism` tests it.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from numbers import Real
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError

_ROUNDING = 1e-14  # of the largest inertia: less is none
_LARGEST = 1e9  # of a parameter, in SI units
_TORQUE = {"rad": "N m", "m": "N"}
Value = float | None  # of a parameter, SI; None: as data sets say, or the default


class Parameter(NamedTuple):
    """A physical parameter of a mechanism: name, default value, unit and meaning.

    required : a data set must give it; the default then serves examples only
    rotor : it is the inertia of a motor's rotor, in which the base parameters are linear
    """

    name: str
    default: float
    unit: str
    meaning: str
    required: bool = False
    rotor: bool = False


class Terms(NamedTuple):
    """Terms of the equations of motion at states with batch shape (...).

    M (..., n, n) [kg m^2]; h (..., n) [N m], all torques but those of motors and friction;
    momentum = M w (..., n) [N m s]; dLdq (..., n) [N m]; B (n, n), one where a motor drives the
    joint; energy (...) [J]. Momentum has also what a base that turns adds; energy has not.
    """

    M: Array
    h: Array
    momentum: Array
    dLdq: Array
    B: Array
    energy: Array


class Partials(NamedTuple):
    """Partial derivatives of the torques M a - h of a motion by state and base parameters.

    by_q, by_w (..., n, n) [N m/rad, N m s/rad]; by_p (..., n, nb), the regressor: M a - h is linear
    in the base parameters and equals by_p p.
    """

    by_q: Array
    by_w: Array
    by_p: Array


@dataclass(frozen=True, kw_only=True)
class Mechanism(ABC):
    """A mechanism of n joints: facts as fields, equations of motion as methods.

    `p` is always an array of base parameters, shape (..., nb), as `base` makes it from physical
    ones. q, w, a and u have shape (..., n); batch axes of p broadcast against theirs.

    Attributes
    ----------
    kind : str
        Name of the kind, as a [mechanism] table has it.
    joints : tuple of n str
    position_units : tuple of n str
        "rad" of revolute joints, "m" of prismatic ones.
    driven : tuple of n bool
        Which joints have a motor.
    parameters : tuple of Parameter
        Physical parameters.
    base_names, base_units, base_meanings : tuple of nb str
        Base parameters in the order of p; what each is in physical parameters, "" where that has
        no short formula.
    values : mapping of str to float
        Physical values that were given, SI; `nominal` adds the defaults.
    tolerances : mapping of str to float
        Of physical values, in %: the standard deviation of what they may be off by; "all" stands
        for all of them.
    options : mapping
        Further keys of the [mechanism] table.
    coupled : tuple of pairs of str and n float
        Parts with friction of their own that turn with several joints, such as a motor at a wrist:
        name, and turns for one of each joint.
    floating : bool
        Whether the base moves, as recordings say; its motion is behind p, see `with_base_motion`.
    """

    kind: str
    joints: tuple[str, ...]
    position_units: tuple[str, ...]
    driven: tuple[bool, ...]
    parameters: tuple[Parameter, ...]
    base_names: tuple[str, ...]
    base_units: tuple[str, ...]
    base_meanings: tuple[str, ...]
    values: Mapping[str, float] = field(default_factory=dict, hash=False)
    options: Mapping[str, Any] = field(default_factory=dict, compare=False)
    tolerances: Mapping[str, float] = field(default_factory=dict, hash=False)
    coupled: tuple[tuple[str, tuple[float, ...]], ...] = ()
    floating: bool = False

    def __post_init__(self) -> None:
        self.check_values(self.values)
        self._check_tolerances()

    def __repr__(self) -> str:
        options = [f"{name}={value!r}" for name, value in self.options.items()]
        values = [f"{name}={value:g}" for name, value in self.values.items()]
        return f"{self.kind}({', '.join(options + values)})"

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}  # compiled code stays behind

    @abstractmethod
    def base(self, parameters: Mapping[str, Any]) -> Array:
        """Base parameters p of physical ones (numbers or arrays of one batch shape); SI units.

        Missing ones take the given values or the defaults; an unknown name is an InputError.
        Gradients of torch parameters pass through.
        """

    @abstractmethod
    def dynamics(self, p: Array, q: Array, w: Array) -> tuple[Array, Array]:
        """M (..., n, n) and h (..., n), the terms that a step needs."""

    @abstractmethod
    def inertia(self, p: Array, q: Array) -> Array:
        """Mass matrix M (..., n, n) [kg m^2]."""

    @abstractmethod
    def terms(self, p: Array, q: Array, w: Array) -> Terms:
        """All terms of the equations of motion, see `Terms`."""

    @abstractmethod
    def partials(self, p: Array, q: Array, w: Array, a: Array) -> Partials:
        """Partial derivatives of M a - h, see `Partials`."""

    loads_of_gears: ClassVar[bool] = False  # whether `load` is a torque, not a force

    @abstractmethod
    def load(self, parameters: Mapping[str, Any], q: Array, w: Array, u: Array) -> Array:
        """Bearing force of each joint in friction-free motion, shape (..., n) [N].

        The force that the joint transmits to all bodies beyond it, sum m (a - g), of one that
        slides only what is across it, as load-dependent friction laws need it. It depends on
        physical parameters, not on base parameters alone.
        """

    def points(self, q: Array) -> Array | None:
        """Lines that draw the mechanism at positions q (..., n): (..., k, 2 or 3) [m], or None.

        The points are joined in their order; one of NaN ends a line. The last coordinate points
        upwards. A mechanism without a drawing has no animation, and nothing else lacks.
        """
        return None

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def friction_names(self) -> tuple[str, ...]:
        """Names of the m places where parts slide: the joints, then the coupled parts."""
        return (*self.joints, *(name for name, _ in self.coupled))

    @property
    def friction_units(self) -> tuple[str, ...]:
        """Unit of the position at each of these places: "rad", or "m"."""
        moved = (np.flatnonzero(row) for _, row in self.coupled)
        return (*self.position_units, *(self.position_units[int(row[0])] for row in moved))

    @property
    def friction_torque_units(self) -> tuple[str, ...]:
        """Unit of friction at each of these places: "N m", or "N"."""
        return tuple(_TORQUE[unit] for unit in self.friction_units)

    @cached_property
    def friction_map(self) -> Array:
        """A (m, n): parts slide with velocities A w; friction there acts on joints by A'."""
        rows = [row for _, row in self.coupled]
        return np.vstack([np.eye(self.n), *np.array(rows).reshape(-1, self.n)])

    @property
    def velocity_units(self) -> tuple[str, ...]:
        """Unit of each joint's velocity: "rad/s" or "m/s"."""
        return tuple(f"{unit}/s" for unit in self.position_units)

    @property
    def torque_units(self) -> tuple[str, ...]:
        """Unit of what each joint's motor gives: "N m", or "N" of a prismatic joint."""
        return tuple(_TORQUE[unit] for unit in self.position_units)

    @cached_property
    def motors(self) -> Array:
        """One for each joint (n,) that a motor drives, else zero."""
        return np.array(self.driven, dtype=float)

    @property
    def B(self) -> Array:
        """Input matrix, shape (n, n): one on the diagonal where a motor drives the joint."""
        return np.diag(self.motors)

    @cached_property
    def defaults(self) -> dict[str, float]:
        """Value of each physical parameter where none is passed: the given one, or the default."""
        return {p.name: self.values.get(p.name, p.default) for p in self.parameters}

    @property
    def table(self) -> dict[str, Any]:
        """The [mechanism] table that stands for this mechanism in files."""
        kind = {} if self.kind in self.options else {"kind": self.kind}
        parameters = {"parameters": dict(self.values)} if self.values else {}
        tolerances = {"tolerances": dict(self.tolerances)} if self.tolerances else {}
        return {**kind, **self.options, **parameters, **tolerances}

    def nominal(self, overrides: Mapping[str, float] | None = None) -> dict[str, float]:
        """All physical parameters: the overrides, else the given values, else the defaults; SI.

        Masses and lengths that the kind requires have no default; rotors, gears and gravity do.

        Raises
        ------
        InputError
            Where one is unknown, missing or negative, or where they make an inertia negative.

        >>> from frictionid.mechanics import pendulum
        >>> pendulum(mass=0.5).nominal({"length": 0.2})["length"]
        0.2
        """
        self.check_values(overrides or {})
        values_given = {**self.values, **(overrides or {})}
        missing = [
            f"{p.name} [{p.unit}] ({p.meaning})"
            for p in self.parameters
            if p.required and p.name not in values_given
        ]
        if missing:
            raise InputError(
                f"[mechanism] {self.kind} needs {', '.join(missing)}: "
                "give it in [mechanism.parameters]; no machine has a usual mass or length"
            )
        values = {**self.defaults, **values_given}
        self._check_positive(values)
        return values

    @cached_property
    def nominal_base(self) -> Array:
        """Base parameters (nb,) of the nominal physical ones."""
        return np.asarray(self.base(self.nominal()), dtype=float)

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The mechanism with other given values, in addition to those that it has.

        >>> from frictionid.mechanics import pendulum
        >>> pendulum(mass=0.5).with_values({"length": 0.2})
        pendulum(mass=0.5, length=0.2)
        """
        return replace(self, values={**self.values, **values})

    def base_tolerances(self) -> Array:
        """Standard deviations (nb,) of base parameters by the tolerances, infinite without any.

        To first order: base parameters change with physical ones, which are off by themselves.

        >>> from frictionid.mechanics import pendulum
        >>> m = replace(pendulum(mass=0.5, length=0.2), tolerances={"mass": 5.0})
        >>> m.base_names, (m.base_tolerances() / m.base(m.nominal())).round(3).tolist()
        (('inertia', 'gravity'), [0.05, 0.05])
        """
        square, here = np.zeros(len(self.base_names)), self.nominal()
        for name, size in self.errors().items():
            up, down = (self.base({**here, name: here[name] + s * size}) for s in (0.5, -0.5))
            square += np.asarray(up - down, dtype=float) ** 2
        return np.where(square > 0, np.sqrt(square), np.inf)

    def errors(self) -> dict[str, float]:
        """How far each parameter that has a tolerance may be off, in its unit.

        >>> from frictionid.mechanics import pendulum
        >>> replace(pendulum(mass=0.5, length=0.2), tolerances={"mass": 5.0}).errors()
        {'mass': 0.025}
        """
        nominal, stated = self.nominal() if self.tolerances else {}, self.tolerances
        shares = {name: stated.get(name, stated.get("all", 0.0)) / 100.0 for name in nominal}
        sizes = {name: shares[name] * abs(value) for name, value in nominal.items()}
        return {name: size for name, size in sizes.items() if size > 0}

    def with_defaults(self) -> Self:
        """The mechanism with the default of each required parameter that was not given.

        For machines that exist in a simulation only; those of recordings are what they are.

        >>> from frictionid.mechanics import pendulum
        >>> pendulum(mass=0.5).with_defaults()
        pendulum(length=1, mass=0.5)
        """
        required = (p for p in self.parameters if p.required)
        missing = {p.name: p.default for p in required if p.name not in self.values}
        return replace(self, values={**missing, **self.values}) if missing else self

    def check_values(self, values: Mapping[str, Any]) -> None:
        """Raise InputError where a name is no parameter's, or a value none that it can have."""
        for name, value in values.items():
            self.check_name(name)
            number = isinstance(value, Real) and not isinstance(value, bool)
            what = f"[mechanism] {self.kind}: {name} = {value!r}"
            if not (number and math.isfinite(value)):
                raise InputError(f"{what} must be a finite number")
            if abs(value) > _LARGEST:
                raise InputError(f"{what} is more than any machine has: correct it")
        for p in self.parameters:
            if (p.unit == "kg" or p.rotor) and values.get(p.name, 0.0) < 0:
                raise InputError(
                    f"[mechanism] {self.kind}: {p.name} = {values[p.name]:g} {p.unit} is "
                    "negative; masses and rotor inertias are 0 or more"
                )

    def _check_tolerances(self) -> None:
        for name, tolerance in self.tolerances.items():
            if name != "all":
                self.check_name(name)
            number = isinstance(tolerance, Real) and not isinstance(tolerance, bool)
            if not (number and 0 < tolerance < math.inf):
                raise InputError(
                    f"[mechanism.tolerances] {self.kind}: {name} = {tolerance!r} must be a "
                    "positive number, in % of the value"
                )

    def check_name(self, name: str) -> None:
        """Raise InputError, with the nearest name, where this is no parameter's."""
        names = [parameter.name for parameter in self.parameters]
        if name not in names:
            motor = self.kind == "pendulum" and name in ("kt", "R")
            way = "motor = true in [mechanism] adds it" if motor else nearest(name, names)
            raise InputError(f"[mechanism] {self.kind} has no parameter {name!r}; {way}")

    def _check_positive(self, values: Mapping[str, float]) -> None:
        """Refuse an M that is not positive definite, with the joints that have no inertia."""
        q = np.linspace(0.0, np.pi, 7)[:, None] * np.arange(self.n)
        each, vectors = np.linalg.eigh(self.inertia(self.base(values), q))
        at = int(np.argmin(each[:, 0]))
        least, share = float(each[at, 0]), np.abs(vectors[at, :, 0])
        if least > _ROUNDING * float(each.max()):
            return
        joints = [self.joints[j] for j in np.flatnonzero(share > 0.5 * share.max())]
        rotors = " and ".join(f"rotor_{j}" for j in joints if f"rotor_{j}" in self.defaults)
        way = f"give {rotors} [kg m^2] in [mechanism.parameters], or " if rotors else ""
        raise InputError(
            f"[mechanism] {self.kind}: these parameters give no inertia to a direction of motion, "
            f"that of {' and '.join(joints)} (smallest eigenvalue of M: {least:.3g}); {way}correct "
            "masses, lengths and inertias"
        )


_MOST = 2  # joints of which a grid is made
_COUNT = 512


def configurations(n: int, steps: int) -> Array:
    """Positions (C, n) of n joints in -pi to pi [rad or m].

    Of up to two joints a grid of so many steps each; of more, where grids grow beyond all bounds,
    512 that fill the space evenly, with the first at zero [Roberts2018].

    >>> configurations(1, 3).ravel().round(2)
    array([-3.14,  0.  ,  3.14])
    >>> configurations(7, 3).shape
    (512, 7)
    """
    if n <= _MOST:
        grid = np.meshgrid(*[np.linspace(-np.pi, np.pi, steps)] * n, indexing="ij")
        return np.stack(grid, axis=-1).reshape(-1, n)
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (n + 1))  # the root of x^(n + 1) = x + 1
    share = (0.5 + np.arange(_COUNT)[:, None] * ratio ** -np.arange(1.0, n + 1)) % 1.0
    return np.pi * (2.0 * share - 1.0)
