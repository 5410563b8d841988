"""Friction as an ONNX graph of float32, with a batch axis: of static laws, and with memory.

Each operation of the program is a node on columns (batch, 1). A law with memory takes a step:
memory goes in and comes out, as the state of a recurrent network does. A second file gives that at
the start of a motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.expressions import TRUTHS
from frictionid.errors import InputError, needs
from frictionid.programs.program import Line, Operand, Program, Value

with needs("export"):
    import onnx
    from onnx import TensorProto, helper

_OPSET = 17
_NODES = {
    "add": "Add",
    "subtract": "Sub",
    "multiply": "Mul",
    "divide": "Div",
    "power": "Pow",
    "negative": "Neg",
    "absolute": "Abs",
    "sign": "Sign",
    "sqrt": "Sqrt",
    "exp": "Exp",
    "log": "Log",
    "tanh": "Tanh",
    "arctan": "Atan",
    "sin": "Sin",
    "cos": "Cos",
    "maximum": "Max",
    "minimum": "Min",
    "less": "Less",
    "less_equal": "LessOrEqual",
    "equal": "Equal",
    "and": "And",
    "or": "Or",
    "not": "Not",
    "select": "Where",
}


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """Model of the torques; of laws with memory the step, and beside it the start of a motion."""
    if not own.programs.inputs:
        raise InputError("a law that depends on nothing has no ONNX graph: it is zero")
    given = ", ".join(own.programs.inputs)
    if not own.programs.memory:
        model = _model(own, own.programs.torque, settings.name)
        return Written({".onnx": model}, notes=(f"inputs {given}; output Tf",))
    start = _model(own, own.first, f"{settings.name}_start")
    note = f"inputs {given}, memory, dt; outputs Tf, memory_after: begin with {settings.stem}_start"
    files = {".onnx": _model(own, own.step, settings.name), "_start.onnx": start}
    return Written(files, notes=(note,))


def _model(own: ExportedFriction, program: Program, name: str) -> bytes:
    graph = _Graph(program)
    read, n, m = {x.partition("_")[0] for x in program.inputs}, len(own.joints), own.programs.memory
    sizes: dict[str, list[Any]] = {x: ["batch", n] for x in own.programs.inputs}
    sizes |= {x: size for x, size in (("memory", ["batch", m, n]), ("dt", [1])) if x in read}
    for group in sizes:
        graph.split(group, m, n)
    for line in program.lines:
        graph.add(line)
    results = {}
    if "Tf" in program.outputs:
        results["Tf"] = ["batch", n]
        graph.joined("Tf", ["Tf"], n)
    if entries := [x for x in program.outputs if x.startswith("memory")]:
        results["memory_after"] = ["batch", m, n]
        graph.joined("memory_after", entries, n)
    made = helper.make_graph(
        graph.nodes,
        name,
        [helper.make_tensor_value_info(x, TensorProto.FLOAT, size) for x, size in sizes.items()],
        [helper.make_tensor_value_info(x, TensorProto.FLOAT, s) for x, s in results.items()],
        [helper.make_tensor(x, TensorProto.FLOAT, [], [v]) for v, x in graph.constants.items()],
    )
    version = helper.make_opsetid("", _OPSET)
    model = helper.make_model(made, opset_imports=[version], producer_name="frictionid")
    model.ir_version = 8  # which runtimes of some years ago read, too
    facts = {"friction": "\n".join(own.facts), "joints": ", ".join(own.joints)}
    facts |= {"dt": "[s] since the step before, whose memory goes in"} if "dt" in sizes else {}
    helper.set_model_props(model, facts)
    onnx.checker.check_model(model)
    content: bytes = model.SerializeToString()
    return content


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
        wants = [line.operation in ("and", "or", "not")] * len(line.operands)
        if line.operation == "select":
            wants[0] = True
        inputs = [self._of(v, want) for v, want in zip(line.operands, wants, strict=True)]
        if line.operation == "log1p":
            name = self.node("Log", [self.node("Add", [*inputs, self._of(1.0, False)])])
        else:
            name = self.node(_NODES[line.operation], inputs)
        self.names[len(self.names)] = name
        if line.operation in TRUTHS:
            self.truths.add(name)

    def joined(self, name: str, outputs: Sequence[str], n: int) -> None:
        """An output of the model (batch, n) or (batch, m, n), of outputs of the program."""
        first = self.names[0]  # constants become columns, too
        zero = self.node("Mul", [first, self._of(0.0, False)])
        columns = [self._of(v, False) for x in outputs for v in self.program.outputs[x]]
        columns = [self.node("Add", [column, zero]) for column in columns]
        whole = self.node("Concat", columns, {"axis": 1})
        size = [-1, n] if name == "Tf" else [-1, len(outputs), n]
        tensor = helper.make_tensor("shape", TensorProto.INT64, [len(size)], size)
        shape = self.node("Constant", [], {"value": tensor})
        self.nodes.append(helper.make_node("Reshape", [whole, shape], [name]))

    def _of(self, operand: Operand, is_truth: bool) -> str:
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
