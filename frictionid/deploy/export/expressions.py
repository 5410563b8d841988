"""Programs as a person would write them: expressions, with names for what is used more than once.

All languages with infix operators are written from here: C, structured text, Python and LaTeX
differ in their `Form` of each operation, in how they write numbers, and in their templates.
"""

import operator
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from frictionid.programs.program import OPERATIONS, Line, Operand, Program, Value

from .exported import ExportedFriction, ExportSettings

TRUTHS = ("less", "less_equal", "equal", "and", "or", "not")  # operations that give true or false
_OPERATORS: Mapping[str, Callable[..., Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "power": operator.pow,
    "negative": operator.neg,
    "less": operator.lt,
    "less_equal": operator.le,
}
_LONGEST = 30  # operations of an expression
WIDTH = 100


def operations(library: Any, names: Mapping[str, str]) -> dict[str, Callable[..., Any]]:
    """All operations on values of a library: Python's operators, and functions of the library.

    names : of functions that are called otherwise than the operation
    """
    functions = {x: getattr(library, names.get(x, x)) for x in OPERATIONS if x not in _OPERATORS}
    return {**_OPERATORS, **functions}


class Node(NamedTuple):
    """An operation on expressions.

    Beside those of programs there are `number`, 1 or 0 of a truth, and `truth`, of a number.
    """

    operation: str
    operands: "tuple[Expression, ...]"


Expression = Node | str | float  # a name, or a constant


# What is computed for one joint: named values, then its entry of each output. Name, expression, and
# what that gives: "number" or "truth", or that it is an "output".
Block = Sequence[tuple[str, Expression, str]]


class _Writer:
    """Expressions of the values of a program, made once each, in the order of their need."""

    def __init__(self, program: Program, prefix: str) -> None:
        self.program, self.prefix = program, prefix
        self.expressions: dict[int, Expression] = dict(enumerate(program.inputs))
        self.size = dict.fromkeys(self.expressions, 0)
        self.uses = Counter(v.number for v in program.operands() if isinstance(v, Value))
        ends = {v for output in program.outputs.values() for v in output if isinstance(v, Value)}
        self.ends = {v.number for v in ends if self.uses[v.number] == 1}
        self.statements: list[tuple[str, Expression, str]] = []
        self.named = 0

    def block(self, joint: int) -> Block:
        """The block of a joint; what earlier joints have named has its name."""
        outputs = []
        for name, values in self.program.outputs.items():
            self._make(values[joint])
            outputs.append((name, self._operand(values[joint], is_truth=False), "output"))
        statements, self.statements = self.statements, []
        return [*statements, *outputs]

    def _line(self, number: int) -> Line:
        return self.program.lines[number - len(self.program.inputs)]

    def _operand(self, operand: Operand, *, is_truth: bool) -> Expression:
        """An operand as a truth, or as a number."""
        if not isinstance(operand, Value):
            return Node("truth", (operand,)) if is_truth else operand
        expression, number = self.expressions[operand.number], operand.number
        gives_truth = number >= len(self.program.inputs) and self._line(number).operation in TRUTHS
        if gives_truth == is_truth:
            return expression
        return Node("truth" if is_truth else "number", (expression,))

    def _make(self, target: Operand) -> None:
        """The expression of a value, and of all that it needs, without recursion."""
        todo = [target.number] if isinstance(target, Value) else []
        while todo:
            number = todo[-1]
            if number in self.expressions:
                todo.pop()
                continue
            needs = [v.number for v in self._line(number).operands if isinstance(v, Value)]
            if missing := [need for need in needs if need not in self.expressions]:
                todo += reversed(missing)
                continue
            self._add(todo.pop(), needs)

    def _add(self, number: int, needs: list[int]) -> None:
        operation, values = self._line(number)
        expression = _without_signs(
            operation,
            tuple(
                self._operand(v, is_truth=takes_truth(operation, k)) for k, v in enumerate(values)
            ),
        )
        self.size[number] = 1 + sum(self.size[need] for need in needs)
        is_long = self.size[number] >= _LONGEST and number not in self.ends
        if self.uses[number] > 1 or is_long:
            self.named += 1
            name = f"{self.prefix}{self.named}"
            kind = "truth" if operation in TRUTHS else "number"
            self.statements.append((name, expression, kind))
            expression, self.size[number] = name, 0
        self.expressions[number] = expression


def takes_truth(operation: str, k: int) -> bool:
    """Whether operand k, from 0, of an operation is true or false."""
    return operation in ("and", "or", "not") or (operation == "select" and k == 0)


def _without_signs(operation: str, parts: tuple[Expression, ...]) -> Expression:
    """An operation, without needless signs."""
    last = parts[-1]
    if operation in ("add", "subtract") and isinstance(last, float) and last < 0:
        return Node("subtract" if operation == "add" else "add", (parts[0], -last))
    if operation == "multiply" and -1.0 in parts:
        return Node("negative", (parts[1] if parts[0] == -1.0 else parts[0],))
    return Node(operation, parts)


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
_LEVELS = {
    "or": EITHER,
    "and": BOTH,
    "equal": EQUAL,
    "less": COMPARED,
    "less_equal": COMPARED,
    "add": ADDED,
    "subtract": ADDED,
    "multiply": MULTIPLIED,
    "divide": MULTIPLIED,
    "power": POWER,
}
_OF_TWO = ("maximum", "minimum", "power")  # functions of two operands
_USUAL = {
    "add": "+",
    "subtract": "-",
    "multiply": "*",
    "divide": "/",
    "less": "<",
    "less_equal": "<=",
    "equal": "==",
}


def forms(syntax: Mapping[str, str | Form]) -> dict[str, Form]:
    """Forms of all operations of a language, from what is special in it.

    A text that ends in a bracket is a function, one with {} holds its operands together; any other
    stands between two operands, of which those of the same level stand in brackets.

    >>> forms({"exp": "EXP("})["exp"].text, forms({"or": "||"})["or"].text
    ('EXP({})', '{} || {}')
    """
    negative = Form("-{}", NEGATED, (MULTIPLIED,))
    return {"negative": negative} | {k: _form(k, v) for k, v in {**_USUAL, **syntax}.items()}


def _form(operation: str, text: str | Form) -> Form:
    if isinstance(text, Form):
        return text
    if "{" in text:
        return Form(text, CALLED, (ANY,) * 3)
    if text.endswith("("):
        return Form(
            f"{text}{{}}, {{}})" if operation in _OF_TWO else f"{text}{{}})", CALLED, (ANY,) * 2
        )
    level = _LEVELS[operation]
    left = {ADDED: ADDED, MULTIPLIED: NEGATED}.get(level, level + 1)
    return Form(f"{{}} {text} {{}}", level, (left, MULTIPLIED if level == ADDED else level + 1))


class Language(NamedTuple):
    """How a language writes expressions.

    forms : of each operation
    number : text of a constant
    memory : place of an entry of the memory, with {} for entry and joint
    first : number of the first entry of an array
    """

    forms: Mapping[str, Form]
    number: Callable[[float], str]
    memory: str = "memory[{}][{}]"
    first: int = 0

    def text(self, expression: Expression, places: Mapping[str, str] | None = None) -> str:
        """Text of an expression; `places` has what stands for a name, such as "w[0]".

        >>> half = Node("multiply", (0.5, Node("subtract", ("a", Node("add", ("b", 1.0))))))
        >>> Language(forms({}), repr).text(half)
        '0.5 * (a - (b + 1.0))'
        """
        return self._within(expression, ANY, places or {})

    def _within(self, expression: Expression, need: int, places: Mapping[str, str]) -> str:
        if isinstance(expression, str):
            return places.get(expression, expression)
        if isinstance(expression, Node):
            text, level, needs = self.forms[expression.operation]
            pairs = zip(expression.operands, needs, strict=False)
            text = text.format(*(self._within(v, least, places) for v, least in pairs))
        else:
            level, text = CALLED if expression >= 0 else NEGATED, self.number(expression)
        return f"({text})" if level < need else text

    def place(self, name: str) -> str:
        """Where an input or output of a program stands.

        >>> language = Language({}, repr)
        >>> language.place("w_2"), language.place("memory_3_1")
        ('w[1]', 'memory[2][0]')
        """
        if name == "dt_1":
            return "dt"
        group, *entries = name.split("_")
        at = [int(x) - 1 + self.first for x in entries]
        return self.memory.format(*at) if group == "memory" else f"{group}[{at[0]}]"

    def lines(
        self, block: Block, joint: int, places: Mapping[str, str] | None = None
    ) -> Iterator[tuple[str, str, str]]:
        """Target, text and kind of what is computed for a joint, from 0.

        The target of an output is its name in the program.
        """
        for name, expression, kind in block:
            target = f"{name}_{joint + 1}" if kind == "output" else name
            yield target, self.text(expression, places), kind


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


class Function(NamedTuple):
    """A function of arrays with an entry for each joint.

    arguments : "q", "w", "u", "load", "memory" (entries, each of all joints) and "dt"
    says : what it gives
    """

    name: str
    arguments: tuple[str, ...]
    program: Program
    says: str

    def blocks(self, prefix: str = "v") -> tuple[Block, ...]:
        """What is computed for each joint.

        A value stands where it is used. It has a name, v1, v2 ..., where it is used more than once,
        or where the expression would be too long. The operations and their order are the program's.

        >>> v = [Value(k) for k in range(3)]
        >>> lines = (Line("divide", (v[0], 0.02)), Line("tanh", (v[1],)))
        >>> program = Program(("w_1",), lines, {"Tf": (v[2],)})
        >>> Function("torque", ("w",), program, "").blocks()[0][-1][1].operation
        'tanh'
        """
        writer = _Writer(self.program, prefix)
        count = max(map(len, self.program.outputs.values()), default=0)
        return tuple(writer.block(j) for j in range(count))

    def places(self, language: Language) -> dict[str, str]:
        """Where the inputs stand, by their names in the program."""
        return {name: language.place(name) for name in self.program.inputs}


def functions(model: ExportedFriction) -> tuple[Function, ...]:
    """Functions of a friction; those of a static law have no memory."""
    programs = model.programs
    x, time = programs.inputs, model.law.sample_time
    torque = "Friction torques Tf, one for each joint."
    if not programs.memory:
        return (Function("torque", x, programs.torque, torque),)
    when = "each step" if time is None else f"each {time:g} s"
    advance = f"Memory after dt [s], at the inputs after it; to be called {when}."
    return (
        Function("start", x, programs.start, "Memory at the start of a motion."),
        Function("torque", (*x, "memory"), programs.torque, torque),
        Function("advance", (*x, "memory", "dt"), programs.advance, advance),
    )


def rendered(
    template: str, model: ExportedFriction, settings: ExportSettings, context: Mapping[str, Any]
) -> bytes:
    """Text of a template of this room, which knows the friction and the settings."""
    from frictionid.report.tables import environment

    filters = (("folded", folded), ("repr", repr))
    templates = environment("frictionid.deploy.export", filters=filters)
    names = {"model": model, "n": len(model.joints), "real": settings.precision}
    names |= {**vars(settings), **context}
    return templates.get_template(template).render(names).encode()
