"""Friction as LaTeX: its equation with the numbers of each joint, and a table of parameters."""

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from frictionid.deploy.export import expressions as ex
from frictionid.errors import InputError
from frictionid.fitting.fit import estimates_of

from ..exported import ExportedFriction, ExportSettings, Written

_CLOSED = {"sqrt": r"\sqrt{{{}}}", "absolute": r"\left|{}\right|", "number": r"\left[{}\right]"}
_NAMES = {
    **{name: rf"\{name}" for name in ("exp", "tanh", "arctan", "sin", "cos")},
    "sign": r"\operatorname{{sgn}}",
    "log": r"\ln",
}
_SYNTAX: dict[str, str | ex.Form] = {
    **_CLOSED,
    **{operation: rf"{name}\left({{}}\right)" for operation, name in _NAMES.items()},
    **{name: rf"\{name[:3]}\left({{}}, {{}}\right)" for name in ("maximum", "minimum")},
    "multiply": r"\,",
    "divide": ex.Form(r"\frac{{{}}}{{{}}}", ex.MULTIPLIED, (ex.ANY, ex.ANY)),
    "power": ex.Form("{}^{{{}}}", ex.POWER, (ex.CALLED, ex.ANY)),
    "log1p": ex.Form(r"\ln\left(1 + {}\right)", ex.CALLED, (ex.MULTIPLIED,)),
    "less_equal": r"\le",
    "equal": "=",
    "and": r"\wedge",
    "or": r"\vee",
    "not": ex.Form(r"\neg {}", ex.CALLED, (ex.CALLED,)),
    "select": r"\begin{{cases}}{1} & {0}\\ {2} & \text{{else}}\end{{cases}}",
    "truth": ex.Form(r"{} \ne 0", ex.EQUAL, (ex.COMPARED,)),
}
_SYMBOLS = {"q": "q", "w": r"\omega", "u": "u", "load": "N", "dt": r"\Delta t", "Tf": "T"}


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    r"""Equations in `aligned`, and a table of booktabs, to be read by \input.

    Raises
    ------
    InputError
        For networks, whose thousands of numbers are no equation.
    """
    if model.law.is_network:
        raise InputError(
            f"{type(model.law).__name__} is a network: it has no equation to be read; "
            "export it to onnx, torchscript or c, or as a table (yaml)"
        )
    plain = replace(model, friction=replace(model.friction, law=model.law), speeds=())
    functions = [f for f in ex.functions(plain) if f.name != "start"]
    joints, friction = range(len(model.joints)), model.friction
    estimates = (e for e in estimates_of(friction) if e.block == "friction")
    noise_alone = friction.provenance.noise_alone
    context = {
        "escaped": _escaped,
        "number": _number,
        "equations": [[line for f in functions for line in _lines(f, j)] for j in joints],
        "parameters": [model.parameters(j) for j in joints],
        "interval": "interval of the noise alone" if noise_alone else r"95\,\% interval",
        "intervals": {
            (e.joint, e.parameter): e.interval_95 for e in estimates if np.isfinite(e.error)
        },
    }
    text = ex.rendered("equations.tex.j2", model, settings, context)
    note = rf"\input{{{settings.stem}}}, with amsmath and booktabs"
    return Written({".tex": text}, notes=(note,))


def _lines(function: ex.Function, joint: int) -> Iterator[str]:
    """Equations of a joint: what has a name, then the torque or the memory."""
    code = function.blocks("v" if function.name == "torque" else "s")
    statements = [name for block in code for name, _, kind in block if kind != "output"]
    places = {x: _symbol(x) for x in function.program.inputs}
    places |= {name: f"{name[0]}_{{{name[1:]}}}" for name in statements}
    for target, text, _ in LANGUAGE.lines(code[joint], joint, places):
        prime = "'" if target.startswith("memory") else ""
        yield f"{places.get(target) or _symbol(target)}{prime} &= {text}"


def _symbol(name: str) -> str:
    """Symbol of an input or output, whose joint the heading names."""
    group, entry, *_ = name.split("_")
    return f"z_{{{entry}}}" if group == "memory" else _SYMBOLS[group]


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


LANGUAGE = ex.Language(ex.forms(_SYNTAX), _number)


def _escaped(text: str) -> str:
    return re.sub(r"([&%$#_{}])", r"\\\1", re.sub(r"[\\~^]", " ", text))
