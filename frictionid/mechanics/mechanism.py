"""Equations of motion of a mechanism as compiled code.

    M(q) dw/dt = h(q, w) + B u - Tf

SymPy derives them once from the Lagrangian L = T - V and writes them as flat scalar code, which
runs on NumPy arrays and torch tensors. Its parameters are the *base* parameters, the combinations
of masses, lengths and inertias in which L is linear: motion identifies nothing else [Gautier1990].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from frictionid.arrays import Array, namespace, solve, times
from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.mechanics.description import Description
from frictionid.mechanics.lagrange import (
    Equations,
    bearing_forces,
    equations_of_motion,
    full_matrix,
)
from frictionid.mechanics.scalar_code import scalar_code


class Terms(NamedTuple):
    """Terms of the equations of motion at states with batch shape (...).

    M (..., n, n) [kg m^2]; h (..., n) [N m], all torques but those of motors and friction;
    momentum = M w (..., n) [N m s]; dLdq (..., n) [N m]; B (n, n), one where a motor drives the
    joint; energy (...) [J].
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


@dataclass(frozen=True)
class Mechanism:
    """Equations of motion of a mechanism, for states of any batch shape on NumPy or torch.

    `p` is always an array of base parameters, shape (..., len(self.base_names)), as `base` makes it
    from physical ones; its batch axes broadcast against those of q and w.

    Examples
    --------
    >>> import numpy as np
    >>> from frictionid.mechanics import pendulum
    >>> m = pendulum()
    >>> p = m.base({"mass": 1.0, "length": 0.5})
    >>> [float(x) for x in p]                         # inertia [kg m^2], gravity moment [N m]
    [0.25, 4.905]
    >>> m.terms(p, np.array([np.pi / 2]), np.array([0.0])).h
    array([-4.905])
    """

    description: Description

    def __reduce__(self) -> tuple[Any, ...]:
        return Mechanism, (self.description,)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.description.q)

    @cached_property
    def defaults(self) -> dict[str, float]:
        """Default values of the physical parameters, SI units."""
        return {str(a.symbol): a.default for a in self.description.parameters}

    @property
    def base_names(self) -> tuple[str, ...]:
        """Names of the base parameters, in the order of `p`."""
        return tuple(b.name for b in self.description.base)

    @cached_property
    def driven(self) -> Array:
        """One for each joint (n,) that a motor drives, else zero."""
        return np.array(self.description.driven, dtype=float)

    @property
    def B(self) -> Array:
        """Input matrix, shape (n, n): one on the diagonal where a motor drives the joint."""
        return np.diag(self.driven)

    def base(self, parameters: Mapping[str, Any]) -> Array:
        """Base parameters p of physical ones (numbers or arrays of one batch shape); SI units.

        Missing parameters take their defaults; an unknown name is an InputError. Gradients of torch
        parameters pass through.
        """
        values = self._complete(parameters)
        xp = namespace(*values.values())
        # not asarray on tensors: by torch's version it cuts off the gradient or warns about it
        floats = [
            xp.astype(v, xp.float64) if hasattr(v, "shape") else xp.asarray(v, dtype=xp.float64)
            for v in values.values()
        ]
        out = self._base_code(xp, *floats)
        return xp.stack(xp.broadcast_arrays(*out), axis=-1)

    def dynamics(self, p: Array, q: Array, w: Array) -> tuple[Array, Array]:
        """M (..., n, n) and h (..., n), the terms that a step needs."""
        xp, flat = self._evaluate(self._dynamics_code, p, q, w)
        h = flat[-1][..., None] if self.n == 1 else xp.stack(flat[-self.n :], axis=-1)
        return self._symmetric(xp, flat[: -self.n]), h

    def inertia(self, p: Array, q: Array) -> Array:
        """Mass matrix M (..., n, n) [kg m^2]."""
        xp, flat = self._evaluate(self._inertia_code, p, q, None)
        return self._symmetric(xp, flat)

    def terms(self, p: Array, q: Array, w: Array) -> Terms:
        """All terms of the equations of motion, see `Terms`."""
        n = self.n
        xp, flat = self._evaluate(self._terms_code, p, q, w)
        M = self._symmetric(xp, flat[: -2 * n - 1])
        h = xp.stack(flat[-2 * n - 1 : -n - 1], axis=-1)
        dLdq = xp.stack(flat[-n - 1 : -1], axis=-1)
        B = xp.asarray(self.B, dtype=M.dtype)
        return Terms(M, h, times(M, w), dLdq, B, flat[-1])

    def partials(self, p: Array, q: Array, w: Array, a: Array) -> Partials:
        """Partial derivatives of M a - h, see `Partials`."""
        n, nb = self.n, len(self.base_names)
        xp = namespace(q, p)
        state = [x[..., j] for x in (q, w, a) for j in range(n)]
        flat = self._partials_code(xp, *state, *(p[..., i] for i in range(nb)))
        zero = 0.0 * (q[..., 0] + p[..., 0])

        def matrix(entries: Sequence[Array], columns: int) -> Array:
            rows = [
                xp.stack([f + zero for f in entries[i * columns : (i + 1) * columns]], axis=-1)
                for i in range(n)
            ]
            return xp.stack(rows, axis=-2)

        by_q, by_w = flat[: n * n], flat[n * n : 2 * n * n]
        return Partials(matrix(by_q, n), matrix(by_w, n), matrix(flat[2 * n * n :], nb))

    def load(self, parameters: Mapping[str, Any], q: Array, w: Array, u: Array) -> Array:
        """Bearing force of each joint in friction-free motion, shape (..., n) [N].

        The force that the joint transmits to all bodies beyond it, sum m (a - g), as load-dependent
        friction laws need it. It depends on physical parameters, not on base parameters alone.
        """
        values = self._complete(parameters)
        p = self.base(values)
        terms = self.terms(p, q, w)
        a = solve(terms.M, terms.h + times(terms.B, u))
        xp = namespace(q)
        columns = [x[..., j] for x in (q, w, a) for j in range(self.n)]
        flat = self._load_code(xp, *columns, *(values[name] for name in self.defaults))
        zero = 0.0 * q[..., 0]
        x, y = (xp.stack([f + zero for f in flat[i::2]], axis=-1) for i in (0, 1))
        return xp.sqrt(x * x + y * y)

    def _complete(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        unknown = [name for name in parameters if name not in self.defaults]
        if unknown:
            raise InputError(
                f"{self.description.kind} has no parameter {unknown[0]!r}; "
                f"{nearest(unknown[0], self.defaults)}"
            )
        return {**self.defaults, **parameters}

    def _evaluate(
        self, code: Callable[..., Any], p: Array, q: Array, w: Array | None
    ) -> tuple[Any, list[Array]]:
        xp = namespace(q, p)
        n = range(self.n)
        state = [q[..., j] for j in n] + ([] if w is None else [w[..., j] for j in n])
        flat = code(xp, *state, *(p[..., i] for i in range(p.shape[-1])))
        zero = 0.0 * (q[..., 0] + p[..., 0])  # constant entries take the batch shape
        return xp, [f + zero for f in flat]

    def _symmetric(self, xp: Any, upper: Sequence[Array]) -> Array:
        n = self.n
        if n == 1:  # a sixth of a prediction's time
            return upper[0][..., None, None]
        entries = full_matrix(upper, n)
        flat = xp.stack([entries[i, j] for i in range(n) for j in range(n)], axis=-1)
        return xp.reshape(flat, (*flat.shape[:-1], n, n))

    @cached_property
    def _equations(self) -> Equations:
        return equations_of_motion(self.description)

    @cached_property
    def _base_code(self) -> Callable[..., Any]:
        d = self.description
        return scalar_code([a.symbol for a in d.parameters], [b.expression for b in d.base])

    @cached_property
    def _dynamics_code(self) -> Callable[..., Any]:
        e = self._equations
        return scalar_code(e.arguments, [*e.M, *e.h])

    @cached_property
    def _inertia_code(self) -> Callable[..., Any]:
        e = self._equations
        return scalar_code([*self.description.q, *e.base], e.M)

    @cached_property
    def _terms_code(self) -> Callable[..., Any]:
        e = self._equations
        return scalar_code(e.arguments, [*e.M, *e.h, *e.dLdq, e.energy])

    @cached_property
    def _partials_code(self) -> Callable[..., Any]:
        e, d, n = self._equations, self.description, range(self.n)
        a = sp.symbols(f"_a0:{self.n}")
        M = full_matrix(e.M, self.n)
        torque = [sum(M[i, j] * a[j] for j in n) - e.h[i] for i in n]
        outputs = [sp.diff(t, x) for xs in (d.q, d.w, e.base) for t in torque for x in xs]
        return scalar_code([*d.q, *d.w, *a, *e.base], outputs)

    @cached_property
    def _load_code(self) -> Callable[..., Any]:
        d = self.description
        accelerations = sp.symbols(f"_a0:{self.n}")
        arguments = [*d.q, *d.w, *accelerations, *(a.symbol for a in d.parameters)]
        return scalar_code(arguments, bearing_forces(d, accelerations))
