"""The operations that a program may consist of: few enough for every language to have them all."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple


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
