"""A mechanism as MJCF, the format of MuJoCo: its links, joints, rotors and motors."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError

from .links_of_bodies import Links, links_of_bodies
from .mechanism import Mechanism
from .rigid_body.rigid_body_tree import RigidBodyTree
from .rigid_body.robot import matrix_of
from .symbolic import SymbolicMechanism

_LEAST = 1e-14  # [kg, kg m^2]: MuJoCo takes no link whose mass or inertia is below 1e-15
_SHARE = 1e-9  # of the inertia, by which rounding may make it one that no body has


def mjcf_of(
    mechanism: Mechanism, parameters: Mapping[str, float] | None = None, *, timestep: float = 0.001
) -> str:
    """MJCF of a mechanism without its friction: accelerations in MuJoCo are those of ours.

    Joints have the names, zeros and directions of the mechanism, and its order but for branches;
    motors take N m (or N) as `ctrl`. The plane of built-in mechanisms is the x-z plane, z upwards.
    An armature is what one joint's rotor adds there, gr^2 Ir. What turns with several joints, as a
    rotor on a moving link at w1 - gr w2, is the armature of a tendon, and couples them as in our M;
    MuJoCo has these since 3.3.1, other engines that read MJCF may drop them. What MJCF cannot hold:
    positions that are not measured against the link before, springs that are not linear, and
    inertias that no body has.

    Parameters
    ----------
    mechanism : Mechanism
    parameters : mapping of str to float, optional
        Physical parameters in place of the mechanism's own, SI.
    timestep : float
        Of MuJoCo's RK4 steps [s].

    Raises
    ------
    InputError
        For parameters that are missing or impossible, and for what MJCF cannot hold.

    Examples
    --------
    >>> from frictionid.mechanics import pendulum
    >>> print(mjcf_of(pendulum(mass=0.5, length=0.25, inertia=0.125)))
    <mujoco model="pendulum">
      <compiler angle="radian"/>
      <option timestep="0.001" integrator="RK4" gravity="0.0 0.0 -9.81"/>
      <worldbody>
        <body name="link 1" pos="0.0 0.0 0.0" quat="1.0 0.0 0.0 0.0">
          <joint name="joint 1" type="hinge" axis="0.0 -1.0 0.0" armature="0.0"/>
          <inertial pos="0.0 0.0 -0.25" mass="0.5" fullinertia="0.125 0.125 0.125 0.0 0.0 0.0"/>
        </body>
      </worldbody>
      <actuator>
        <motor name="joint 1" joint="joint 1"/>
      </actuator>
    </mujoco>
    """
    links = _links(mechanism, mechanism.nominal(parameters))
    tree = links.tree
    single = (np.abs(tree.rotors) > 0).sum(axis=1) == 1
    armature = (tree.rotors[single] ** 2 * links.rotors[single, None]).sum(axis=0)
    driven = [name for name, motor in zip(tree.joints, mechanism.driven, strict=True) if motor]
    context = {
        "kind": mechanism.kind,
        "timestep": timestep,
        "tree": tree,
        "links": links,
        "armature": armature,
        "coupled": np.flatnonzero(~single).tolist(),
        "driven": driven,
        "inertial": _inertial,
        "quaternion": _quaternion,
    }
    return _template().render(context)


@cache
def _template() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("frictionid.mechanics"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        autoescape=True,
    )
    environment.filters["numbers"] = _text
    return environment.get_template("mjcf.xml.j2")


def _links(mechanism: Mechanism, values: Mapping[str, float]) -> Links:
    if isinstance(mechanism, SymbolicMechanism):
        return links_of_bodies(mechanism.description, values)
    if isinstance(mechanism, RigidBodyTree):
        tree, rotors = mechanism.with_parameters(values)
        return Links(tree, rotors, np.zeros(tree.n), np.zeros(tree.n))
    raise InputError(
        f"{mechanism.kind}: only mechanisms of bodies, or of a URDF or MJCF, can be written as "
        "MJCF; describe its bodies (frictionid.mechanisms.from_bodies)"
    )


def _inertial(inertia: Array, name: str) -> tuple[Array, float, Array]:
    """Centre of mass (3,), mass and inertia (6,) about it, of parameters (10,) about the joint."""
    mass = inertia[0]
    centre = inertia[1:4] / mass if mass > 0 else np.zeros(3)
    about_centre = matrix_of(inertia[4:]) - mass * (
        centre @ centre * np.eye(3) - np.outer(centre, centre)
    )
    axes = np.linalg.eigvalsh(about_centre)
    short = _LEAST + 1e-12 * np.trace(about_centre) - min(axes[0], axes[0] + axes[1] - axes[2])
    # what MuJoCo asks of rounded numbers: no inertia at all, or a plate's, is a little more
    if mass < 0 or short > _LEAST + _SHARE * max(np.trace(about_centre), inertia[4::3].sum(), 0.0):
        raise InputError(
            f"{name}: mass {mass:.4g} kg and inertias {_text(axes.round(9))} kg m^2 about its "
            "centre of mass are those of no body, which MJCF cannot hold: correct its parameters"
        )
    about_centre = about_centre + max(short, 0.0) * np.eye(3)
    six = about_centre[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return centre, max(float(mass), _LEAST), six


def _quaternion(R: Array) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation matrix (3, 3), its largest entry positive."""
    trace = np.trace(R)
    squares = np.array([1 + trace, *(1 - trace + 2 * np.diag(R))]) / 4
    k = int(np.argmax(squares))
    w = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    K = np.zeros((4, 4))
    K[0, 0], K[0, 1:], K[1:, 0] = 4 * squares[0], w, w
    K[1:, 1:] = R + R.T
    K[np.arange(1, 4), np.arange(1, 4)] = 4 * squares[1:]
    return K[k] / np.linalg.norm(K[k])


def _text(values: Array | float) -> str:
    return " ".join(repr(float(v) + 0.0) for v in np.ravel(values))
