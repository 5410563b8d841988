"""Friction: a law and its numbers, and its torque along recorded motion.

A *law* holds no numbers. A *friction* is a law with parameters theta of shape (..., n, P), P per
joint; the leading axes are batches (folds, seeds, bootstrap draws), so that picking, stacking and
averaging are plain indexing. Friction torques are positive when they oppose positive velocity.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise, repeat
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, like, namespace, numbers_like, plain
from frictionid.data.plants import Calibration
from frictionid.errors import InputError
from frictionid.programs.machine_code import compiled

from .constraints import Constraints, present
from .law import Inputs, Law, Memory, at_rest, check_temperature
from .provenance import Provenance, read_provenance


def relaxed(target: Array, keep: Array, start: Array, first: Array) -> Array:
    """Memory (..., S, n) at the nodes of recordings, from its start (..., R, n) in each.

    target, keep : (..., S - 1, n), of the step behind each node
    first : (R + 1,), recording i owns nodes first[i] to first[i + 1]

    >>> target, start = np.ones((3, 1)), np.zeros((2, 1))
    >>> relaxed(target, 0.5 * target, start, np.array([0, 3, 4])).ravel()
    array([0.  , 0.5 , 0.75, 0.  ])
    """
    *batch, steps, n = np.broadcast_shapes(target.shape, keep.shape)
    batch = list(np.broadcast_shapes(tuple(batch), start.shape[:-2]))
    flat = (np.broadcast_to(x, (*batch, *x.shape[-2:])) for x in (target, keep, start))
    shaped = [np.broadcast_to(x, (*x.shape[:-1], n)).reshape(-1, x.shape[-2], n) for x in flat]
    out = np.asarray(_scanned(*(np.require(x, float, ["C", "W"]) for x in shaped), first))
    return out.reshape(*batch, steps + 1, n)


@compiled
def _scanned(target: Array, keep: Array, start: Array, first: Array) -> Array:
    B, steps, n = target.shape
    out = np.empty((B, steps + 1, n))
    for b in range(B):
        for r in range(len(first) - 1):
            for j in range(n):
                z = start[b, r, j]
                out[b, first[r], j] = z
                for k in range(first[r], first[r + 1] - 1):
                    z = target[b, k, j] + (z - target[b, k, j]) * keep[b, k, j]
                    out[b, k + 1, j] = z
    return out


_OF_THETA = ("half_widths", "refined", "equation", "equality")  # in a provenance
_STEPS = 1_000_000  # of memories of all frictions at a time


class Nodes(NamedTuple):
    """Points in time at which friction acts in a `Problem`, all recordings in one series.

    inputs (S, n) each; time (S,) [s]; first (R + 1,): recording i owns first[i] to first[i + 1];
    per_sample: nodes for each recorded sample (2 where midpoints stand between the samples).
    newest: whether memory follows a step's last inputs, not the mean of both ends.
    """

    inputs: Inputs
    time: Array
    first: Array
    per_sample: int = 1
    newest: bool = False


@dataclass(frozen=True)
class Friction:
    """A law with its parameters theta (..., n, P).

    `parameters` are mechanism parameters that belong to this friction (published models bring their
    own inertias); empty where those of the data set hold. `mechanism` is "unit" where there is no
    other physics than this friction's, a negative acceleration. `provenance` says where it is from.
    `position_units` has "m" for prismatic joints, whose friction is a force, see `units_of`; none:
    all "rad". `calibration` has base parameters and sensor corrections, in the batch axes of theta.
    `load_unit` is that of the loads of load-dependent laws: "N" of forces in bearings, "N m" of
    torques of gears, see `Mechanism.load`. `constraints`: bounds and priors of the fit of theta.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> tf = Friction(CoulombViscous(), [[0.1, 0.02], [0.05, 0.0]])
    >>> print(tf)
    CoulombViscous(width=0.02, shape='tanh', symmetric=True)
      joint 1  coulomb 0.1 N m, viscous 0.02 N m s/rad
      joint 2  coulomb 0.05 N m, viscous 0 N m s/rad
    >>> tf.curve(np.array([-1.0, 1.0]))
    array([[-0.12, -0.05],
           [ 0.12,  0.05]])
    """

    law: Law
    theta: Array
    parameters: Mapping[str, float] = field(default_factory=dict)
    provenance: Provenance = Provenance()
    position_units: tuple[str, ...] = ()
    calibration: Calibration | None = None
    mechanism: str = ""
    constraints: Constraints | None = None
    load_unit: str = "N"

    def __post_init__(self) -> None:
        if not isinstance(self.law, Law):
            raise InputError(f"a friction needs a law, such as Stribeck(), not {self.law!r:.60}")
        if not isinstance(self.calibration, Calibration | None):
            raise InputError(f"a calibration is that of a Fit, not {self.calibration!r:.60}")
        kind = getattr(self.theta, "dtype", np.dtype(int))  # of lists, too
        if isinstance(kind, np.dtype) and kind.kind != "f":
            object.__setattr__(self, "theta", numbers_like(self.theta, np.zeros(0), "theta"))
        if not isinstance(self.provenance, Provenance):
            source = read_provenance(self.provenance, np.shape(self.theta))
            object.__setattr__(self, "provenance", source)
        P = len(self.law.names)
        if self.theta.ndim < 2 or self.theta.shape[-1] != P:
            raise InputError(
                f"theta must have shape (..., joints, {P}) for the parameters "
                f"{', '.join(self.law.names)}; got {tuple(self.theta.shape)}"
            )
        if self.mechanism not in ("", "unit"):
            raise ValueError(f"mechanism = {self.mechanism!r} must be 'unit', or be left out")
        if len(self.position_units) not in (0, self.n):
            raise ValueError(f"position_units = {self.position_units!r}: give {self.n} units")

    def __getitem__(self, index: Any) -> "Friction":
        """Friction at an index into the batch axes of theta: `friction[fold]`."""
        calibration = None if self.calibration is None else self.calibration[index]
        limits = None if self.constraints is None else self.constraints.at(index)
        return replace(self, theta=self.theta[index], calibration=calibration, constraints=limits)

    def noted(self, notes: Mapping[str, Any]) -> "Friction":
        """The friction with other notes in its provenance."""
        return replace(self, provenance=self.provenance.but(notes))

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.theta.shape[-2])

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the parts with friction, as the fit has them, else "joint 1", "joint 2" ..."""
        return self.provenance.joint_names(self.n)

    def units_at(self, joint: int) -> tuple[str, ...]:
        """Units of the law's parameters at a joint, from 0."""
        position = self.position_units[joint] if self.position_units else "rad"
        return units_of(self.law, position, self.load_unit)

    def torque(self, x: Inputs, memory: Memory = ()) -> Array:
        """Friction torque at inputs whose batch axes broadcast against theta's, (..., n) [N m]."""
        if not isinstance(x, Inputs):
            raise InputError(f"torque takes Inputs, not {x!r:.60}; curve takes velocities")
        return self.law.torque(self.theta, x, memory)

    def at_temperature(self, temperature: Array | float | None) -> "Friction":
        """The friction at a temperature [degC], of a law that does not depend on it.

        temperature : one, or (..., n), whose batch axes broadcast against theta's

        Raises
        ------
        InputError
            Where friction depends on the temperature, and none in degC is given.

        Examples
        --------
        >>> from frictionid.friction.laws import Thermal
        >>> print(Friction(Thermal(), np.array([[0.1, 0.02, -0.01, 0.0]])).at_temperature(35.0))
        CoulombViscous(width=0.02, shape='tanh', symmetric=True)
          joint 1  coulomb 0.09 N m, viscous 0.02 N m s/rad
        """
        check_temperature(self.law, temperature)
        if not self.law.uses_temperature or temperature is None:
            return self
        T = like(np.asarray(temperature, dtype=float) + np.zeros(self.n), self.theta)
        law, theta = self.law.at_temperature(self.theta, T)
        source = self.provenance.without(_OF_THETA)
        if np.ndim(temperature) == 0:
            source = source.but({"temperature": float(np.asarray(temperature))})
        return replace(self, law=law, theta=theta, provenance=source, constraints=None)

    def curve(self, w: Array, settle: float = 5.0) -> Array:
        """Steady friction torque (..., V, n) [N m] at velocities (V,), or (V, n) of each joint.

        Numerical smoothing of sgn(w) is left out, as in the physics step. Laws that depend on the
        temperature are at their reference.
        Laws with memory are held at each velocity for `settle` seconds before they are read.
        """
        theta, law = self.theta[..., None, :, :], self.law.sharpened()
        columns = np.broadcast_to(np.asarray(w, dtype=float).T, (self.n, len(w))).T
        x = at_rest(like(columns, theta))
        memory = law.start(theta, x)
        if memory:
            step = law.sample_time or 0.005
            dt = like([[step]], theta)
            for _ in range(int(np.ceil(settle / step))):
                x = x._replace(q=x.q + step * x.w)
                memory = law.advance(theta, x, memory, dt)
        return law.torque(theta, x, memory)

    def __repr__(self) -> str:
        return f"Friction({', '.join(' '.join(line.split()) for line in str(self).splitlines())})"

    def __str__(self) -> str:
        """Law and parameters with units; mean and spread over a batch."""
        if not self.law.names:
            return str(self.law)
        lines = [str(self.law)]
        if self.law.is_network:
            return "\n".join([*lines, f"  {len(self.law.names)} numbers for each joint"])
        theta = plain(self.theta).reshape(-1, self.n, len(self.law.names))
        has = present(self.law, np.abs(theta).max(axis=0))
        for j in range(self.n):
            values = (
                f"{name} {_number(theta[:, j, i])} {unit}"
                for i, (name, unit) in enumerate(zip(self.law.names, self.units_at(j), strict=True))
                if has[j, i]
            )
            lines.append(f"  {self.joints[j]}  " + ", ".join(values))
        return "\n".join(lines)


def units_of(law: Law, position_unit: str = "rad", load_unit: str = "N") -> tuple[str, ...]:
    """Units of a law's parameters for a joint whose position is in "rad" or "m".

    load_unit : of the load of a joint that turns, "N" or "N m"

    >>> from frictionid.friction.laws import CoulombViscous
    >>> units_of(CoulombViscous()), units_of(CoulombViscous(), "m")
    (('N m', 'N m s/rad'), ('N', 'N s/m'))
    >>> from frictionid.friction.laws import LoadDependent
    >>> units_of(LoadDependent()), units_of(LoadDependent(), load_unit="N m")
    (('N m', 'N m/N', 'N m s/rad'), ('N m', '1', 'N m s/rad'))
    """
    if position_unit == "rad":
        gears = load_unit == "N m"
        return tuple("1" if gears and unit == "N m/N" else unit for unit in law.units)
    return tuple(unit.replace("N m", "N").replace("rad", position_unit) for unit in law.units)


def _number(values: Array) -> str:
    if len(values) == 1:
        return f"{values[0]:.4g}"
    return f"{values.mean():.4g} +- {values.std(ddof=1):.2g}"


def along(friction: Friction, nodes: Nodes) -> Array:
    """Friction torque along recorded nodes, shape (..., S, n) [N m].

    The batch axes of theta lead. Memory starts anew in each recording. This, `along_own` and
    `memory_along` are the only loops over recorded time.

    >>> from frictionid.friction.laws import CoulombViscous
    >>> nodes = Nodes(at_rest(np.array([[-1.0], [2.0]])), np.array([0.0, 0.1]), np.array([0, 2]))
    >>> along(Friction(CoulombViscous(), np.array([[0.1, 0.02]])), nodes)[:, 0]
    array([-0.12,  0.14])
    """
    law, theta = friction.law, friction.theta[..., None, :, :]
    if not law.has_memory:
        return _torque_without_memory(friction, nodes.inputs)
    relaxing = _relaxing(friction, nodes)
    if relaxing is not None:
        return law.torque(theta, nodes.inputs, (relaxing,))
    xp = namespace(friction.theta, nodes.inputs.w)
    groups = _side_by_side(nodes, friction.theta)
    each = [law.torque(theta, x.inputs, memory_at_nodes(friction, x)) for x in groups]
    return each[0] if len(each) == 1 else xp.concat(each, axis=-2)


def along_own(friction: Friction, nodes: Nodes) -> Array:
    """Friction torque (S, n) [N m] along recorded nodes, each recording by a friction of its own.

    friction : (R, n, P), one entry for each recording

    Memories advance step by step side by side, which takes no longer than one of them alone.

    >>> from frictionid.friction.laws import CoulombViscous
    >>> nodes = Nodes(at_rest(np.ones((2, 1))), np.array([0.0, 0.1]), np.array([0, 1, 2]))
    >>> along_own(Friction(CoulombViscous(), np.array([[[0.1, 0.0]], [[0.2, 0.0]]])), nodes)[:, 0]
    array([0.1, 0.2])
    """
    law, done, out = friction.law, 0, []
    for part in _side_by_side(nodes, friction.theta[0]):
        theta = friction.theta[done : done + len(part.first) - 1]
        done += len(theta)
        steps = [np.stack(entries) for entries in zip(*_stepped(law, theta, part), strict=True)]
        for r, (first, end) in enumerate(pairwise(part.first)):
            memory = tuple(entry[: end - first, r] for entry in steps)
            out.append(law.torque(theta[r], _take(part.inputs, slice(first, end)), memory))
    return np.concatenate(out)


def memory_along(friction: Friction, nodes: Nodes) -> list[Memory]:
    """Memory at each step of all recordings side by side: entry t has arrays (..., R, n).

    Recordings that have ended keep their last node.
    """
    relaxing = _relaxing(friction, nodes)
    if relaxing is not None:
        return [(relaxing[..., now, :],) for now in _padded(nodes).T]
    return _stepped(friction.law, friction.theta[..., None, :, :], nodes)


def _stepped(law: Law, theta: Array, nodes: Nodes) -> list[Memory]:
    """Memory step by step; theta broadcasts against the recordings' inputs (R, n)."""
    every = 1 if law.sample_time is None else nodes.per_sample
    index = _padded(nodes).T
    x, time = _take(nodes.inputs, index[::every]), nodes.time[index[::every]]
    memories = [law.start(theta, _take(x, 0))]
    newest = law.sample_time is not None or nodes.newest
    between = _between(x, newest)
    rows = zip(*(repeat(None) if entry is None else entry for entry in between), strict=False)
    for row, dt in zip(rows, np.diff(time, axis=0)[..., None], strict=False):
        memories.append(law.advance(theta, Inputs._make(row), memories[-1], dt))
    return [memories[t // every] for t in range(len(index))]


def _relaxing(friction: Friction, nodes: Nodes) -> Array | None:
    """Memory (..., S, n) of a law that relaxes continuously; None of others, and of tensors."""
    law, theta, x = friction.law, friction.theta[..., None, :, :], nodes.inputs
    arrays = isinstance(0.0 * theta[..., 0], np.ndarray) and isinstance(x.w, np.ndarray)
    if law.sample_time is not None or not arrays:
        return None
    middle = _between(x, nodes.newest)
    dt = np.diff(nodes.time)[:, None]
    dt[nodes.first[1:-1] - 1] = 0.0  # from the end of a recording to the next
    relaxation = law.relaxation(theta, middle, dt)
    if relaxation is None:
        return None
    return relaxed(*relaxation, law.start(theta, _take(x, nodes.first[:-1]))[0], nodes.first)


def _torque_without_memory(friction: Friction, x: Inputs) -> Array:
    """Torque (..., S, n) of a static law, at so many nodes at a time that it needs little room."""
    law, theta = friction.law, friction.theta[..., None, :, :]
    S, most = len(x.w), max(1, _STEPS // int(np.prod(theta.shape[:-3], dtype=int)))
    if S <= most:
        return law.torque(theta, x, ())
    parts = [law.torque(theta, _take(x, slice(a, a + most)), ()) for a in range(0, S, most)]
    return namespace(parts[0]).concat(parts, axis=-2)


def memory_at_nodes(friction: Friction, nodes: Nodes) -> Memory:
    """Memory (..., S, n) at the nodes of all recordings."""
    xp = namespace(friction.theta, nodes.inputs.w)
    shape = (*friction.theta.shape[:-2], len(nodes.first) - 1, friction.n)
    steps = zip(*memory_along(friction, nodes), strict=True)
    return tuple(_unpad(xp, [xp.broadcast_to(x, shape) for x in entry], nodes) for entry in steps)


def _side_by_side(nodes: Nodes, theta: Array) -> Iterator[Nodes]:
    """Nodes of some recordings at a time: of many, and of unequal ones, memory needs little room.

    So many that they have some number of steps together, each as many as the longest of them.
    """
    sizes, first = np.diff(nodes.first), nodes.first
    most = max(1, _STEPS // int(np.prod(theta.shape[:-2], dtype=int)))
    begin = 0
    while begin < len(sizes):
        longest = np.maximum.accumulate(sizes[begin:])
        fits = longest * np.arange(1, len(longest) + 1) <= most
        end = begin + max(1, len(fits) if fits.all() else int(np.argmin(fits)))
        rows = slice(int(first[begin]), int(first[end]))
        x, time = _take(nodes.inputs, rows), nodes.time[rows]
        yield Nodes(x, time, first[begin : end + 1] - first[begin], *nodes[3:])
        begin = end


def _take(x: Inputs, index: Any) -> Inputs:
    return x.each(lambda values: values[index])


def _between(x: Inputs, newest: bool) -> Inputs:
    """Inputs of the steps between successive ones: their means, or the newest."""
    return x.each(lambda v: v[1:] if newest else (v[:-1] + v[1:]) / 2)


def _padded(nodes: Nodes) -> Array:
    """Node of each recording at each step, shape (R, longest); those that ended keep their last."""
    first, last = nodes.first[:-1, None], nodes.first[1:, None] - 1
    return np.minimum(first + np.arange(int((last - first).max()) + 1)[None], last)


def _unpad(xp: Any, steps: list[Array], nodes: Nodes) -> Array:
    stacked = xp.stack(steps, axis=-2)  # (..., R, longest, n)
    lengths = np.diff(nodes.first)
    parts = [stacked[..., r, : int(size), :] for r, size in enumerate(lengths)]
    return xp.concat(parts, axis=-2)
