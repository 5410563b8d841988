"""Mechanisms of any number of joints: trees of rigid bodies, as URDF and MJCF describe them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from frictionid.arrays import Array, solve
from frictionid.errors import InputError
from frictionid.mechanics.mechanism import Mechanism, Parameter, Partials, Terms
from frictionid.mechanics.rigid_body import equations
from frictionid.mechanics.rigid_body.base_parameters import BaseParameters
from frictionid.mechanics.rigid_body.robot import Attached, moved
from frictionid.mechanics.rigid_body.tree import Tree

_ROWS = 256  # samples at a time, so that what one algorithm leaves the next one finds in the cache
PAYLOAD = (
    ("mass", "kg", "mass of the payload"),
    ("x", "m", "its centre of mass, in the frame of the link that carries it"),
    ("y", "m", "its centre of mass"),
    ("z", "m", "its centre of mass"),
    *((f"I{k}", "kg m^2", "its inertia about its centre of mass") for k in ("xx", "xy", "xz")),
    *((f"I{k}", "kg m^2", "its inertia about its centre of mass") for k in ("yy", "yz", "zz")),
)


@dataclass(frozen=True, kw_only=True)
class RigidBodyTree(Mechanism):
    """A tree of rigid bodies. Physical parameters are those of its rotors and of a payload.

    The energy has its zero at any height: base parameters do not tell where the masses are.

    Attributes
    ----------
    tree : Tree
    reduction : BaseParameters
        How inertial and base parameters make one another.
    identity : str
        Hash of the tree, by which mechanisms are compared.
    payload : Attached or None
        Where the payload is.
    """

    tree: Tree = field(compare=False, repr=False)
    reduction: BaseParameters = field(compare=False, repr=False)
    identity: str
    payload: Attached | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        return super().__repr__()

    @property
    def table(self) -> dict[str, Any]:
        """The [mechanism] table that stands for this mechanism; the file's format is its kind."""
        given = {"parameters": dict(self.values)} if self.values else {}
        return {**self.options, **given}

    def base(self, parameters: Mapping[str, Any]) -> Array:
        for name in parameters:
            self.check_name(name)
        return self._inertial({**self.defaults, **parameters}) @ self.reduction.regrouping.T

    def dynamics(self, p: Array, q: Array, w: Array) -> tuple[Array, Array]:
        M, h = self._evaluate(equations.dynamics, p, q, w)
        return M, h

    def inertia(self, p: Array, q: Array) -> Array:
        return self._evaluate(lambda *x: (equations.inertia(*x),), p, q)[0]

    def terms(self, p: Array, q: Array, w: Array) -> Terms:
        M, h, momentum, dLdq, energy = self._evaluate(equations.terms, p, q, w)
        return Terms(M, h, momentum, dLdq, self.B, energy)

    def partials(self, p: Array, q: Array, w: Array, a: Array) -> Partials:
        def rows(tree: Tree, *x: Array) -> tuple[Array, ...]:
            return equations.partials(tree, self.reduction, *x)

        return Partials(*self._evaluate(rows, p, q, w, a))

    def load(self, parameters: Mapping[str, Any], q: Array, w: Array, u: Array) -> Array:
        """Torque that each joint's gear passes on in friction-free motion, shape (..., n) [N m].

        |B u - rotor dw/dt|: what the motor gives and its rotor does not take. That is the torque of
        the rigid bodies beyond the gear, on which the friction of geared joints depends.
        """
        p = self.base(parameters)
        M, h = self.dynamics(p, q, w)
        force = self.motors * u
        rotors = self._rotor_inertias({**self.defaults, **parameters})
        R = self.tree.rotors
        return np.abs(force - ((solve(M, h + force) @ R.T) * rotors) @ R)

    def _rotor_inertias(self, values: Mapping[str, Any]) -> Array:
        arrays = [np.asarray(values[name], dtype=float) for name in self.tree.rotor_names]
        return np.stack(np.broadcast_arrays(*arrays), axis=-1)

    def _inertial(self, values: Mapping[str, Any]) -> Array:
        """Inertial parameters (..., N) of physical ones."""
        for name, value in values.items():
            if hasattr(value, "detach"):
                raise InputError(f"{self.kind}: {name} is a tensor; trees of bodies need NumPy")
        rotors = self._rotor_inertias(values)
        bodies = np.broadcast_to(self.tree.inertia, (*rotors.shape[:-1], self.n, 10))
        if self.payload is not None and self.payload.body >= 0:
            own = _payload_inertia(values, self.payload)
            bodies = np.broadcast_to(bodies, (*own.shape[:-1], self.n, 10)).copy()
            bodies[..., self.payload.body, :] += own
        lead = np.broadcast_shapes(rotors.shape[:-1], bodies.shape[:-2])
        return np.concatenate(
            [
                np.broadcast_to(bodies.reshape(*bodies.shape[:-2], -1), (*lead, 10 * self.n)),
                np.broadcast_to(rotors, (*lead, rotors.shape[-1])),
            ],
            axis=-1,
        )

    def _evaluate(
        self, rows: Callable[..., tuple[Array, ...]], p: Array, *states: Array
    ) -> list[Array]:
        """Arrays of `rows(tree, pi, *states)`, for batch axes that broadcast, some at a time."""
        for x in (p, *states):
            if hasattr(x, "detach"):
                raise InputError(
                    f"{self.kind}: trees of rigid bodies are evaluated on NumPy arrays, not on "
                    "tensors; convert them with .numpy()"
                )
        lead = np.broadcast_shapes(np.shape(p)[:-1], *(np.shape(x)[:-1] for x in states))
        count, E = int(np.prod(lead)), self.reduction.expansion
        same = all(size == 1 for size in np.shape(p)[:-1])
        own = np.reshape(p, (1, -1)) if same else _flat(p, lead)
        flat = [_flat(np.asarray(x, dtype=float), lead) for x in states]
        pi, parts = own @ E.T if same else None, []
        for k in range(0, max(count, 1), _ROWS):
            some = slice(k, k + _ROWS)
            parts.append(
                rows(self.tree, own[some] @ E.T if pi is None else pi, *(x[some] for x in flat))
            )
        wholes = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts, strict=True))
        return [x.reshape((*lead, *x.shape[1:])) for x in wholes]


def _flat(x: Array, lead: tuple[int, ...]) -> Array:
    return np.broadcast_to(x, (*lead, x.shape[-1])).reshape(-1, x.shape[-1])


def _payload_inertia(values: Mapping[str, Any], at: Attached) -> Array:
    """Inertial parameters (..., 10) that a payload adds to its body."""
    numbers = [np.asarray(values[f"payload_{name}"], dtype=float) for name, *_ in PAYLOAD]
    table = np.stack(np.broadcast_arrays(*numbers), axis=-1)
    out = np.empty((*table.shape[:-1], 10))
    for k in np.ndindex(table.shape[:-1]):
        mass, center, six = table[k][0], table[k][1:4], table[k][4:]
        own = np.array([mass, 0.0, 0.0, 0.0, *six])
        out[k] = moved(moved(own, np.eye(3), center), at.turn, at.shift)
    return out


def parameters_of_tree(tree: Tree, rotors: Array, payload: bool) -> tuple[Parameter, ...]:
    """Physical parameters: the rotors' inertias, with these defaults, and those of a payload."""
    own = zip(tree.rotor_names, rotors, tree.rotor_units, tree.joints, strict=True)
    return (
        *(
            Parameter(name, float(value), unit, f"rotor inertia, seen at {joint}", rotor=True)
            for name, value, unit, joint in own
        ),
        *(Parameter(f"payload_{n}", 0.0, unit, what) for n, unit, what in PAYLOAD if payload),
    )
