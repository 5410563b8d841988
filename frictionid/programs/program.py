"""A program: named inputs, one operation a line, named outputs; all languages start from it.

Programs are recorded operation by operation, and so are their derivatives.
"""

import math
import operator
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
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


class Recorder:
    """Lines that were recorded; the same operation on the same values is one line."""

    def __init__(self, inputs: tuple[str, ...]) -> None:
        self.inputs = inputs
        self.lines: dict[Line, Value] = {}

    def record(self, operation: str, *operands: Operand) -> Operand:
        """Value of an operation: a number where all operands are."""
        if (simple := _simplified(operation, operands)) is not None:
            return simple
        if operation == "power" and operands[1] == 2.0:  # much faster in most languages
            operation, operands = "multiply", (operands[0], operands[0])
        line = Line(operation, operands)
        if line not in self.lines:
            self.lines[line] = Value(len(self.inputs) + len(self.lines))
        return self.lines[line]

    def run(
        self, program: Program, values: Mapping[str, Operand]
    ) -> dict[str, tuple[Operand, ...]]:
        """Outputs of a program on values of its inputs, with lines for what it does."""
        functions = {name: partial(self.record, name) for name in OPERATIONS}
        return {name: tuple(row) for name, row in program.run(values, functions).items()}

    def program(self, outputs: Mapping[str, tuple[Operand, ...]]) -> Program:
        """Program of those of the lines that its outputs need."""
        return needed(Program(self.inputs, tuple(self.lines), outputs))


def _simplified(operation: str, operands: tuple[Operand, ...]) -> Operand | None:
    """What needs no line: numbers alone, and sums and products with 0 and 1."""
    if not any(isinstance(v, Value) for v in operands):
        return OPERATIONS[operation](*operands)
    if operation == "select":
        test, yes, no = operands
        if not isinstance(test, Value):
            return yes if test else no
        return yes if yes == no else None
    if len(operands) == 1:
        return None
    a, b = operands
    if operation == "multiply":
        return 0.0 if 0.0 in (a, b) else b if a == 1.0 else a if b == 1.0 else None
    if operation == "add":
        return b if a == 0.0 else a if b == 0.0 else None
    if operation == "subtract":
        return a if b == 0.0 else None
    if operation in ("divide", "power") and b == 1.0:
        return a
    if operation == "divide" and a == 0.0:
        return 0.0
    return None


# --- Derivatives: forward mode, exact [Griewank2008] ----------------------------------------------

_Record = Callable[..., Operand]


def with_derivatives(
    program: Program, directions: Mapping[str, Collection[str]], outputs: Collection[str]
) -> Program:
    """The program with derivatives of some outputs in some directions.

    A kink has the derivative of one of its sides, and a step that of neither.

    Parameters
    ----------
    directions : by a name, the inputs that grow together at the rate of one
        The derivatives are outputs, too, named as in "Tf by w".

    >>> from frictionid.programs.trace import traced
    >>> square = traced(lambda x: {"y": x["w"] * x["w"]}, {"w": 1})
    >>> with_derivatives(square, {"w": ["w_1"]}, ["y"]).run({"w_1": 3.0})
    {'y': [9.0], 'y by w': [6.0]}
    """
    recorder = Recorder(program.inputs)
    values: list[Operand] = [Value(k) for k in range(len(program.inputs))]
    rates: dict[str, list[Operand]] = {
        name: [float(x in grow) for x in program.inputs] for name, grow in directions.items()
    }

    def value(operand: Operand) -> Operand:
        return values[operand.number] if isinstance(operand, Value) else operand

    def rate(operand: Operand, along: list[Operand]) -> Operand:
        return along[operand.number] if isinstance(operand, Value) else 0.0

    for line in program.lines:
        operands = tuple(value(x) for x in line.operands)
        result = recorder.record(line.operation, *operands)
        for along in rates.values():
            changes = tuple(rate(x, along) for x in line.operands)
            along.append(_rate(recorder.record, Line(line.operation, operands), changes, result))
        values.append(result)
    results = {name: tuple(value(x) for x in entries) for name, entries in program.outputs.items()}
    for name in outputs:
        for direction, along in rates.items():
            rates_of_output = tuple(rate(x, along) for x in program.outputs[name])
            results[f"{name} by {direction}"] = rates_of_output
    return recorder.program(results)


def _rate(record: _Record, line: Line, changes: tuple[Operand, ...], result: Operand) -> Operand:
    """Rate of a line's value, as its operands change."""
    if all(change == 0.0 for change in changes):
        return 0.0
    operation, operands = line
    if operation in ("add", "subtract", "negative"):
        return record(operation, *changes)
    if operation == "select":
        return record("select", operands[0], *changes[1:])
    if operation in ("maximum", "minimum"):
        first = record("less", *(operands[::-1] if operation == "maximum" else operands))
        return record("select", first, *changes)
    slopes = _slopes(record, operation, operands, result)
    total: Operand = 0.0
    for slope, change in zip(slopes, changes, strict=bool(slopes)):
        if change != 0.0:
            total = record("add", total, record("multiply", slope, change))
    return total


def _slopes(
    record: _Record, operation: str, operands: tuple[Operand, ...], result: Operand
) -> tuple[Operand, ...]:
    """Slopes by each operand; of comparisons and signs, which are steps, none."""
    a = operands[0]
    match operation:
        case "multiply":
            return operands[1], a
        case "divide":
            by_divisor = record("negative", record("divide", result, operands[1]))
            return record("divide", 1.0, operands[1]), by_divisor
        case "power":
            lower = record("power", a, record("subtract", operands[1], 1.0))
            return record("multiply", operands[1], lower), record(
                "multiply", result, record("log", a)
            )
        case "absolute":
            return (record("sign", a),)
        case "sqrt":
            return (record("divide", 0.5, result),)
        case "exp":
            return (result,)
        case "log":
            return (record("divide", 1.0, a),)
        case "log1p":
            return (record("divide", 1.0, record("add", 1.0, a)),)
        case "tanh":
            return (record("subtract", 1.0, record("multiply", result, result)),)
        case "arctan":
            return (record("divide", 1.0, record("add", 1.0, record("multiply", a, a))),)
        case "sin":
            return (record("cos", a),)
        case "cos":
            return (record("negative", record("sin", a)),)
        case _:
            return ()
