"""Mechanisms as closed symbolic code.

SymPy derives the equations of motion once from the Lagrangian L = T - V and writes them as flat
scalar code, which runs on NumPy arrays and torch tensors. Objects of one description share it,
whatever values they have.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.str import StrPrinter

from frictionid.arrays import Array, like, namespace, solve, times
from frictionid.config import check_arguments

from .description import Description, Equations, bearing_forces, equations_of_motion
from .mechanism import Mechanism, Partials, Terms


class _Printer(StrPrinter):
    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802 (SymPy's name)
        return repr(float(expr))


def scalar_code(
    arguments: Sequence[sp.Symbol], outputs: Sequence[sp.Expr]
) -> Callable[..., tuple[Array, ...]]:
    """Function f(xp, *arguments) -> tuple of scalars; common subexpressions are computed once.

    `xp` supplies sin, cos, ...; constants are evaluated to floats beforehand, because the torch
    code of sympy.lambdify fails on integer powers of integers, square roots and constants.

    >>> import numpy as np, sympy as sp
    >>> x = sp.Symbol("x")
    >>> scalar_code([x], [sp.sqrt(4) * x**2, sp.cos(x)])(np, 3.0)[0]
    18.0
    """
    outputs = [sp.N(sp.sympify(e)) for e in outputs]
    shared, results = sp.cse(outputs, symbols=sp.numbered_symbols("_s"), list=True)
    printer = _Printer()
    used = set().union(*(e.atoms(sp.Function) for e in outputs))
    lines = [f"    {f} = xp.{f}" for f in sorted({type(e).__name__ for e in used})]
    lines += [f"    {name} = {printer.doprint(e)}" for name, e in shared]
    body = ", ".join(printer.doprint(e) for e in results)
    names = ", ".join(str(a) for a in arguments)
    source = f"def equations(xp, {names}):\n" + "\n".join(lines) + f"\n    return ({body},)\n"
    scope: dict[str, Any] = {}
    exec(compile(source, "<equations of motion>", "exec"), scope)
    return scope["equations"]


@dataclass(frozen=True, kw_only=True, repr=False)
class SymbolicMechanism(Mechanism):
    """Mechanism of a description in symbols, for states of any batch shape on NumPy or torch.

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

    @staticmethod
    def of_kind(
        describe: Callable[..., Description], arguments: Mapping[str, Any]
    ) -> "SymbolicMechanism":
        """Mechanism of what a function describes by options, of the types that it states.

        arguments : its options, and values of parameters, None where they are not given
        """
        usual = inspect.signature(describe).parameters
        options = {name: arguments[name] for name in usual}
        values = {k: v for k, v in arguments.items() if k not in usual and v is not None}
        check_arguments(describe, options, f"[mechanism] {describe.__name__.strip('_')}")
        mechanism = SymbolicMechanism.from_description(describe(**options))
        changed = {k: value for k, value in options.items() if value != usual[k].default}
        return replace(mechanism, values=values, options=changed)

    @staticmethod
    def from_description(description: Description) -> "SymbolicMechanism":
        """Mechanism of a description."""
        d = description
        rotors = {
            str(symbol) for inertia, _ in d.rotors for symbol in sp.sympify(inertia).free_symbols
        }
        return SymbolicMechanism(
            kind=d.kind,
            joints=d.joints,
            position_units=d.position_units or ("rad",) * len(d.q),
            driven=d.driven,
            parameters=tuple(p._replace(rotor=p.rotor or p.name in rotors) for p in d.parameters),
            base_names=tuple(b.name for b in d.base),
            base_units=tuple(b.unit for b in d.base),
            base_meanings=tuple(str(b.expression) for b in d.base),
            description=d,
        )

    @property
    def torque_units(self) -> tuple[str, ...]:
        """Unit of what each joint's motor gives."""
        return self.description.torque_units or super().torque_units

    def base(self, parameters: Mapping[str, Any]) -> Array:
        values = self._complete(parameters)
        xp = namespace(*values.values())
        # not asarray on tensors: by torch's version it cuts off the gradient or warns about it
        floats = [
            xp.astype(v, xp.float64) if hasattr(v, "shape") else xp.asarray(v, dtype=xp.float64)
            for v in values.values()
        ]
        out = self._code.base(xp, *floats)
        return xp.stack(xp.broadcast_arrays(*out), axis=-1)

    def dynamics(self, p: Array, q: Array, w: Array) -> tuple[Array, Array]:
        flat, zero = self._evaluate(self._code.dynamics, p, q, w)
        return self._rows(flat[: -self.n], zero), _columns(flat[-self.n :], zero)

    def inertia(self, p: Array, q: Array) -> Array:
        return self._rows(*self._evaluate(self._code.inertia, p, q))

    def terms(self, p: Array, q: Array, w: Array) -> Terms:
        n = self.n
        flat, zero = self._evaluate(self._code.terms, p, q, w)
        M = self._rows(flat[: -2 * n - 1], zero)
        h, dLdq = _columns(flat[-2 * n - 1 : -n - 1], zero), _columns(flat[-n - 1 : -1], zero)
        B = like(self.B, M)
        return Terms(M, h, times(M, w), dLdq, B, flat[-1] + zero)

    def partials(self, p: Array, q: Array, w: Array, a: Array) -> Partials:
        flat, zero = self._evaluate(self._code.partials, p, q, w, a)
        square = self.n**2
        parts = flat[:square], flat[square : 2 * square], flat[2 * square :]
        return Partials(*(self._rows(part, zero) for part in parts))

    def load(self, parameters: Mapping[str, Any], q: Array, w: Array, u: Array) -> Array:
        values = self._complete(parameters)
        p = self.base(values)
        terms = self.terms(p, q, w)
        a = solve(terms.M, terms.h + times(terms.B, u))
        xp = namespace(q)
        columns = [x[..., j] for x in (q, w, a) for j in range(self.n)]
        flat = self._code.load(xp, *columns, *(values[name] for name in self.defaults))
        x, y = (_columns(flat[i::2], 0.0 * q[..., 0]) for i in (0, 1))
        return xp.sqrt(x * x + y * y)

    def points(self, q: Array) -> Array:
        """Line (..., k, 2) [m] of the description, with the given values or the defaults.

        >>> import numpy as np
        >>> from frictionid.mechanics import pendulum
        >>> pendulum(length=0.5).points(np.array([0.0])).tolist()
        [[0.0, 0.0], [0.0, -0.5]]
        """
        columns = [q[..., j] for j in range(self.n)]
        flat = self._code.line(np, *columns, *self.defaults.values())
        line = np.stack(np.broadcast_arrays(*flat, *columns)[: len(flat)], axis=-1)
        return line.reshape(*line.shape[:-1], -1, 2) + 0.0  # no negative zeros

    def _complete(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        for name in parameters:
            self.check_name(name)
        return {**self.defaults, **parameters}

    def _evaluate(
        self, code: Callable[..., Any], p: Array, q: Array, *rates: Array
    ) -> tuple[Sequence[Array], Array]:
        """Values of the code, constants as they are, and zeros of their common shape."""
        state = [x[..., j] for x in (q, *rates) for j in range(self.n)]
        flat = code(namespace(q, p), *state, *(p[..., i] for i in range(p.shape[-1])))
        return flat, 0.0 * (q[..., 0] + p[..., 0])

    def _rows(self, entries: Sequence[Array], zero: Array) -> Array:
        """Matrices (..., n, k) of their entries by rows."""
        flat = _columns(entries, zero)
        return flat.reshape((*flat.shape[:-1], self.n, len(entries) // self.n))

    @cached_property
    def _code(self) -> "_Compiled":
        return _compiled(self.description)


@dataclass(frozen=True)
class _Compiled:
    """Flat scalar code of a description's equations, each compiled when it is first needed."""

    description: Description

    @cached_property
    def equations(self) -> Equations:
        return equations_of_motion(self.description)

    @cached_property
    def base(self) -> Callable[..., Any]:
        d = self.description
        return scalar_code(d.symbols, [b.expression for b in d.base])

    @cached_property
    def dynamics(self) -> Callable[..., Any]:
        e = self.equations
        return scalar_code(e.arguments, [*e.M, *e.h])

    @cached_property
    def inertia(self) -> Callable[..., Any]:
        e = self.equations
        return scalar_code([*self.description.q, *e.base], e.M)

    @cached_property
    def terms(self) -> Callable[..., Any]:
        e = self.equations
        return scalar_code(e.arguments, [*e.M, *e.h, *e.dLdq, e.energy])

    @cached_property
    def partials(self) -> Callable[..., Any]:
        e, d, n = self.equations, self.description, range(len(self.description.q))
        a = sp.symbols(f"_a0:{len(n)}")
        torque = [sum(e.M[len(n) * i + j] * a[j] for j in n) - e.h[i] for i in n]
        outputs = [sp.diff(t, x) for xs in (d.q, d.w, e.base) for t in torque for x in xs]
        return scalar_code([*d.q, *d.w, *a, *e.base], outputs)

    @cached_property
    def line(self) -> Callable[..., Any]:
        d = self.description
        return scalar_code([*d.q, *d.symbols], [e for point in d.line for e in point])

    @cached_property
    def load(self) -> Callable[..., Any]:
        d = self.description
        accelerations = sp.symbols(f"_a0:{len(d.q)}")
        arguments = [*d.q, *d.w, *accelerations, *d.symbols]
        return scalar_code(arguments, bearing_forces(d, accelerations))


def _columns(entries: Sequence[Array], zero: Array) -> Array:
    """Entries side by side (..., k), of which some are constants; zero is of the states' shape."""
    if type(zero) is not np.ndarray:
        return namespace(zero).stack([entry + zero for entry in entries], axis=-1)
    shapes = {zero.shape, *(getattr(entry, "shape", ()) for entry in entries)} - {()}
    shape = np.broadcast_shapes(*shapes) if len(shapes) > 1 else zero.shape
    out = np.empty((*shape, len(entries)), np.result_type(zero, *entries))
    for i, entry in enumerate(entries):
        out[..., i] = entry
    return out


_compiled = cache(_Compiled)
