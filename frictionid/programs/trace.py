"""From laws and loops to programs: they compute once on what writes down what is done to it.

Laws compute on arrays of any kind, so that they need not be written again for each language. The
arrays here are NumPy's, with scalars that record; NumPy hands its functions over to them [NEP13],
[NEP18]. A law's parameters are numbers: what follows from them alone becomes a constant.
"""

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from functools import cache, partialmethod
from types import FunctionType
from typing import Any

import numpy as np

from frictionid.arrays import Array

from .program import OPERATIONS, Operand, Program, Recorder, Value

_SAME = {"abs": "absolute", "fabs": "absolute", "logical_and": "and", "bitwise_and": "and"} | {
    "logical_or": "or",
    "bitwise_or": "or",
    "logical_not": "not",
    "invert": "not",
    "true_divide": "divide",
    "fmax": "maximum",
    "fmin": "minimum",
}


class Traced(np.ndarray):
    """An array whose entries are values of a program, or numbers; NumPy computes on it as usual."""

    recorder: Recorder

    def __array_finalize__(self, source: Any) -> None:
        if hasattr(source, "recorder"):
            self.recorder = source.recorder

    def __getitem__(self, index: Any) -> Any:
        # a single entry stays an array, which can be computed on
        return as_traced(self.recorder, super().__getitem__(index))

    def __array_ufunc__(
        self,
        ufunc: Any,
        method: str,
        *inputs: Any,
        axis: Any = 0,
        keepdims: bool = False,
        dtype: Any = None,
        where: Any = True,
    ) -> Any:
        """The ufunc, entry by entry.

        Raises
        ------
        NotImplementedError
            For functions that programs do not have.
        """
        name = _SAME.get(ufunc.__name__, ufunc.__name__)
        if name == "matmul" and method == "__call__":
            return _product(*inputs)
        if dtype not in (None, bool, object) or where is not True:
            raise NotImplementedError(f"{ufunc.__name__} of some entries, or of a type")
        if method == "reduce":
            return _reduced(name, inputs[0], axis, keepdims)
        if method != "__call__" or name not in {**OPERATIONS, **_COMPOSED}:
            raise NotImplementedError(ufunc.__name__)
        return _applied(recorder_of(inputs), name, *inputs)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        recorder = recorder_of(args)
        if func is np.where and len(args) == 3:
            return _applied(recorder, "select", *args)
        if func is np.astype:  # values of a program are of one type
            return args[0]
        if func is np.linalg.solve:
            return _solution(*args)
        if func is np.linalg.inv:
            return _solution(args[0], np.eye(len(args[0])))
        result = super().__array_function__(func, types, args, kwargs)
        if isinstance(result, list | tuple):
            return type(result)(as_traced(recorder, array) for array in result)
        return as_traced(recorder, result) if isinstance(result, np.ndarray) else result

    def __bool__(self) -> bool:
        raise NotImplementedError("a decision by values that are not known")


def _applied(recorder: Recorder, name: str, *arrays: Any) -> Any:
    """An operation on entries, over arrays that broadcast."""

    def recorded(*operands: Any) -> Operand:
        values = tuple(v if isinstance(v, Value) else float(v) for v in operands)
        if name in _COMPOSED:
            return _COMPOSED[name](recorder.record, *values)
        return recorder.record(name, *values)

    entries = np.frompyfunc(recorded, len(arrays), 1)(*map(_boxed, arrays))
    return as_traced(recorder, entries)


def recorder_of(arrays: Any) -> Recorder:
    """Recorder of the first traced array, in sequences, too."""
    for array in arrays:
        if isinstance(array, Traced):
            return array.recorder
        if isinstance(array, list | tuple):
            with suppress(LookupError):
                return recorder_of(array)
    raise LookupError("no traced array")


def _boxed(array: Any) -> Array:
    """A plain array of values and numbers."""
    if isinstance(array, Traced):
        return array.view(np.ndarray)
    return np.asarray(array, dtype=object)


def as_traced(recorder: Recorder, array: Any) -> Any:
    """An array as a traced one."""
    out = _boxed(array).view(Traced)
    out.recorder = recorder
    return out


def _product(a: Any, b: Any) -> Any:
    """Product of matrices (..., i, k) and (..., k, j), of which one may be a vector (k,)."""
    if a.ndim == 1:
        return _product(a[None], b)[..., 0, :]
    if b.ndim == 1:
        return _product(a, b[:, None])[..., 0]
    return (a[..., :, :, None] * b[..., None, :, :]).sum(axis=-2)


def _solution(matrix: Any, right: Any) -> Any:
    """Solution (n, k) of a system by elimination without pivots, which mass matrices do without."""
    n = len(matrix)
    rows = [np.concatenate([matrix[i], right[i]]) for i in range(n)]
    for k in range(n):
        rows[k] = rows[k] / rows[k][k]
        for i in (*range(k), *range(k + 1, n)):
            rows[i] = rows[i] - rows[i][k] * rows[k]
    return np.stack(rows)[:, n:]


def _reduced(name: str, array: Any, axis: Any, keepdims: bool) -> Any:
    """Sum, greatest or least along axes."""
    recorder = array.recorder
    axes = range(array.ndim) if axis is None else np.atleast_1d(axis) % array.ndim
    for k in sorted(map(int, axes), reverse=True):
        parts = [as_traced(recorder, array.take(i, axis=k)) for i in range(array.shape[k])]
        total = parts[0] if parts else as_traced(recorder, np.zeros(np.delete(array.shape, k)))
        for part in parts[1:]:
            total = _applied(recorder, name, total, part)
        array = np.expand_dims(total, k) if keepdims else total
    return array


def _logaddexp(record: Callable[..., Operand], a: Operand, b: Operand) -> Operand:
    apart = record("negative", record("absolute", record("subtract", a, b)))
    return record("add", record("maximum", a, b), record("log1p", record("exp", apart)))


_COMPOSED: dict[str, Callable[..., Operand]] = {
    "logaddexp": _logaddexp,
    "not_equal": lambda record, a, b: record("not", record("equal", a, b)),
    "square": lambda record, a: record("multiply", a, a),
    "reciprocal": lambda record, a: record("divide", 1.0, a),
    "positive": lambda _, a: a,
    "greater": lambda record, a, b: record("less", b, a),
    "greater_equal": lambda record, a, b: record("less_equal", b, a),
}


def traced(
    function: Callable[[Mapping[str, Array]], Mapping[str, Array]],
    inputs: Mapping[str, int],
    zeros: Collection[str] = (),
) -> Program:
    """Program of a function of arrays.

    Parameters
    ----------
    function : called with an array (size,) for each input, by its name
        Gives arrays by name.
    inputs : sizes by name
        The program's inputs are named w_1, w_2 ... of an input w.
    zeros : names of inputs that are known to be zero

    Raises
    ------
    NotImplementedError
        Where the function does what programs cannot: decide by values, leave NumPy.

    >>> program = traced(lambda x: {"Tf": 0.1 * np.tanh(x["w"] / 0.02)}, {"w": 1})
    >>> [line.operation for line in program.lines], program.run({"w_1": 1.0})
    (['divide', 'tanh', 'multiply'], {'Tf': [0.1]})
    """
    names = tuple(f"{name}_{k + 1}" for name, size in inputs.items() for k in range(size))
    recorder, arrays, at = Recorder(names), {}, 0
    entries = _boxed([0.0 if name in zeros else Value(k) for k, name in enumerate(names)])
    for name, size in inputs.items():
        arrays[name] = as_traced(recorder, entries[at : at + size])
        at += size
    result = function(arrays)
    outputs = {
        name: tuple(
            v if isinstance(v, Value) else float(v) for v in _boxed(array).reshape(-1).tolist()
        )
        for name, array in result.items()
    }
    return recorder.program(outputs)


def chained(first: Program, then: Program) -> Program:
    """A program of both: the outputs of `first` are inputs of `then`, and outputs, too.

    >>> half = traced(lambda x: {"w": x["w"] / 2.0}, {"w": 1})
    >>> chained(half, traced(lambda x: {"Tf": x["w"] ** 2.0}, {"w": 1})).run({"w_1": 6.0})
    {'w': [3.0], 'Tf': [9.0]}
    """
    others = (x for x in then.inputs if x.rpartition("_")[0] not in first.outputs)
    inputs = tuple(dict.fromkeys((*first.inputs, *others)))
    recorder = Recorder(inputs)
    values: dict[str, Operand] = {name: Value(k) for k, name in enumerate(inputs)}
    middle = recorder.run(first, values)
    values |= {f"{x}_{j + 1}": v for x, row in middle.items() for j, v in enumerate(row)}
    return recorder.program(middle | recorder.run(then, values))


def without_zeros(programs: Mapping[str, Program], external: Collection[str]) -> dict[str, Program]:
    """Programs that read and write the numbers of one row, zero at first, without those that stay.

    external : inputs that are set from outside, by name

    >>> set_u = traced(lambda x: {"u": np.stack([2.0 * x["w"][0], 0.0 * x["w"][0]])}, {"w": 1})
    >>> add_up = traced(lambda x: {"y": x["u"][0] + x["u"][1] * x["w"][0]}, {"u": 2, "w": 1})
    >>> len(without_zeros({"set_u": set_u, "add_up": add_up}, ["w"])["add_up"].lines)
    0
    """
    out, zeros, fresh = dict(programs), set[str](), {""}
    while fresh:
        written = {x for program in out.values() for x, v in program.results() if v != 0.0}
        read = {x for program in out.values() for x in program.read()}
        fresh = {x for x in read - written if x.rpartition("_")[0] not in external}
        zeros |= fresh
        out = {
            name: _with_zeros(program, zeros) if fresh & {*program.read()} else program
            for name, program in out.items()
        }
    return out


def _with_zeros(program: Program, zeros: Collection[str]) -> Program:
    """The program of inputs of which these are zero."""
    recorder = Recorder(program.inputs)
    values = {x: 0.0 if x in zeros else Value(k) for k, x in enumerate(program.inputs)}
    return recorder.program(recorder.run(program, values))


# --- Loops as programs ----------------------------------------------------------------------------
# Of what is not known yet, entries are `Number`s: they stand in arrays of objects, on which the
# Python that is compiled otherwise runs as it is.


class Number:
    """A number of a program that is being written; with numbers that are known it gives another."""

    __slots__ = ("operand", "recorder")

    def __init__(self, recorder: Recorder, operand: Operand) -> None:
        self.recorder, self.operand = recorder, operand

    def _record(self, operation: str, *others: Any) -> Any:
        operands = (x.operand if isinstance(x, Number) else float(x) for x in (self, *others))
        result = self.recorder.record(operation, *operands)
        return Number(self.recorder, result) if isinstance(result, Value) else result

    def _record_behind(self, operation: str, other: Any) -> Any:
        return Number(self.recorder, float(other))._record(operation, self)

    __add__ = partialmethod(_record, "add")
    __radd__ = partialmethod(_record_behind, "add")
    __sub__ = partialmethod(_record, "subtract")
    __rsub__ = partialmethod(_record_behind, "subtract")
    __mul__ = partialmethod(_record, "multiply")
    __rmul__ = partialmethod(_record_behind, "multiply")
    __truediv__ = partialmethod(_record, "divide")
    __neg__ = partialmethod(_record, "negative")
    sin = partialmethod(_record, "sin")  # NumPy asks an entry for them
    cos = partialmethod(_record, "cos")


def traced_loop(
    loop: Callable[..., object], geometry: Any, shapes: tuple[tuple[int, ...], ...], *arrays: Array
) -> list[Any]:
    """Traced arrays of these shapes that a loop over samples fills at one sample.

    loop : called with the geometry, arrays (1, ...), and arrays of results (1, ...)
    arrays : those that are not traced are constants
    """
    recorder = recorder_of(arrays)

    def number(operand: Any) -> Any:
        return Number(recorder, operand) if isinstance(operand, Value) else float(operand)

    def operand(number: Any) -> Operand:
        return number.operand if isinstance(number, Number) else float(number)

    numbers = [np.frompyfunc(number, 1, 1)(np.asarray(x))[None] for x in arrays]
    out = [np.empty((1, *shape), dtype=object) for shape in shapes]
    interpreted(loop)(geometry, *numbers, *out)
    return [as_traced(recorder, np.frompyfunc(operand, 1, 1)(x[0])) for x in out]


@cache
def interpreted(loop: Any) -> Any:
    """The Python function that was compiled, which calls Python functions in its turn."""
    function = getattr(loop, "__wrapped__", loop)
    function = getattr(function, "py_func", function)
    scope = dict(function.__globals__)
    compiled = (name for name in function.__code__.co_names if hasattr(scope.get(name), "py_func"))
    scope |= {name: interpreted(scope[name]) for name in tuple(compiled)}
    return FunctionType(function.__code__, scope, function.__name__, function.__defaults__)
