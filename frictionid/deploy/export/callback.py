"""Friction as a passive force of MuJoCo: a Python module for laws that no element of MJCF holds."""

from dataclasses import replace

from frictionid.errors import InputError

from .exported import ExportedFriction, ExportSettings
from .expressions import rendered
from .formats import python
from .nearest import break_away


def callback(model: ExportedFriction, settings: ExportSettings) -> tuple[bytes, str]:
    """The module, b"" where there is none, and a sentence that says what it does.

    Memory advances with each step of the engine, or once a sample where the law says so.
    """
    law = model.friction.law.sharpened()
    sharp = replace(model, friction=replace(model.friction, law=law))
    try:
        inputs, has_memory = sharp.programs.inputs, bool(sharp.programs.memory)
    except InputError as error:
        return b"", f"no callback: {error}"
    if "load" in inputs:
        return b"", "no callback: MuJoCo gives no passive force the load in the bearings"
    time = model.law.sample_time
    context = {
        "levels": [float(v) for v in break_away(model.friction)],
        "inputs": ", ".join(f'x["{name}"]' for name in inputs),
        "has_memory": has_memory,
        "when": "> 0.0" if time is None else f">= {time * (1 - 1e-6)!r}",
        "follows": not has_memory and set(inputs) - {"w"},
    }
    code = rendered("callback.py.j2", model, python.LANGUAGE, context)
    sentence = (
        "the callback beside the MJCF computes the model's own torque of sliding joints, with "
        "frictionloss at the break-away level: mujoco.set_mjcb_passive(Friction(model))"
    )
    return python.write(sharp, settings).files[".py"] + code, sentence
