"""A mechanism as MJCF, the format of MuJoCo: its links, joints, rotors and motors."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from scipy.spatial.transform import Rotation

from frictionid.arrays import Array
from frictionid.errors import InputError

from .description import Body, Description, Expression
from .mechanism import Mechanism
from .rigid_body.kinematics import frames
from .rigid_body.rigid_body_tree import RigidBodyTree
from .rigid_body.robot import Tree, matrix_of, moved
from .symbolic import SymbolicMechanism

_SAME = 1e-9  # [m], or [1] of turns
_LEAST = 1e-14  # [kg, kg m^2]: MuJoCo takes no link whose mass or inertia is below 1e-15
_SHARE = 1e-9  # of the inertia, by which rounding may make it one that no body has


class Links(NamedTuple):
    """Links of a mechanism, and what acts at its joints beside gravity.

    rotors : inertia (r,) of each rotor of the tree, whose rows may turn with several joints
    stiffness, slack : of a spring at each joint (n,) [N m/rad], and where it is slack (n,) [rad]
    """

    tree: Tree
    rotors: Array
    stiffness: Array
    slack: Array


class _Part(NamedTuple):
    """A body with numbers in place of parameters: its joints from the ground, how they turn it."""

    body: Body
    chain: tuple[int, ...]
    turns: Array

    @property
    def link(self) -> int:
        """The joint that carries it, or -1."""
        return max(self.chain, default=-1)


def links_of_bodies(d: Description, values: Mapping[str, float]) -> Links:
    """Links of a description whose parameters have these values, SI.

    Each joint must turn or move a link against the one that carries it, as hinges and slides do. An
    inertia that turns otherwise than its link, as that of a geared rotor, is a rotor of the tree.

    Raises
    ------
    InputError
        Where the joints are no hinges and slides, or a spring is not linear.

    Examples
    --------
    >>> from frictionid.mechanics import acrobot
    >>> links = links_of_bodies(acrobot().description, acrobot().nominal({"rotor": 1e-6}))
    >>> links.tree.parent, links.tree.rotors, links.rotors
    (array([-1,  0]), array([[  1., -18.]]), array([1.e-06]))
    """
    numbers = {sp.Symbol(name): float(value) for name, value in values.items()}
    parts = [_part(body, d, numbers) for body in d.bodies]
    n = len(d.q)
    parent = np.array([_carrier(j, parts) for j in range(n)])
    pivots, axes = (np.array(x) for x in zip(*(_joint(d, j, parts) for j in range(n)), strict=True))
    carried = np.where(parent[:, None] >= 0, pivots[parent], 0.0)
    turns = _turns_of_links(parent, axes[:, 1])
    bodies = [[p for p in parts if p.link == link] for link in range(n)]
    inertia = [_inertia(bodies[j], turns[j], pivots[j]) for j in range(n)]
    rotors = [(_number(size, numbers), _row(_put(a, numbers), d)) for size, a in d.rotors]
    rotors += [
        (p.body.inertia, p.turns) for j in range(n) for p in bodies[j] if _apart(p, turns[j])
    ]
    rotors = [(size, row) for size, row in rotors if size != 0]
    tree = Tree(
        joints=d.joints,
        bodies=tuple(f"link {j + 1}" for j in range(n)),
        parent=parent,
        prismatic=np.array([unit == "m" for unit in d.position_units or ("rad",) * n]),
        axis=axes,
        turn=np.tile(np.eye(3), (n, 1, 1)),
        shift=_in_space(pivots - carried),
        inertia=np.array(inertia),
        rotor_names=tuple(f"rotor {k + 1}" for k in range(len(rotors))),
        rotors=np.array([row for _, row in rotors]).reshape(-1, n),
        gravity=np.array([0.0, 0.0, -_number(d.gravity, numbers)]),
    )
    _check_places(d, tree, parts, pivots)
    return Links(tree, np.array([size for size, _ in rotors]), *_springs(d, numbers))


def _put(e: Expression, numbers: Mapping[sp.Symbol, float]) -> sp.Expr:
    return sp.sympify(e).subs(numbers)


def _number(e: Expression, numbers: Mapping[sp.Symbol, float]) -> float:
    return float(_put(e, numbers))


def _part(body: Body, d: Description, numbers: Mapping[sp.Symbol, float]) -> _Part:
    mass, x, y, inertia, angle = (_put(e, numbers) for e in body[:-1])
    plain = Body(float(mass), x, y, float(inertia), angle, body.joint)
    moving = x.free_symbols | y.free_symbols | angle.free_symbols
    chain = tuple(j for j, q in enumerate(d.q) if q in moving)
    return _Part(plain, chain, _row(angle, d))


def _row(angle: sp.Expr, d: Description) -> Array:
    """By how much an angle turns for one of each joint (n,)."""
    row = [sp.diff(angle, q) for q in d.q]
    if any(not e.is_number for e in row):
        raise InputError(
            f"{d.kind}: something turns by {angle}, which is no sum of joint angles; links of "
            "hinges and slides turn so"
        )
    return np.array(row, dtype=float)


def _at(e: Sequence[sp.Expr], d: Description, q: Array) -> Array:
    """Values of expressions at positions q (n,)."""
    here = dict(zip(d.q, q.tolist(), strict=True))
    return np.array([float(sp.sympify(x).subs(here)) for x in e])


def _in_space(points: Array) -> Array:
    """Points (..., 2) of the plane in space (..., 3)."""
    return np.stack([points[..., 0], 0.0 * points[..., 0], points[..., 1]], axis=-1)


def _carrier(j: int, parts: Sequence[_Part]) -> int:
    """The joint that carries joint j, or -1."""
    beyond = [p.chain for p in parts if j in p.chain]
    return max((i for chain in beyond for i in chain if i < j), default=-1)


def _joint(d: Description, j: int, parts: Sequence[_Part]) -> tuple[Array, Array]:
    """Where joint j is at q = 0, in the plane (2,), and its axis in space (3,).

    A point r on a link that turns has r'' = pivot - r; one on a link that slides has r'' = 0.
    """
    q, zero = d.q[j], np.zeros(len(d.q))
    slides = bool(d.position_units) and d.position_units[j] == "m"
    pivot, axis, longest = np.zeros(2), np.array([0.0, -1.0, 0.0]), 0.0
    if slides:
        axis = np.array([1.0, 0.0, 0.0])
    for part in parts:
        if j not in part.chain:
            continue
        place = (part.body.x, part.body.y)
        r = _at(place, d, zero)
        rate = _at([sp.diff(e, q) for e in place], d, zero)
        change = _at([sp.diff(e, q, 2) for e in place], d, zero)
        if not longest and not slides:  # it may sit on the axis itself
            pivot, axis = r, np.array([0.0, -1.0 if part.turns[j] >= 0 else 1.0, 0.0])
        if (length := float(np.hypot(*rate))) > longest:
            longest = length
            if slides:
                pivot, axis = r, _in_space(rate)
            else:
                pivot = r + change
                sense = np.sign(change[1] * rate[0] - change[0] * rate[1])
                axis = np.array([0.0, -sense, 0.0])
    return pivot, axis


def _turns_of_links(parent: Array, sense: Array) -> Array:
    """By how much each link turns for one of each joint (n, n); sense: y of the hinges' axes."""
    turns = np.zeros((len(parent), len(parent)))
    for j, carrier in enumerate(parent):
        turns[j] = turns[carrier] if carrier >= 0 else 0.0
        turns[j, j] = -sense[j]
    return turns


def _apart(part: _Part, turns: Array) -> bool:
    """Whether a body does not turn with its link."""
    return min(np.abs(part.turns - turns).max(), np.abs(part.turns + turns).max()) > _SAME


def _inertia(bodies: Sequence[_Part], turns: Array, pivot: Array) -> Array:
    """Inertial parameters (10,) of the bodies of a link, about its joint.

    Only the inertia about the plane's normal matters; it is the same about all axes, which can be.
    """
    mass = np.array([p.body.mass for p in bodies])
    zero = {s: 0.0 for p in bodies for e in (p.body.x, p.body.y) for s in e.free_symbols}
    r = np.array([[float(e.subs(zero)) for e in (p.body.x, p.body.y)] for p in bodies])
    r, total = r.reshape(-1, 2), mass.sum()
    centre = mass @ r / (total or 1.0)
    size = float(mass @ ((r - centre) ** 2).sum(axis=1))
    size += sum(p.body.inertia for p in bodies if not _apart(p, turns))
    at_centre = np.array([total, 0.0, 0.0, 0.0, size, 0.0, 0.0, size, 0.0, size])
    return moved(at_centre, np.eye(3), _in_space(centre - pivot))


def _check_places(d: Description, tree: Tree, parts: Sequence[_Part], pivots: Array) -> None:
    """Refuse joints that do not move the bodies as the tree's hinges and slides do."""
    n, positions = tree.n, np.random.default_rng(0).uniform(-1.0, 1.0, (3, tree.n))
    for q, R, o in zip(positions, *frames(tree, positions), strict=True):
        for part in (p for p in parts if p.link >= 0):
            place, j = (part.body.x, part.body.y), part.link
            arm = _in_space(_at(place, d, np.zeros(n)) - pivots[j])
            if np.abs(o[j] + R[j] @ arm - _in_space(_at(place, d, q))).max() > _SAME:
                raise InputError(
                    f"{d.kind}: {d.joints[j]} or one before it is no hinge and no slide between a "
                    "link and the one that carries it; joints of trees of links are measured "
                    "against the link before: describe it so"
                )


def _springs(d: Description, numbers: Mapping[sp.Symbol, float]) -> tuple[Array, Array]:
    """Stiffness (n,) and slack positions (n,) of the springs of the potential energy."""
    potential, zero = _put(d.potential, numbers), np.zeros(len(d.q))
    second = sp.Matrix([[sp.diff(potential, a, b) for b in d.q] for a in d.q])
    stiffness = np.array([second[j, j] for j in range(len(d.q))])
    push = _at([sp.diff(potential, q) for q in d.q], d, zero)
    alone = second == sp.diag(*stiffness) and all(e.is_number for e in stiffness)
    if not alone or (push[stiffness == 0] != 0).any():
        raise InputError(
            f"{d.kind}: the potential energy {d.potential} is no sum of springs k (q - q0)^2 / 2, "
            "one at each joint; joints of trees of links have such springs"
        )
    stiff = stiffness.astype(float)
    return stiff, np.divide(-push, stiff, out=np.zeros_like(push), where=stiff != 0)


# --- Text -----------------------------------------------------------------------------------------


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
    return _template().render(
        kind=mechanism.kind,
        timestep=timestep,
        tree=tree,
        links=links,
        armature=armature,
        coupled=np.flatnonzero(~single).tolist(),
        driven=driven,
        inertial=_inertial,
        quaternion=_quaternion,
    )


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
    mass, (centre, about_centre) = inertia[0], _about_centre(inertia)
    short = _LEAST + 1e-12 * np.trace(about_centre) + _lacking(about_centre)
    # what MuJoCo asks of rounded numbers: no inertia at all, or a plate's, is a little more
    if mass < 0 or short > _LEAST + _SHARE * max(np.trace(about_centre), inertia[4::3].sum(), 0.0):
        axes = np.linalg.eigvalsh(about_centre)
        raise InputError(
            f"{name}: mass {mass:.4g} kg and inertias {_text(axes.round(9))} kg m^2 about its "
            "centre of mass are those of no body, which MJCF cannot hold: correct its parameters"
        )
    about_centre = about_centre + max(short, 0.0) * np.eye(3)
    six = about_centre[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return centre, max(float(mass), _LEAST), six


def _about_centre(inertia: Array) -> tuple[Array, Array]:
    """Centre of mass (3,), and inertia (3, 3) about it."""
    mass = inertia[0]
    c = inertia[1:4] / mass if mass > 0 else np.zeros(3)
    return c, matrix_of(inertia[4:]) - mass * (c @ c * np.eye(3) - np.outer(c, c))


def _lacking(about_centre: Array) -> float:
    """What each principal moment lacks to be that of a body; negative where nothing."""
    axes = np.linalg.eigvalsh(about_centre)
    return -float(min(axes[0], axes[0] + axes[1] - axes[2]))


def lacking_inertias(mechanism: Mechanism, parameters: Mapping[str, float]) -> Array:
    """What the inertias (n,) of links lack to be those of bodies, over those about their joints.

    Negative where nothing.

    Raises
    ------
    InputError
        For what MJCF cannot hold.
    """
    inertia = _links(mechanism, mechanism.nominal(parameters)).tree.inertia
    lacking = np.array([_lacking(_about_centre(x)[1]) for x in inertia])
    return lacking / np.maximum(inertia[:, 4::3].sum(axis=1), _LEAST)


def _quaternion(R: Array) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation matrix (3, 3), its largest entry positive."""
    four = Rotation.from_matrix(R).as_quat(scalar_first=True)
    return four * np.sign(four[np.argmax(np.abs(four))])


def _text(values: Array | float) -> str:
    return " ".join(repr(float(v) + 0.0) for v in np.ravel(values))
