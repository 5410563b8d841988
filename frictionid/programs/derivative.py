"""Derivatives of programs, line by line: forward mode, exact [Griewank2008]."""

from collections.abc import Callable, Collection, Mapping

from .program import Line, Operand, Program, Value
from .trace import Recorder

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
