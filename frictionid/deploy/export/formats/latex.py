"""Friction as LaTeX: its equation with the numbers of each joint, and a table of parameters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.expressions import Function, element_of, functions
from frictionid.errors import InputError
from frictionid.fitting.fit import estimates_of

_COMMANDS = ("exp", "tanh", "arctan", "sin", "cos")
FORMS: Mapping[str, ex.Form] = {
    **ex.SUMS,
    "multiply": ex.infix(r"\,", ex.MULTIPLIED),
    "divide": ex.Form(r"\frac{{{}}}{{{}}}", ex.MULTIPLIED, (ex.ANY, ex.ANY)),
    "power": ex.Form("{}^{{{}}}", ex.POWER, (ex.CALLED, ex.ANY)),
    "absolute": ex.Form(r"\left|{}\right|", ex.CALLED, (ex.ANY,)),
    "sqrt": ex.Form(r"\sqrt{{{}}}", ex.CALLED, (ex.ANY,)),
    "sign": ex.Form(r"\operatorname{{sgn}}\left({}\right)", ex.CALLED, (ex.ANY,)),
    "log": ex.Form(r"\ln\left({}\right)", ex.CALLED, (ex.ANY,)),
    "log1p": ex.Form(r"\ln\left(1 + {}\right)", ex.CALLED, (ex.MULTIPLIED,)),
    **{name: ex.Form(rf"\{name}\left({{}}\right)", ex.CALLED, (ex.ANY,)) for name in _COMMANDS},
    "maximum": ex.Form(r"\max\left({}, {}\right)", ex.CALLED, (ex.ANY, ex.ANY)),
    "minimum": ex.Form(r"\min\left({}, {}\right)", ex.CALLED, (ex.ANY, ex.ANY)),
    "less": ex.infix("<", ex.COMPARED),
    "less_equal": ex.infix(r"\le", ex.COMPARED),
    "equal": ex.infix("=", ex.EQUAL),
    "and": ex.infix(r"\wedge", ex.BOTH),
    "or": ex.infix(r"\vee", ex.EITHER),
    "not": ex.Form(r"\neg {}", ex.CALLED, (ex.CALLED,)),
    "select": ex.Form(
        r"\begin{{cases}}{1} & {0}\\ {2} & \text{{else}}\end{{cases}}", ex.CALLED, (ex.ANY,) * 3
    ),
    "number": ex.Form(r"\left[{}\right]", ex.CALLED, (ex.ANY,)),
    "truth": ex.Form(r"{} \ne 0", ex.EQUAL, (ex.COMPARED,)),
}
_SYMBOLS = {"q": "q", "w": r"\omega", "u": "u", "load": "N", "memory": "z", "Tf": "T"}


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    r"""Equations in `aligned`, and a table of booktabs, to be read by \input.

    Raises
    ------
    InputError
        For networks, whose thousands of numbers are no equation.
    """
    if own.law.is_network:
        raise InputError(
            f"{type(own.law).__name__} is a network: it has no equation to be read; "
            "export it to onnx, torchscript or c, or as a table (yaml)"
        )
    plain = replace(own, friction=replace(own.friction, law=own.law), speeds=())
    facts = (settings.name, *own.facts, "Needs amsmath and booktabs.")
    parts = ["\n".join(f"% {line}" for line in facts)]
    for j, (name, unit) in enumerate(zip(own.joints, own.units, strict=True)):
        made = [f for f in functions(plain) if f.name != "start"]
        body = " \\\\\n".join(f"  {line}" for f in made for line in _lines(f, j))
        torque = "N\\,m" if unit == "rad" else "N"
        says = rf"\paragraph{{{_escaped(name)}}} $\omega$ in {unit}/s, $T$ in {torque}:"
        parts.append(f"{says}\n\\begin{{align*}}\n{body}\n\\end{{align*}}")
    note = rf"\input{{{settings.stem}}}, with amsmath and booktabs"
    return Written({".tex": ("\n".join([*parts, _table(own)]) + "\n").encode()}, notes=(note,))


def _lines(function: Function, joint: int) -> list[str]:
    """Equations of a joint: what has a name, then the torque or the memory."""
    code = ex.blocks(function.program, "v" if function.name == "torque" else "s")
    statements = [s.name for block in code for s in block.statements]
    places = {x: _symbol(x) for x in function.program.inputs}
    places |= {name: f"{name[0]}_{{{name[1:]}}}" for name in statements}
    lines = [
        f"{places[s.name]} &= {ex.text(s.expression, FORMS, _number, places)}"
        for s in code[joint].statements
    ]
    for output, value in code[joint].outputs.items():
        prime = "" if output == "Tf" else "'"
        target = _symbol(f"{output}_{joint + 1}") + prime
        lines.append(f"{target} &= {ex.text(value, FORMS, _number, places)}")
    return lines


def _symbol(name: str) -> str:
    """Symbol of an input or output, whose joint the heading names."""
    element = element_of(name)
    if element.argument == "dt":
        return r"\Delta t"
    below = f"_{{{element.entry + 1}}}" if element.argument == "memory" else ""
    return _SYMBOLS[element.argument] + below


def _number(value: float) -> str:
    """A number with four digits.

    >>> _number(0.0123456), _number(1e-12)
    ('0.01235', '10^{-12}')
    """
    mantissa, e, exponent = f"{value:.4g}".partition("e")
    if not e:
        return mantissa
    power = f"10^{{{int(exponent)}}}"
    return power if mantissa == "1" else rf"{mantissa} \cdot {power}"


def _table(own: ExportedFriction) -> str:
    """Parameters of each joint, with 95 % intervals where the model has them."""
    ends, rows = _intervals(own), []
    has = own.law.has_parameters(own.friction.n)
    for j, name in enumerate(own.joints):
        rows.append(r"\midrule")
        named = zip(own.law.names, own.friction.units_at(j), own.friction.theta[j], strict=True)
        for i, (parameter, unit, value) in enumerate(named):
            if has[j, i]:
                end = ends.get((j, parameter))
                shown = "" if end is None else rf"$[{_number(end[0])}, {_number(end[1])}]$"
                cells = (_escaped(name), _escaped(parameter), f"${_number(value)}$", shown, unit)
                rows.append(" & ".join(cells) + r" \\")
    alone = own.friction.provenance.noise_alone
    what = "interval of the noise alone" if alone else r"95\,\% interval"
    head = rf"joint & parameter & value & {what} & unit \\"
    lines = [r"\begin{tabular}{llrll}", r"\toprule", head, *rows, r"\bottomrule"]
    return "\n".join([*lines, r"\end{tabular}"])


def _intervals(own: ExportedFriction) -> dict[tuple[int | None, str], tuple[float, float]]:
    """Ends of 95 % intervals by joint and parameter: of shooting, or of the noise of a fit."""
    entries = (e for e in estimates_of(own.friction) if e.block == "friction")
    return {(e.joint, e.parameter): e.interval_95 for e in entries if np.isfinite(e.error)}


def _escaped(text: str) -> str:
    return re.sub(r"([&%$#_{}])", r"\\\1", re.sub(r"[\\~^]", " ", text))
