"""Friction as an ONNX graph of float32, with a batch axis: of static laws, and with memory.

Each operation of the program is a node on columns (batch, 1). A law with memory takes a step:
memory goes in and comes out, as the state of a recurrent network does. A second file gives that at
the start of a motion.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.errors import InputError, needs
from frictionid.programs.program import Line, Operand, Program, Value
from frictionid.programs.trace import chained

from ..exported import ExportedFriction, ExportSettings, Written
from ..expressions import TRUTHS, takes_truth

with needs("export"):
    import onnx
    from onnx import TensorProto, helper

_OPSET = 17
_NODES = {  # of operations whose node has not their name
    "subtract": "Sub",
    "multiply": "Mul",
    "divide": "Div",
    "power": "Pow",
    "negative": "Neg",
    "absolute": "Abs",
    "arctan": "Atan",
    "maximum": "Max",
    "minimum": "Min",
    "less_equal": "LessOrEqual",
    "select": "Where",
}


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """Model of the torques; of laws with memory the step, and beside it the start of a motion."""
    programs, name = model.programs, settings.name
    if not programs.inputs:
        raise InputError("a law that depends on nothing has no ONNX graph: it is zero")
    inputs = ", ".join(programs.inputs)
    if not programs.memory:
        return Written(
            {".onnx": _model(model, programs.torque, name)}, notes=(f"inputs {inputs}; output Tf",)
        )
    step, start = (chained(first, programs.torque) for first in (programs.advance, programs.start))
    files = {
        ".onnx": _model(model, step, name),
        "_start.onnx": _model(model, start, f"{name}_start"),
    }
    called = f"inputs {inputs}, memory, dt; outputs Tf, memory_after"
    return Written(files, notes=(f"{called}: begin with {settings.stem}_start",))


def _model(model: ExportedFriction, program: Program, name: str) -> bytes:
    graph, n, m = _Graph(program), len(model.joints), model.programs.memory
    read = {x.partition("_")[0] for x in program.inputs}
    sizes: dict[str, list[Any]] = {x: ["batch", n] for x in model.programs.inputs}
    sizes |= {x: size for x, size in (("memory", ["batch", m, n]), ("dt", [1])) if x in read}
    for group in sizes:
        graph.split(group, m, n)
    for line in program.lines:
        graph.add(line)
    entries = [x for x in program.outputs if x.startswith("memory")]
    graph.join("Tf", ["Tf"], [-1, n])
    results: dict[str, list[Any]] = {"Tf": ["batch", n]}
    if entries:
        graph.join("memory_after", entries, [-1, m, n])
        results["memory_after"] = ["batch", m, n]
    ends = (
        [helper.make_tensor_value_info(x, TensorProto.FLOAT, size) for x, size in ends.items()]
        for ends in (sizes, results)
    )
    constants = [
        helper.make_tensor(x, TensorProto.FLOAT, [], [v]) for v, x in graph.constants.items()
    ]
    proto = helper.make_model(
        helper.make_graph(graph.nodes, name, *ends, constants),
        opset_imports=[helper.make_opsetid("", _OPSET)],
        producer_name="frictionid",
    )
    proto.ir_version = 8  # which runtimes of some years ago read, too
    facts = {"friction": "\n".join(model.facts), "joints": ", ".join(model.joints)}
    facts |= {"dt": "[s] since the step before, whose memory goes in"} if "dt" in sizes else {}
    helper.set_model_props(proto, facts)
    onnx.checker.check_model(proto)
    return proto.SerializeToString()


class _Graph:
    """Nodes of a program, in order; values are columns (batch, 1), constants have no axis."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.nodes: list[Any] = []
        self.constants: dict[float, str] = {}
        self.names = {k: "dt" if x == "dt_1" else x for k, x in enumerate(program.inputs)}
        self.truths: set[str] = set()  # names of values that are true or false

    def node(
        self, kind: str, inputs: Sequence[str], settings: Mapping[str, Any] | None = None
    ) -> str:
        """A node and the name of its value."""
        name = f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, inputs, [name], **(settings or {})))
        return name

    def split(self, group: str, m: int, n: int) -> None:
        """Columns of an input of the model."""
        if group == "dt":
            return
        flat, columns = group, [f"{group}_{j + 1}" for j in range(n)]
        if group == "memory":
            flat = self.node("Flatten", [group], {"axis": 1})
            columns = [f"memory_{i + 1}_{j + 1}" for i in range(m) for j in range(n)]
        self.nodes.append(helper.make_node("Split", [flat], columns, axis=1))

    def add(self, line: Line) -> None:
        """The node of a line, with values of the kinds that it takes."""
        operation, values = line
        inputs = [self._name(v, takes_truth(operation, k)) for k, v in enumerate(values)]
        if operation == "log1p":
            operation, inputs = "log", [self.node("Add", [*inputs, self._name(1.0)])]
        name = self.node(_NODES.get(operation, operation.capitalize()), inputs)
        self.names[len(self.names)] = name
        if operation in TRUTHS:
            self.truths.add(name)

    def join(self, name: str, outputs: Sequence[str], size: list[int]) -> None:
        """An output of the model of this size, of outputs of the program."""
        zero = self.node("Mul", [self.names[0], self._name(0.0)])  # constants become columns, too
        columns = [self._name(v) for x in outputs for v in self.program.outputs[x]]
        columns = [self.node("Add", [column, zero]) for column in columns]
        whole = self.node("Concat", columns, {"axis": 1})
        tensor = helper.make_tensor("shape", TensorProto.INT64, [len(size)], size)
        shape = self.node("Constant", [], {"value": tensor})
        self.nodes.append(helper.make_node("Reshape", [whole, shape], [name]))

    def _name(self, operand: Operand, is_truth: bool = False) -> str:
        """Name of a value or constant, converted where it is of the other kind."""
        if not isinstance(operand, Value):
            value = float(np.clip(operand, -3e38, 3e38))  # of floats
            return self.constants.setdefault(value, f"c{len(self.constants)}")
        name = self.names[operand.number]
        if (name in self.truths) == is_truth:
            return name
        return self.node(
            "Cast", [name], {"to": TensorProto.BOOL if is_truth else TensorProto.FLOAT}
        )
