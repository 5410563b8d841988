"""Friction as TorchScript, for actuator networks: loaded by torch alone, without this package."""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from typing import Any

from frictionid.deploy.export.exported import INPUTS, ExportedFriction, ExportSettings, Written
from frictionid.errors import InputError, needs
from frictionid.friction import Inputs
from frictionid.programs.program import Program

with needs("networks"):
    import torch


_OPERATIONS: Mapping[str, Any] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "power": lambda a, b: a**b,
    "negative": lambda a: -a,
    **{name: getattr(torch, name) for name in ("sign", "sqrt", "exp", "log", "log1p", "tanh")},
    **{name: getattr(torch, name) for name in ("arctan", "sin", "cos")},
    "absolute": torch.abs,
    "maximum": lambda a, b: torch.maximum(*_both(a, b)),
    "minimum": lambda a, b: torch.minimum(*_both(a, b)),
    "less": lambda a, b: a < b,
    "less_equal": lambda a, b: a <= b,
    "equal": lambda a, b: a == b,
    "and": torch.logical_and,
    "or": torch.logical_or,
    "not": torch.logical_not,
    "select": lambda test, a, b: torch.where(test, _tensor(a), _tensor(b)),
}


def _both(a: Any, b: Any) -> tuple[Any, Any]:
    """Two tensors, where one may be a number."""
    zero = 0.0 * (a if isinstance(a, torch.Tensor) else b)
    return a + zero, b + zero


def _tensor(a: Any) -> torch.Tensor:
    """A constant in double, which torch would take for a float."""
    return a if isinstance(a, torch.Tensor) else torch.tensor(a, dtype=torch.float64)


class _Static(torch.nn.Module):
    """Torques Tf (batch, n) of inputs (batch, k n), those of `facts` one after the other."""

    def __init__(self, torque: Any, facts: str) -> None:
        super().__init__()
        self.torque, self.facts = torque, facts

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.torque(x, torch.zeros([0], dtype=x.dtype))


class _WithMemory(torch.nn.Module):
    """Torques Tf (batch, n) at the end of a history (batch, samples, k n), the newest last.

    `sample_time` [s] lies between samples, 0 where any `dt` may. `start`, `advance` and `torque`
    take single samples (batch, k n), and memory (batch, m, n).
    """

    def __init__(self, start: Any, advance: Any, torque: Any, facts: str, time: float) -> None:
        super().__init__()
        self.start, self.advance, self.torque = start, advance, torque
        self.facts, self.sample_time = facts, time

    def forward(self, history: torch.Tensor, dt: float = 0.0) -> torch.Tensor:
        x = history[:, 0]
        memory = self.start(x)
        step = dt if dt > 0.0 else self.sample_time
        if step <= 0.0 and history.shape[1] > 1:
            raise ValueError("dt [s] between the samples must be given")
        for k in range(1, history.shape[1]):
            x = history[:, k]
            memory = self.advance(x, memory, torch.full([1], step, dtype=x.dtype))
        return self.torque(x, memory)


class _Part(torch.nn.Module):
    """Torques, or memory, as the law itself computes them, or a program of scalars."""

    def __init__(self, own: ExportedFriction, part: str, kind: torch.dtype) -> None:
        super().__init__()
        self.own, self.part = own, part
        self.register_buffer("theta", torch.tensor(own.friction.theta, dtype=kind))

    def forward(self, x: torch.Tensor, *others: torch.Tensor) -> torch.Tensor:
        own, n = self.own, len(self.own.joints)
        inputs = dict(zip(own.programs.inputs, x.split(n, dim=-1), strict=True))
        if own.law.is_network:
            return self._by_law(inputs, x[..., :n], *others)
        return self._by_program(getattr(own.programs, self.part), inputs, x[..., 0], *others)

    def _by_law(self, inputs: dict[str, Any], like: Any, *others: torch.Tensor) -> torch.Tensor:
        law, theta, m = self.own.friction.law, self.theta, self.own.programs.memory
        own = Inputs(*(inputs.get(name, 0.0 * like) for name in INPUTS))
        if self.part == "start":
            return torch.stack([entry + 0.0 * like for entry in law.start(theta, own)], dim=-2)
        memory = tuple(others[0][..., i, :] for i in range(m))
        if self.part == "torque":
            return law.torque(theta, own, memory)
        return torch.stack(law.advance(theta, own, memory, others[1]), dim=-2)

    def _by_program(
        self, program: Program, inputs: dict[str, Any], like: Any, *others: torch.Tensor
    ) -> torch.Tensor:
        n, m = len(self.own.joints), self.own.programs.memory
        known = {f"{x}_{j + 1}": v[..., j] for x, v in inputs.items() for j in range(n)}
        for i in range(m if others else 0):
            known |= {f"memory_{i + 1}_{j + 1}": others[0][..., i, j] for j in range(n)}
        if len(others) == 2:
            known["dt_1"] = others[1]
        columns = program.run(known, _OPERATIONS).values()
        rows = [torch.stack([v + 0.0 * like for v in column], dim=-1) for column in columns]
        made = rows[0] if self.part == "torque" else torch.stack(rows, dim=-2)
        return made.to(self.theta.dtype)


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """A module that `torch.jit.load` reads; its `facts` and `forward` say what goes in.

    Raises
    ------
    InputError
        For friction that depends on nothing.
    """
    if not own.programs.inputs:
        raise InputError("a law that depends on nothing has no TorchScript module: it is zero")
    kind = torch.float64 if settings.precision == "double" else torch.float32
    m, n, k = own.programs.memory, len(own.joints), len(own.programs.inputs)
    x, memory = torch.ones(2, k * n, dtype=kind), torch.zeros(2, m, n, dtype=kind)
    dt = torch.full([1], 0.01, dtype=kind)
    shape = "(batch, samples, {})" if m else "(batch, {})"
    columns = ", ".join(f"{x} of each joint" for x in own.programs.inputs)
    facts = "\n".join(
        (*own.facts, f"Input {shape.format(k * n)}, {settings.precision}: {columns}.")
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that TorchScript has a successor, and shapes are fixed
        torque = _traced(own, "torque", kind, (x, memory))
        module: torch.nn.Module = _Static(torque, facts)
        if m:
            start = _traced(own, "start", kind, (x,))
            advance = _traced(own, "advance", kind, (x, memory, dt))
            time = own.law.sample_time or 0.0
            module = _WithMemory(start, advance, torque, facts, time)
        buffer = io.BytesIO()
        torch.jit.save(torch.jit.script(module), buffer)
    called = "history, dt" if m else "x"
    note = f'module = torch.jit.load("{settings.stem}.pt"); Tf = module({called}); see module.facts'
    return Written({".pt": buffer.getvalue()}, notes=(note,))


def _traced(own: ExportedFriction, part: str, kind: torch.dtype, example: Any) -> Any:
    return torch.jit.trace(_Part(own, part, kind), example, check_trace=False)
