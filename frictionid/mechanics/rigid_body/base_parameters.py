"""Base parameters of a tree, found numerically [Gautier1991].

The torques of a motion are linear in the inertial parameters pi of all bodies and rotors. The
columns of the regressor at random motions tell which of them are independent, and how the others
add to those: with pi sorted into independent (1) and dependent (2) ones, Y2 = Y1 K and

    p = pi1 + K pi2.

The leading parameters pi1 = p and pi2 = 0 have the torques of all.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.mechanics.rigid_body import loops

from .loops import Geometry
from .robot import MOMENT_UNITS, MOMENTS, Tree

# A column that this little of the largest one is left of, beyond the columns before, is dependent:
# files round right angles to four digits or more, and an axis that is off by that much has
# parameters that only the rounding tells apart.
_TOLERANCE = 1e-4
_UNHEARD = 1e-11  # of the torques
_MOTIONS = 100


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """How inertial parameters pi (N,) and base parameters p (nb,) make one another.

    Attributes
    ----------
    names, units : of the leading inertial parameters, to which others may add
    leading : array of int, shape (nb,), inertial parameters that the base parameters lead
    regrouping : array, shape (nb, N): p = regrouping pi
    silent, carrier : array, shape (N,), and int
        What pi = p has beyond the leading parameters, in proportion to the base parameter
        `carrier`: of no torque but for roundings in the file, so that the torques of the tree's own
        parameters come out exactly.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    leading: Array
    regrouping: Array
    silent: Array
    carrier: int

    @property
    def rounded(self) -> bool:
        """Whether torques of the silent parameters are to be counted."""
        return bool(self.silent.any())


def base_parameters(tree: Tree, inertial: Array) -> BaseParameters:
    """Base parameters of a tree of inertial parameters (N,), with N = 10 n + rotors."""
    Y = _scaled_regressor(tree)
    scale = _scales(tree)
    order = np.fromiter(_preference(tree), dtype=int)
    leading = _independent(Y, order)
    K = np.linalg.lstsq(Y[:, leading], Y, rcond=None)[0]
    K[np.abs(K) < 1e-11] = 0.0
    K[:, leading] = np.eye(len(leading))
    regrouping = K * (scale[leading][:, None] / scale)
    p = regrouping @ inertial
    carrier = int(np.argmax(np.abs(p) / scale[leading]))
    silent = inertial.copy()
    silent[leading] -= p
    silent /= p[carrier] or 1.0  # a machine of no mass at all is refused elsewhere
    heard = np.abs(Y @ (silent / scale)).max() > _UNHEARD * np.abs(Y[:, leading[carrier]]).max()
    names = [*(f"{moment}_{b}" for b in tree.bodies for moment in MOMENTS), *tree.rotor_names]
    units = [*MOMENT_UNITS * tree.n, *tree.rotor_units]
    return BaseParameters(
        tuple(names[i] for i in leading),
        tuple(units[i] for i in leading),
        leading,
        regrouping,
        silent if heard else np.zeros(len(inertial)),
        carrier,
    )


def _length(tree: Tree) -> float:
    """Typical length of a link [m]."""
    lengths = np.linalg.norm(tree.shift, axis=1)
    return float(max(lengths.max(initial=0.0) / 2, 1e-2))


def _scales(tree: Tree) -> Array:
    """Unit of each inertial parameter in which links of usual length have comparable torques."""
    length = _length(tree)
    powers = np.array([0] + 3 * [1] + 6 * [2])
    turns = 2.0 * (np.abs(tree.rotors) @ ~tree.prismatic > 0)
    return np.concatenate([np.tile(length ** (powers - 1.0), tree.n), length ** (turns - 1.0)])


def _scaled_regressor(tree: Tree) -> Array:
    """Regressor (rows, N) at random motions, in the units of `_scales` and m g L = 1."""
    rng, length = np.random.default_rng(0), _length(tree)
    shape = (_MOTIONS, tree.n)
    reach = np.where(tree.prismatic, length, np.pi)
    rate = np.where(tree.prismatic, length, 1.0)
    q = rng.uniform(-1, 1, shape) * reach
    w = rng.uniform(-2, 2, shape) * rate * np.sqrt(10.0 / length)
    a = rng.uniform(-2, 2, shape) * rate * 10.0 / length
    base = None
    if tree.floating:
        turning = rng.uniform(-2, 2, (2, _MOTIONS, 3)) * [
            [[np.sqrt(10.0 / length)]],
            [[10.0 / length]],
        ]
        base = np.concatenate([*turning, rng.uniform(-10, 10, (_MOTIONS, 3))], axis=-1)
    Y = regressor(tree, q, w, a, base)
    rows = np.where(tree.prismatic, length, 1.0)[:, None] / 10.0
    return (Y * rows).reshape(-1, Y.shape[-1]) * _scales(tree)


def geometry(tree: Tree, reduction: BaseParameters | None = None) -> Geometry:
    """What the loops over samples need of a tree; without base parameters p is all of pi."""
    arrays = (tree.parent, tree.prismatic, tree.axis, tree.turn, tree.shift, tree.gravity)
    if reduction is not None:
        leading = reduction.leading, reduction.silent, reduction.carrier
    else:
        count = 10 * tree.n + len(tree.rotors)
        leading = np.arange(count), np.zeros(count), 0
    return Geometry(*arrays, tree.rotors, *leading)


def regressor(tree: Tree, q: Array, w: Array, a: Array, base: Array | None = None) -> Array:
    """Torques (K, n, N) of motions (K, n) with one unit inertial parameter each, 10 n and rotors.

    base : array, shape (1, 9) or (K, 9), motion of the base, at rest if not given
    """
    count = 10 * tree.n + len(tree.rotors)
    p = np.zeros((1, count)) if base is None else np.pad(base, ((0, 0), (count, 0)))
    return loops.evaluate(loops.regressor, geometry(tree), ((tree.n, count),), p, q, w, a)[0]


def _independent(Y: Array, order: Array) -> Array:
    """Columns of Y, in this order, that those before do not give; by orthogonalisation."""
    largest = np.linalg.norm(Y, axis=0).max()
    Q = np.empty((len(Y), 0))
    columns = []
    for c in order:
        rest = Y[:, c]
        for _ in range(2):
            rest = rest - Q @ (Q.T @ rest)
        size = np.linalg.norm(rest)
        if size > _TOLERANCE * largest:
            columns.append(c)
            Q = np.column_stack([Q, rest / size])
    return np.sort(np.array(columns, dtype=int))


def _preference(tree: Tree) -> Iterator[int]:
    """Inertial parameters in the order in which they should lead.

    With the axis along z, mass, mz and Iyy of a body act like others of the body before
    [Gautier1990]; rotors like the inertia about their axis.
    """
    order = np.array([_BY_AXIS[z].split() for z in np.argmax(np.abs(tree.axis), axis=1)])
    places = 10 * np.arange(tree.n)[:, None] + np.vectorize(MOMENTS.index)(order)
    yield from places[:, :_MIXED].ravel()
    yield from range(10 * tree.n, 10 * tree.n + len(tree.rotors))
    yield from places[:, _MIXED:].T.ravel()


# moments of a body whose axis is x, y or z; the first ones are led by no body before
_MIXED = 7
_BY_AXIS = (
    "Ixx Iyy Iyz Ixy Ixz my mz Izz mx mass",
    "Iyy Izz Ixz Iyz Ixy mz mx Ixx my mass",
    "Izz Ixx Ixy Ixz Iyz mx my Iyy mz mass",
)
