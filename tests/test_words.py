"""Words: public names and messages use the field's terms, none that was retired.

Right of each retired word stands what the field says. Words that are ordinary English as well are
retired as names only.
"""

import ast
import re

from fixtures.mistakes import mistakes, rows
from fixtures.paths import ROOT
from fixtures.source import docstring_of, nodes_of, tree_of

PACKAGE = ROOT / "frictionid"
# Nowhere in a name.
WORDS = dict(
    rows("""
bent     => bristle state
cautions => warnings
contest  => benchmark
course   => trajectory
dip      => Stribeck factor
doubts   => warnings
faced    => prepared for
grip     => stiction
ground   => prepared data
hats     => hat basis
lamp     => sync LED
lane     => study
lessons  => training set
marks    => markers
matter   => summary data
observer => state estimator
pace     => step size
practice => synthetic
remarks  => text
sided    => by direction
spot     => blob
stride   => adaptive step
stuck    => frozen torque
supports => active sets
told     => nominal
""")
)
# Not as a whole name: in a longer one they are ordinary English, as in `at_rest`.
WHOLE = dict(
    rows("""
alone  => partial regression
rest   => velocity threshold
starts => initial states
sure   => number of standard errors
way    => method
why    => memory analysis
""")
)
MESSAGES = ("at the door", "contest", "doubts", "faced", "grip", "hats", "lane", "lessons", "told")
ALLOWED = {
    "ground_truth",
    "momentum_observer",
    "MomentumObserver",
}  # terms of the field that hold a retired word


def words(name):
    """Words of a name in snake or camel case.

    >>> sorted(words("HatsOf_ground"))
    ['ground', 'hats', 'of']
    """
    for term in ALLOWED:
        name = name.replace(term, "")
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)}


def public_names(path):
    """Line and name of what others can use: the module, classes, functions, arguments, fields."""
    yield 1, path.parent.name if path.stem == "__init__" else path.stem
    yield from _public(tree_of(path).body)


def _public(body):
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield node.lineno, node.name
            yield from _public(node.body)
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield node.lineno, node.name
            arguments = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
            yield from ((argument.lineno, argument.arg) for argument in arguments)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.lineno, node.target.id


def messages(path):
    """Line and text of every string that is no docstring."""
    nodes = nodes_of(path)
    documented = {id(text.value) for text in map(docstring_of, nodes) if text}
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) not in documented and " " in node.value.strip():
                yield node.lineno, node.value


def retired(path):
    """Retired words in the public names and the messages of a file."""
    found = [
        f"{path.name}:{line}: {name}: the field says {(WORDS | WHOLE)[word]!r}"
        for line, name in public_names(path)
        for word in sorted(words(name) & WORDS.keys() | {name} & WHOLE.keys())
    ]
    for line, text in messages(path):
        for word in MESSAGES:
            if re.search(rf"\b{word}\b", text):
                found.append(f"{path.name}:{line}: the message {text!r} says {word!r}")
    return found


def test_no_retired_word_is_left():
    assert [line for path in sorted(PACKAGE.rglob("*.py")) for line in retired(path)] == []


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "data/README.md"]
TEMPLATES = sorted(PACKAGE.rglob("*.j2"))


def test_no_page_says_a_retired_word():
    said = rf"\b({'|'.join(MESSAGES)})\b"
    assert [path for path in (*PAGES, *TEMPLATES) if re.search(said, path.read_text())] == []


PLANTED = r"""
hats.py: # new                                    => hats
a.py: class ToldMachine:\n    pass                => ToldMachine
a.py: def ground_of():\n    pass                  => ground_of
a.py: def f(told):\n    pass                      => told
a.py: class A:\n    pace: int = 1                 => pace
a.py: class A:\n    rest: float = 0.2             => rest
a.py: raise ValueError(f'{1} as it was told')     => told
"""


@mistakes(PLANTED)
def test_a_planted_word_is_found(wrong, words, tmp_path):
    name, text = wrong.replace(r"\n", "\n").split(": ", 1)
    (tmp_path / name).write_text(text)
    assert any(words in line for line in retired(tmp_path / name))


def test_terms_of_the_field_are_no_retired_words(tmp_path):
    path = tmp_path / "ground_truth.py"
    path.write_text(
        '"""As it was told."""\n\n\ndef ground_truth_of(at_rest, standing):\n    pass\n'
    )
    assert retired(path) == []


# Words that say nothing of a thing, as names of variables, arguments, fields and functions.
PRONOUNS = {"own", "found", "known", "one", "given", "of", "some", "made", "more"}
KEYS = {("suite_recipes.py", "known")}  # names that files of users have


def pronouns(path):
    """Pronouns that a file binds or takes as names."""
    bound = []
    for node in nodes_of(path):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            bound.append((node.lineno, node.id))
        elif isinstance(node, ast.arg):
            bound.append((node.lineno, node.arg))
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            bound.append((node.lineno, node.name.strip("_")))
    return [
        f"{path.name}:{line}: {name}"
        for line, name in bound
        if name in PRONOUNS and (path.name, name) not in KEYS
    ]


def test_pronouns_are_found(tmp_path):
    path = tmp_path / "some.py"
    path.write_text("def own(given):\n    for one in given:\n        found = one\n")
    assert [line.split(": ")[1] for line in sorted(pronouns(path))] == [
        *("given", "own", "one", "found")
    ]


def test_names_are_nouns_of_the_thing():
    assert [line for path in sorted(PACKAGE.rglob("*.py")) for line in pronouns(path)] == []
