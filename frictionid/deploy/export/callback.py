"""Friction as a passive force of MuJoCo: a Python module for laws that no element of MJCF holds."""

from __future__ import annotations

from dataclasses import replace

from frictionid.deploy.export.exported import ExportedFriction, ExportSettings
from frictionid.deploy.export.formats import python
from frictionid.deploy.export.nearest import break_away
from frictionid.errors import InputError

_CLASS = '''
REST = 1e-4  # [rad/s]: slower joints have frictionloss alone
LEVELS = {levels}  # frictionloss [N m] where it is constant


class Friction:
    """Friction of a model's joints as a passive force.

    mujoco.set_mjcb_passive(Friction(model)): frictionloss is the break-away level, which holds a
    joint at rest; this adds what the law's torque differs by from frictionloss and damping, so that
    a sliding joint has the law's torque. The motor torque it follows is that of the step before.
    """

    def __init__(self, model):
        self.model, self.memory, self.time = model, None, None
        self.joints = [model.joint(name).id for name in JOINTS]
        self.dofs = [int(model.jnt_dofadr[j]) for j in self.joints]
        self.places = [int(model.jnt_qposadr[j]) for j in self.joints]
        model.dof_frictionloss[self.dofs] = LEVELS
        self.back_emf = [  # of the joint's motor, which counts as its torque
            sum(float(d) for d, t in zip(model.actuator_damping, model.actuator_trnid) if t[0] == j)
            for j in self.joints
        ]

    def __call__(self, model, data):
        x = dict(
            q=[float(v) for v in data.qpos[self.places]],
            w=[float(v) for v in data.qvel[self.dofs]],
            u=[float(v) for v in data.qfrc_actuator[self.dofs] + data.qfrc_applied[self.dofs]],
        )
        x["u"] = [u - k * w for u, k, w in zip(x["u"], self.back_emf, x["w"])]
{memory}        torques = torque({arguments})
        levels = [float(v) for v in model.dof_frictionloss[self.dofs]]
        for j, (dof, w) in enumerate(zip(self.dofs, x["w"])):
            if abs(w) > REST:
                held = levels[j] * (1.0 if w > 0.0 else -1.0) + float(model.dof_damping[dof]) * w
                data.qfrc_passive[dof] -= torques[j] - held
{levels_now}'''

_MEMORY = """        if self.time is None or data.time < self.time:
            self.memory, self.time = start({inputs}), data.time
        elif data.time - self.time {when}:
            self.memory = advance({inputs}, self.memory, data.time - self.time)
            self.time = data.time
"""

# of a law that follows q or u: the level at this place, of the direction with less
_NOW = """        both = [dict(x, w=[side * REST] * len(self.dofs)) for side in (1.0, -1.0)]
        ahead, back = (torque({both}) for y in both)
        model.dof_frictionloss[self.dofs] = [max(min(a, -b), 0.0) for a, b in zip(ahead, back)]
"""


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
    when = "> 0.0" if time is None else f">= {time * (1 - 1e-6)!r}"
    now, both = (", ".join(f'{x}["{name}"]' for name in inputs) for x in "xy")
    follows = not has_memory and set(inputs) - {"w"}
    code = _CLASS.format(
        levels=[float(v) for v in break_away(model.friction)],
        memory=_MEMORY.format(inputs=now, when=when) if has_memory else "",
        arguments=f"{now}, self.memory" if has_memory else now,
        levels_now=_NOW.format(both=both) if follows else "",
    )
    sentence = (
        "the callback beside the MJCF computes the model's own torque of sliding joints, with "
        "frictionloss at the break-away level: mujoco.set_mjcb_passive(Friction(model))"
    )
    return python.write(sharp, settings).files[".py"] + f"\n{code}".encode(), sentence
