"""A program: named inputs, one operation a line, named outputs; all languages start from it."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple


class Operation(NamedTuple):
    """Name, number of operands, and its value of Python numbers.

    Comparisons and logic give 1.0 and 0.0; `select` takes its second operand where the first is
    not zero, else its third.
    """

    name: str
    operands: int
    value: Callable[..., float]


def _sign(a: float) -> float:
    return float(a > 0) - float(a < 0)


def _power(a: float, b: float) -> float:
    return float(a**b)


def _divided(a: float, b: float) -> float:
    return a / b if b else math.copysign(math.inf, a) if a else math.nan


def _exp(a: float) -> float:
    return math.exp(a) if a < 709.0 else math.inf


OPERATIONS = {
    operation.name: operation
    for operation in (
        Operation("add", 2, lambda a, b: a + b),
        Operation("subtract", 2, lambda a, b: a - b),
        Operation("multiply", 2, lambda a, b: a * b),
        Operation("divide", 2, _divided),
        Operation("power", 2, _power),
        Operation("negative", 1, lambda a: -a),
        Operation("absolute", 1, abs),
        Operation("sign", 1, _sign),
        Operation("sqrt", 1, math.sqrt),
        Operation("exp", 1, _exp),
        Operation("log", 1, math.log),
        Operation("log1p", 1, math.log1p),
        Operation("tanh", 1, math.tanh),
        Operation("arctan", 1, math.atan),
        Operation("sin", 1, math.sin),
        Operation("cos", 1, math.cos),
        Operation("maximum", 2, max),
        Operation("minimum", 2, min),
        Operation("less", 2, lambda a, b: float(a < b)),
        Operation("less_equal", 2, lambda a, b: float(a <= b)),
        Operation("equal", 2, lambda a, b: float(a == b)),
        Operation("and", 2, lambda a, b: float(bool(a) and bool(b))),
        Operation("or", 2, lambda a, b: float(bool(a) or bool(b))),
        Operation("not", 1, lambda a: float(not a)),
        Operation("select", 3, lambda a, b, c: b if a else c),
    )
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
        compute = functions or {name: operation.value for name, operation in OPERATIONS.items()}
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
