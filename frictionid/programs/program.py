"""A program: named inputs, one operation a line, named outputs; all languages start from it."""

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple


def _divided(a: float, b: float) -> float:
    return a / b if b else math.copysign(math.inf, a) if a else math.nan


def _exp(a: float) -> float:
    return math.exp(a) if a < 709.0 else math.inf


# By its name, what an operation gives of Python numbers. Comparisons and logic give 1.0 and 0.0;
# `select` takes its second operand where the first is not zero, else its third.
OPERATIONS: Mapping[str, Callable[..., float]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": _divided,
    "power": lambda a, b: float(a**b),
    "negative": operator.neg,
    "absolute": abs,
    "sign": lambda a: float(a > 0) - float(a < 0),
    "sqrt": math.sqrt,
    "exp": _exp,
    "log": math.log,
    "log1p": math.log1p,
    "tanh": math.tanh,
    "arctan": math.atan,
    "sin": math.sin,
    "cos": math.cos,
    "maximum": max,
    "minimum": min,
    "less": lambda a, b: float(a < b),
    "less_equal": lambda a, b: float(a <= b),
    "equal": lambda a, b: float(a == b),
    "and": lambda a, b: float(bool(a) and bool(b)),
    "or": lambda a, b: float(bool(a) or bool(b)),
    "not": lambda a: float(not a),
    "select": lambda a, b, c: b if a else c,
}


@dataclass(frozen=True, slots=True)
class Value:
    """A value of a program: an input or a line by its number, from 0, inputs first."""

    number: int

    def __bool__(self) -> bool:
        raise NotImplementedError("a decision by values that are not known")


Operand = Value | float


class Line(NamedTuple):
    """One operation on earlier values and on constants."""

    operation: str
    operands: tuple[Operand, ...]


@dataclass(frozen=True)
class Program:
    """Straight-line code of scalars.

    inputs : names of the inputs; those that no line uses stand there, too
    lines : each a new value, numbered after the inputs
    outputs : by name, the values of its entries

    >>> double = Program(("w",), (Line("add", (Value(0), Value(0))),), {"Tf": (Value(1),)})
    >>> double.run({"w": 1.5})
    {'Tf': [3.0]}
    """

    inputs: tuple[str, ...]
    lines: tuple[Line, ...]
    outputs: Mapping[str, tuple[Operand, ...]]

    def numbered(self) -> Iterator[tuple[int, Line]]:
        """Lines with the numbers of their values."""
        return enumerate(self.lines, start=len(self.inputs))

    def results(self) -> Iterator[tuple[str, Operand]]:
        """Entries of the outputs, named as inputs are: y_1, y_2 ... of an output y."""
        for name, row in self.outputs.items():
            yield from ((f"{name}_{k + 1}", operand) for k, operand in enumerate(row))

    def operands(self) -> Iterator[Operand]:
        """All that the lines and the outputs read, in their order."""
        for line in self.lines:
            yield from line.operands
        for output in self.outputs.values():
            yield from output

    def read(self) -> list[str]:
        """Inputs that are read, in their order."""
        numbers = {v.number for v in self.operands() if isinstance(v, Value)}
        return [name for k, name in enumerate(self.inputs) if k in numbers]

    def with_inputs(self, names: Sequence[str]) -> "Program":
        """The program with only these of its inputs, those that it reads among them."""
        left = [k for k, name in enumerate(self.inputs) if name in names]
        count = len(self.inputs)
        kept = [*left, *range(count, count + len(self.lines))]
        return _renumbered(replace(self, inputs=tuple(self.inputs[k] for k in left)), kept)

    def run(
        self, inputs: Mapping[str, Any], functions: Mapping[str, Any] | None = None
    ) -> dict[str, list[Any]]:
        """Outputs, computed by functions of the names in `OPERATIONS`: numbers, unless given.

        With the functions of CasADi, SymPy or torch the values are theirs.
        """
        compute = functions or OPERATIONS
        values = [inputs[name] for name in self.inputs]

        def value(operand: Operand) -> Any:
            return values[operand.number] if isinstance(operand, Value) else operand

        for line in self.lines:
            values.append(compute[line.operation](*map(value, line.operands)))
        return {name: [value(entry) for entry in entries] for name, entries in self.outputs.items()}


def needed(program: Program) -> Program:
    """The program without lines that no output needs."""
    count = len(program.inputs)
    used = {
        v.number for entries in program.outputs.values() for v in entries if isinstance(v, Value)
    }
    for number in range(count + len(program.lines) - 1, count - 1, -1):
        if number in used:
            operands = program.lines[number - count].operands
            used |= {v.number for v in operands if isinstance(v, Value)}
    kept = [n for n in range(count + len(program.lines)) if n < count or n in used]
    lines = tuple(program.lines[n - count] for n in kept[count:])
    return _renumbered(replace(program, lines=lines), kept)


def _renumbered(program: Program, kept: Sequence[int]) -> Program:
    """The program whose values had these numbers before, in this order."""
    place = {old: Value(new) for new, old in enumerate(kept)}

    def moved(operands: Sequence[Operand]) -> tuple[Operand, ...]:
        return tuple(place[v.number] if isinstance(v, Value) else v for v in operands)

    lines = tuple(Line(line.operation, moved(line.operands)) for line in program.lines)
    outputs = {name: moved(entries) for name, entries in program.outputs.items()}
    return Program(program.inputs, lines, outputs)
