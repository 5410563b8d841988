"""Friction as TorchScript, for actuator networks: loaded by torch alone, without this package."""

import warnings
from collections.abc import Mapping
from typing import Any

from frictionid.errors import InputError, needs
from frictionid.friction import Inputs

from ..exported import INPUTS, ExportedFriction, ExportSettings, Written
from ..expressions import operations

with needs("networks"):
    import torch


_NAMES = {"equal": "eq", "and": "logical_and", "or": "logical_or", "not": "logical_not"}
_OPERATIONS: Mapping[str, Any] = {
    **operations(torch, _NAMES),  # constants of which three take tensors alone
    "maximum": lambda a, b: torch.maximum(_tensor(a), _tensor(b)),
    "minimum": lambda a, b: torch.minimum(_tensor(a), _tensor(b)),
    "select": lambda test, a, b: torch.where(test, _tensor(a), _tensor(b)),
}


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

    def __init__(self, parts: Mapping[str, Any], facts: str, time: float) -> None:
        super().__init__()
        self.start, self.advance, self.torque = (parts[x] for x in ("start", "advance", "torque"))
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

    def __init__(self, model: ExportedFriction, part: str, kind: torch.dtype) -> None:
        super().__init__()
        self.model, self.part = model, part
        self.register_buffer("theta", torch.tensor(model.friction.theta, dtype=kind))

    def forward(self, x: torch.Tensor, *others: torch.Tensor) -> torch.Tensor:
        law, zero = self.model.friction.law, 0.0 * x[..., : len(self.model.joints)]
        inputs = dict(zip(self.model.programs.inputs, x.split(zero.shape[-1], -1), strict=True))
        if not law.is_network:
            rows = self._rows_of_program(inputs, zero[..., 0], *others)
        else:
            memory = tuple(entry.unbind(-2) for entry in others[:1])
            everything = Inputs(*(inputs.get(name, zero) for name in INPUTS))
            result = getattr(law, self.part)(self.theta, everything, *memory, *others[1:])
            rows = [v + zero for v in ((result,) if self.part == "torque" else result)]
        result = rows[0] if self.part == "torque" else torch.stack(rows, dim=-2)
        return result.to(self.theta.dtype)

    def _rows_of_program(
        self, inputs: dict[str, Any], zero: torch.Tensor, *others: torch.Tensor
    ) -> list[torch.Tensor]:
        """Outputs (batch, n) of the program."""
        columns = dict(inputs)
        for i, entry in enumerate(others[0].unbind(-2) if others else ()):
            columns[f"memory_{i + 1}"] = entry
        scalars = {f"{x}_{j + 1}": v for x, row in columns.items() for j, v in enumerate(row.T)}
        if len(others) == 2:
            scalars["dt_1"] = others[1]
        values = getattr(self.model.programs, self.part).run(scalars, _OPERATIONS).values()
        return [torch.stack([v + zero for v in column], dim=-1) for column in values]


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A module that `torch.jit.load` reads; its `facts` and `forward` say what goes in.

    Raises
    ------
    InputError
        For friction that depends on nothing.
    """
    programs, n = model.programs, len(model.joints)
    if not programs.inputs:
        raise InputError("a law that depends on nothing has no TorchScript module: it is zero")
    kind = torch.float64 if settings.precision == "double" else torch.float32
    m, width = programs.memory, n * len(programs.inputs)
    shape = f"(batch, samples, {width})" if m else f"(batch, {width})"
    columns = ", ".join(f"{x} of each joint" for x in programs.inputs)
    facts = "\n".join((*model.facts, f"Input {shape}, {settings.precision}: {columns}."))
    x, memory = torch.ones(2, width, dtype=kind), torch.zeros(2, m, n, dtype=kind)
    examples = {"start": (x,), "advance": (x, memory, torch.full([1], 0.01, dtype=kind))}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that TorchScript has a successor, and shapes are fixed
        parts = {
            part: torch.jit.trace(_Part(model, part, kind), example, check_trace=False)
            for part, example in ({"torque": (x, memory)} | (examples if m else {})).items()
        }
        module: torch.nn.Module = _Static(parts["torque"], facts)
        if m:
            module = _WithMemory(parts, facts, model.law.sample_time or 0.0)
        content = torch.jit.script(module).save_to_buffer()
    called = "history, dt" if m else "x"
    note = f'module = torch.jit.load("{settings.stem}.pt"); Tf = module({called}); see module.facts'
    return Written({".pt": content}, notes=(note,))
