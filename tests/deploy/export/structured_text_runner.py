"""Structured text, run: parsed by blark, its syntax tree then evaluated on arrays of cases.

Only what IEC 61131-3 defines is known here: a name that is neither declared in the file nor a
function of the standard is an error, and so is an operation on a wrong type.
"""

import numpy as np
from blark.parse import parse_source_code

STANDARD = {
    "ABS": np.abs,
    "SQRT": np.sqrt,
    "EXP": np.exp,
    "LN": np.log,
    "ATAN": np.arctan,
    "SIN": np.sin,
    "COS": np.cos,
    "EXPT": np.power,
    "MIN": np.minimum,
    "MAX": np.maximum,
    "SEL": lambda g, no, yes: np.where(g, yes, no),
}
BINARY = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    "=": np.equal,
    "<>": np.not_equal,
    "AND": np.logical_and,
    "OR": np.logical_or,
}
REALS = {"LREAL": np.float64, "REAL": np.float32}


class StructuredText:
    """The functions and the one function block of a file; variables live on between calls.

    Variables are arrays over cases, those of ARRAY type dicts of them by their indices from 1.
    """

    def __init__(self, text):
        items = parse_source_code(text).transform().items
        self.functions = {str(i.name): i for i in items if type(i).__name__ == "Function"}
        (self.block,) = (i for i in items if type(i).__name__ == "FunctionBlock")
        self.types = declared(self.block)
        self.real = REALS["LREAL" if "LREAL" in text else "REAL"]
        first = {"BOOL": lambda: False, "ARRAY": dict, "LREAL": np.float64, "REAL": np.float32}
        self.variables = {name: first[kind]() for name, kind in self.types.items()}

    def call(self, **inputs):
        """One call of the block."""
        for name, value in inputs.items():
            assert name in self.types, name
            self.variables[name] = value
        self._run(self.block.body.statements, self.variables)

    def _run(self, statements, variables):
        for statement in statements:
            kind = type(statement).__name__
            if kind == "IfStatement":
                chosen = statement.if_expression, statement.statements, statement.else_clause
                if self._value(chosen[0], variables):
                    self._run(chosen[1].statements, variables)
                else:
                    self._run(chosen[2].statements.statements, variables)
                continue
            assert kind == "AssignmentStatement", kind
            value = self._value(statement.expression, variables)
            (target,) = statement.variables
            if type(target).__name__ == "MultiElementVariable":
                variables[str(target.name.name)][_index(target)] = value
            else:
                assert str(target.name) in variables, target
                variables[str(target.name)] = dict(value) if isinstance(value, dict) else value

    def _value(self, e, variables):
        kind = type(e).__name__
        if kind == "Real":
            return self.real(str(e.value))
        if kind == "Boolean":
            return str(e.value) == "TRUE"
        if kind == "SimpleVariable":
            return variables[str(e.name)]
        if kind == "MultiElementVariable":
            return variables[str(e.name.name)][_index(e)]
        if kind == "ParenthesizedExpression":
            return self._value(e.expr, variables)
        if kind == "UnaryOperation":
            value, sign = self._value(e.expr, variables), str(e.op)
            return np.logical_not(value) if sign == "NOT" else {"-": np.negative}[sign](value)
        if kind == "BinaryOperation":
            sides = self._value(e.left, variables), self._value(e.right, variables)
            truths = [np.asarray(side).dtype == bool for side in sides]
            assert truths == [str(e.op) in ("AND", "OR")] * 2, f"{e.op} of a wrong type"
            return BINARY[str(e.op)](*sides)
        assert kind == "FunctionCall", kind
        own = [self._value(p.value, variables) for p in e.parameters]
        return self._called(str(e.name.name), own)

    def _called(self, name, arguments):
        if name not in self.functions:
            return STANDARD[name](*arguments)
        function = self.functions[name]
        variables = dict.fromkeys([*declared(function), name], self.real(0))
        variables |= dict(zip(declared(function), arguments, strict=False))
        self._run(function.body.statements, variables)
        return variables[name]


def _index(variable):
    (subscripts,) = variable.elements
    return tuple(int(str(s.value)) for s in subscripts.subscripts)


def declared(item):
    """Types of the variables of a function or block by their names, in their order."""
    return {
        str(v.variable.name): "ARRAY"
        if hasattr(one.init.spec, "subranges")
        else str(one.init.spec.type)
        for part in item.declarations
        for one in part.items
        for v in one.variables
    }
