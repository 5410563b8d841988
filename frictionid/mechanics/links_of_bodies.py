"""A mechanism in symbols as a tree of rigid bodies: links, and the hinges and slides between them.

The plane of the description is the x-z plane of the tree, z upwards.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import sympy as sp

from frictionid.arrays import Array
from frictionid.errors import InputError

from .description import Body, Description, Expression
from .rigid_body.kinematics import placements
from .rigid_body.robot import Tree, moved

_SAME = 1e-9  # [m], or [1] of turns


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
    x, y, angle = (_put(e, numbers) for e in (body.x, body.y, body.angle))
    plain = Body(
        _number(body.mass, numbers), x, y, _number(body.inertia, numbers), angle, body.joint
    )
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
    if not bodies or mass.sum() == 0:
        size = sum(p.body.inertia for p in bodies if not _apart(p, turns))
        return np.array([0.0] * 4 + [size, 0.0, 0.0, size, 0.0, size])
    zero = {s: 0.0 for p in bodies for e in (p.body.x, p.body.y) for s in e.free_symbols}
    r = np.array([[float(e.subs(zero)) for e in (p.body.x, p.body.y)] for p in bodies])
    centre = mass @ r / mass.sum()
    size = float(mass @ ((r - centre) ** 2).sum(axis=1))
    size += sum(p.body.inertia for p in bodies if not _apart(p, turns))
    at_centre = np.array([mass.sum(), 0.0, 0.0, 0.0, size, 0.0, 0.0, size, 0.0, size])
    return moved(at_centre, np.eye(3), _in_space(centre - pivot))


def _check_places(d: Description, tree: Tree, parts: Sequence[_Part], pivots: Array) -> None:
    """Refuse joints that do not move the bodies as the tree's hinges and slides do."""
    n, rng = tree.n, np.random.default_rng(0)
    for q in rng.uniform(-1.0, 1.0, (3, n)):
        R, o, S = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 6))
        placements.py_func(tree, q, R, o, S)
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
