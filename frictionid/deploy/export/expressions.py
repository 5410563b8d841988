"""Programs as a person would write them: expressions, with names for what is used more than once.

All languages with infix operators are written from here: C, structured text, Python and LaTeX
differ in their `Form` of each operation and in how they write numbers.
"""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from frictionid.deploy.export.exported import ExportedFriction
from frictionid.programs.program import Line, Operand, Program, Value

TRUTHS = ("less", "less_equal", "equal", "and", "or", "not")  # operations that give true or false
_OF_TRUTHS = ("and", "or", "not")
_LONGEST = 30  # operations of an expression
WIDTH = 100


@dataclass(frozen=True, slots=True)
class Node:
    """An operation on expressions.

    Beside those of programs there are `number`, 1 or 0 of a truth, and `truth`, of a number.
    """

    operation: str
    operands: tuple[Expression, ...]


Expression = Node | str | float  # a name, or a constant


class Statement(NamedTuple):
    """A name for the value of an expression, which may be true or false."""

    name: str
    expression: Expression
    is_truth: bool


class Block(NamedTuple):
    """What is computed for one joint: statements, then its entry of each output by name."""

    statements: tuple[Statement, ...]
    outputs: Mapping[str, Expression]


def blocks(program: Program, prefix: str = "v") -> tuple[Block, ...]:
    """Expressions of a program, joint by joint.

    A value stands where it is used. It has a name, v1, v2 ..., where it is used more than once, or
    where the expression would be too long. The operations and their order are the program's.

    >>> v = [Value(k) for k in range(4)]
    >>> lines = (Line("divide", (v[0], 0.02)), Line("tanh", (v[1],)), Line("multiply", (0.1, v[2])))
    >>> blocks(Program(("w_1",), lines, {"Tf": (v[3],)}))[0].outputs["Tf"].operation
    'multiply'
    """
    writer = _Writer(program, prefix)
    count = max((len(own) for own in program.outputs.values()), default=0)
    return tuple(writer.block(j) for j in range(count))


class _Writer:
    """Expressions of the values of a program, made once each, in the order of their need."""

    def __init__(self, program: Program, prefix: str) -> None:
        self.program, self.prefix = program, prefix
        self.known: dict[int, Expression] = dict(enumerate(program.inputs))
        self.size = dict.fromkeys(self.known, 0)
        uses = [v for line in program.lines for v in line.operands]
        uses += [v for own in program.outputs.values() for v in own]
        self.uses = Counter(v.number for v in uses if isinstance(v, Value))
        ends = {v for own in program.outputs.values() for v in own}
        self.ends = {v.number for v in ends if isinstance(v, Value) and self.uses[v.number] == 1}
        self.new: list[Statement] = []
        self.named = 0

    def block(self, joint: int) -> Block:
        """The block of a joint; what earlier joints have named is known."""
        outputs = {}
        for name, own in self.program.outputs.items():
            self._make(own[joint])
            outputs[name] = _number(self._operand(own[joint]), self._is_truth(own[joint]))
        statements, self.new = tuple(self.new), []
        return Block(statements, outputs)

    def _line(self, number: int) -> Line:
        return self.program.lines[number - len(self.program.inputs)]

    def _is_truth(self, operand: Operand) -> bool:
        return (
            isinstance(operand, Value)
            and operand.number >= len(self.program.inputs)
            and self._line(operand.number).operation in TRUTHS
        )

    def _operand(self, operand: Operand) -> Expression:
        return self.known[operand.number] if isinstance(operand, Value) else operand

    def _make(self, target: Operand) -> None:
        """The expression of a value, and of all that it needs, without recursion."""
        todo = [target.number] if isinstance(target, Value) else []
        while todo:
            number = todo[-1]
            if number in self.known:
                todo.pop()
                continue
            needs = [v.number for v in self._line(number).operands if isinstance(v, Value)]
            if missing := [need for need in needs if need not in self.known]:
                todo += reversed(missing)
                continue
            self._add(todo.pop(), needs)

    def _add(self, number: int, needs: list[int]) -> None:
        line = self._line(number)
        truths = [self._is_truth(v) for v in line.operands]
        operands = tuple(map(self._operand, line.operands))
        expression = _node(line.operation, operands, truths)
        self.size[number] = 1 + sum(self.size[need] for need in needs)
        is_long = self.size[number] >= _LONGEST and number not in self.ends
        if self.uses[number] > 1 or is_long:
            self.named += 1
            name = f"{self.prefix}{self.named}"
            self.new.append(Statement(name, expression, line.operation in TRUTHS))
            expression, self.size[number] = name, 0
        self.known[number] = expression


def _node(operation: str, operands: tuple[Expression, ...], truths: list[bool]) -> Expression:
    """An operation with operands of the kind that it takes, and without needless signs."""
    wants = [operation in _OF_TRUTHS or (operation == "select" and k == 0) for k in range(3)]
    own = tuple(
        _truth(v, truth) if want else _number(v, truth)
        for v, truth, want in zip(operands, truths, wants, strict=False)
    )
    last = own[-1]
    if operation in ("add", "subtract") and isinstance(last, float) and last < 0:
        return Node("subtract" if operation == "add" else "add", (own[0], -last))
    if operation == "multiply" and -1.0 in own:
        return Node("negative", (own[1] if own[0] == -1.0 else own[0],))
    return Node(operation, own)


def _truth(expression: Expression, is_truth: bool) -> Expression:
    return expression if is_truth else Node("truth", (expression,))


def _number(expression: Expression, is_truth: bool) -> Expression:
    return Node("number", (expression,)) if is_truth else expression


def names(code: tuple[Block, ...]) -> set[str]:
    """Names that expressions of these blocks read."""

    def read(expression: Expression) -> Iterator[str]:
        if isinstance(expression, str):
            yield expression
        elif isinstance(expression, Node):
            for operand in expression.operands:
                yield from read(operand)

    own = [s.expression for block in code for s in block.statements]
    own += [v for block in code for v in block.outputs.values()]
    return {name for expression in own for name in read(expression)}


class Form(NamedTuple):
    """How a language writes an operation.

    text : with {} for each operand
    level : how tightly it binds, as ADDED, MULTIPLIED ...
    needs : how tightly each operand must bind not to stand in brackets
    """

    text: str
    level: int
    needs: tuple[int, ...]


ANY, CHOSEN, EITHER, BOTH, EQUAL, COMPARED, ADDED, NEGATED, MULTIPLIED, POWER, CALLED = range(11)


def infix(symbol: str, level: int) -> Form:
    """Form of an operation between two operands; those of the same level stand in brackets."""
    left = {ADDED: ADDED, MULTIPLIED: NEGATED}.get(level, level + 1)
    right = MULTIPLIED if level == ADDED else level + 1
    return Form(f"{{}} {symbol} {{}}", level, (left, right))


def call(name: str, operands: int = 1) -> Form:
    """Form of a function."""
    return Form(f"{name}({', '.join(['{}'] * operands)})", CALLED, (ANY,) * operands)


SUMS = {
    "add": infix("+", ADDED),
    "subtract": infix("-", ADDED),
    "multiply": infix("*", MULTIPLIED),
    "divide": infix("/", MULTIPLIED),
    "negative": Form("-{}", NEGATED, (MULTIPLIED,)),
}


def text(
    expression: Expression,
    forms: Mapping[str, Form],
    number: Callable[[float], str],
    places: Mapping[str, str] | None = None,
) -> str:
    """Text of an expression in a language; `places` has what stands for a name, such as "w[0]".

    >>> half = Node("multiply", (0.5, Node("subtract", ("a", Node("add", ("b", 1.0))))))
    >>> text(half, SUMS, repr)
    '0.5 * (a - (b + 1.0))'
    """

    def written(own: Expression, need: int) -> str:
        if isinstance(own, str):
            return (places or {}).get(own, own)
        if isinstance(own, Node):
            form = forms[own.operation]
            parts = map(written, own.operands, form.needs)
            level, made = form.level, form.text.format(*parts)
        else:
            level, made = CALLED if own >= 0 else NEGATED, number(own)
        return f"({made})" if level < need else made

    return written(expression, ANY)


def folded(line: str, indent: str = "    ") -> str:
    """A line of code, folded at spaces where it is too long."""
    return textwrap.fill(
        line,
        WIDTH,
        initial_indent=indent,
        subsequent_indent=indent + "    ",
        break_long_words=False,
        break_on_hyphens=False,
    )


class Element(NamedTuple):
    """One number of an argument: entry `entry` of joint `joint`, both from 0."""

    argument: str
    joint: int = 0
    entry: int = 0


class Function(NamedTuple):
    """A function of arrays with an entry for each joint.

    arguments : "q", "w", "u", "load", "memory" (entries, each of all joints) and "dt"
    says : what it gives
    """

    name: str
    arguments: tuple[str, ...]
    program: Program
    says: str

    @property
    def code(self) -> tuple[Block, ...]:
        """Its expressions, joint by joint."""
        return blocks(self.program)

    def read(self, code: tuple[Block, ...]) -> dict[str, Element]:
        """Where the inputs that the code reads stand in the arguments, by their names in it."""
        own = names(code)
        return {name: element_of(name) for name in self.program.inputs if name in own}


def element_of(name: str) -> Element:
    """Where an input or output of a program stands.

    >>> element_of("w_2"), element_of("memory_3_1")
    (Element(argument='w', joint=1, entry=0), Element(argument='memory', joint=0, entry=2))
    """
    group, _, joint = name.rpartition("_")
    if group.startswith("memory_"):
        return Element("memory", int(joint) - 1, int(group.removeprefix("memory_")) - 1)
    return Element(group, int(joint) - 1)


def signatures(own: ExportedFriction) -> str:
    """Calls of the functions, as in "torque(w, memory)", for people."""
    made = functions(own)
    names = {"start": "memory = ", "advance": "memory = ", "torque": "Tf = "}
    return "; ".join(f"{names[f.name]}{f.name}({', '.join(f.arguments)})" for f in made)


def functions(own: ExportedFriction) -> tuple[Function, ...]:
    """Functions of a friction; those of a static law have no memory."""
    programs = own.programs
    x, time = programs.inputs, own.law.sample_time
    torque = "Friction torques Tf, one for each joint."
    if not programs.memory:
        return (Function("torque", x, programs.torque, torque),)
    when = "each step" if time is None else f"each {time:g} s"
    return (
        Function("start", x, programs.start, "Memory at the start of a motion."),
        Function("torque", (*x, "memory"), programs.torque, torque),
        Function(
            "advance",
            (*x, "memory", "dt"),
            programs.advance,
            f"Memory after dt [s], at the inputs after it; to be called {when}.",
        ),
    )
