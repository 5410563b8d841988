"""The acrobot of `frictionid.mechanics` as MuJoCo reads it, from the same physical parameters.

It moves in the x-y plane, gravity along -y, hinges along +z: q = 0 hangs down and counter-clockwise
is positive, as in frictionid. Friction is left to whoever fits it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

# MuJoCo's dry friction is a soft constraint: with its default solver parameters it reaches its
# full level only at some tenth of a rad/s and creeps below. These are the stiffest that there are;
# MuJoCo raises the time constant to two of its own steps.
STIFF = 'solreffriction="0.0001 1" solimpfriction="0.9999 0.9999"'

Part = tuple[float, float, float]


def mjcf(parameters: Mapping[str, float]) -> str:
    """MJCF text with joints "joint1" and "joint2", and a motor at joint 2.

    Parameters
    ----------
    parameters : mapping of str to float, SI
        Those of `frictionid.mechanics.built_in`, printed inertias.

    Raises
    ------
    ValueError
        For a rotor: the compared data have none.
    """
    v = {name: float(value) for name, value in parameters.items()}
    if v["rotor"]:
        raise ValueError(f"rotor = {v['rotor']:g} kg m^2: this model is for a motor without rotor")
    shaft = v["J_shaft"] + v["J_clamp"] + v["J_bush"] + v["J_link1"]
    link1 = _inertial([(v["m1"], v["L1"], shaft), (v["m2"], v["L2"], 0.0)])
    link2 = _inertial([(v["m3"], v["L3"], v["J2"]), (v["m4"], v["L4"], 0.0)])
    # RK4: smooth motion is exact to 4e-5 rad over a window with four steps a sample, where the
    # Euler-like integrators (default, implicit, implicitfast, discrete) are 4e-3 rad off.
    return f"""<mujoco>
  <compiler angle="radian"/>
  <option integrator="RK4" gravity="0 {-v["g"]!r} 0">
    <flag contact="disable"/>
  </option>
  <worldbody>
    <body name="link1">
      <joint name="joint1" axis="0 0 1" {STIFF}/>
      {link1}
      <body name="link2" pos="0 {-v["L2"]!r} 0">
        <joint name="joint2" axis="0 0 1" {STIFF}/>
        {link2}
      </body>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="joint2"/></actuator>
  <sensor>
    <jointpos name="q1" joint="joint1"/>
    <jointpos name="q2" joint="joint2"/>
  </sensor>
</mujoco>"""


def _inertial(parts: Sequence[Part]) -> str:
    """One body of parts (mass, distance from the joint, inertia about the own centre of mass)."""
    mass = sum(m for m, _, _ in parts)
    centre = sum(m * at for m, at, _ in parts) / mass
    inertia = sum(J + m * (at - centre) ** 2 for m, at, J in parts)
    # all three alike: only the one about z is seen, and no real body has one above the others' sum
    diagonal = f"{inertia!r} {inertia!r} {inertia!r}"
    return f'<inertial pos="0 {-centre!r} 0" mass="{mass!r}" diaginertia="{diagonal}"/>'
