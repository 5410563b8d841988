"""Mechanisms of any number of joints: trees of rigid bodies, as URDF and MJCF describe them.

Their base parameters are consistent where bodies with masses that are distributed in space, and
rotors of no negative inertia, have them; then M(q) is positive for all q. The moments of a body are
those of a distribution of mass where its pseudo-inertia

    J = [[tr(I)/2 1 - I, m c], [(m c)', m]]    (4, 4)

is positive semidefinite [Wensing2018].
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import Array, solve, times
from frictionid.errors import InputError
from frictionid.mechanics.rigid_body import loops

from ..mechanism import Mechanism, Parameter, Partials, Terms
from ..plant import base_motion_of, side_by_side, with_base_motion
from .base_parameters import BaseParameters, geometry
from .kinematics import frames
from .loops import Geometry
from .robot import MOMENTS, UPPER, Attached, Tree, matrix_of, moved

PAYLOAD = (
    ("mass", "kg", "mass of the payload"),
    ("x", "m", "its centre of mass, in the frame of the link that carries it"),
    ("y", "m", "its centre of mass"),
    ("z", "m", "its centre of mass"),
    *((name, "kg m^2", "its inertia about its centre of mass") for name in MOMENTS[4:]),
)


@dataclass(frozen=True, kw_only=True, repr=False)
class RigidBodyTree(Mechanism):
    """A tree of rigid bodies. Physical parameters are those of its rotors and of a payload.

    The energy has its zero at any height: base parameters do not tell where the masses are.

    Attributes
    ----------
    tree : Tree
    reduction : BaseParameters
        How inertial and base parameters make one another.
    identity : str
        Hash of the tree, by which mechanisms are compared.
    payload : Attached or None
        Where the payload is.
    """

    tree: Tree = field(compare=False)
    reduction: BaseParameters = field(compare=False)
    identity: str
    payload: Attached | None = field(default=None, compare=False)

    def base(self, parameters: Mapping[str, Any]) -> Array:
        for name in parameters:
            self.check_name(name)
        base = self._inertial({**self.defaults, **parameters}) @ self.reduction.regrouping.T
        most = np.abs(base).max(axis=-1, keepdims=True)
        return np.where(np.abs(base) > _ROUNDING * most, base, 0.0)

    def dynamics(self, p: Array, q: Array, w: Array) -> tuple[Array, Array]:
        n = self.n
        M, h = self._evaluate(loops.dynamics, ((n, n), (n,)), p, q, w)
        return M, h

    def inertia(self, p: Array, q: Array) -> Array:
        return self._evaluate(loops.inertia, ((self.n, self.n),), p, q)[0]

    def terms(self, p: Array, q: Array, w: Array) -> Terms:
        shapes = ((self.n, self.n), (self.n,), (self.n,), (), (self.n,))
        M, h, slope, potential, turned = self._evaluate(loops.terms, shapes, p, q, w)
        momentum = times(M, w)
        energy = (momentum * w).sum(-1) / 2 + potential
        return Terms(M, h, momentum + turned, slope, self.B, energy)

    def partials(self, p: Array, q: Array, w: Array, a: Array) -> Partials:
        n, reduction = self.n, self.reduction
        by_q, by_w = self._evaluate(loops.derivatives, ((n, n), (n, n)), p, q, w, a)
        (by_p,) = self._evaluate(loops.regressor, ((n, len(self.base_names)),), p, q, w, a)
        if reduction.rounded:
            silent = with_base_motion(reduction.silent, base_motion_of(p, len(self.base_names)))
            whole, shapes = geometry(self.tree), ((n, n), (n,))
            M, h = loops.evaluate(loops.dynamics, whole, shapes, silent, q, w)
            column = by_p[..., reduction.carrier] + (times(M, a) - h)
            by_p[..., reduction.carrier] = column
        return Partials(by_q, by_w, by_p)

    def points(self, q: Array) -> Array:
        """Lines (..., k, 3) [m] through the joints, to the centre of mass of each last body.

        In the frame of the base, z upwards as in URDF; bodies that lie alone end a line.
        """
        q = np.asarray(q, dtype=float)
        turns, places = frames(self.tree, q.reshape(-1, self.n))
        nothing, base = np.full((len(places), 3), np.nan), np.zeros((len(places), 3))
        out: list[Array] = []
        for leaf in sorted(set(range(self.n)) - {int(p) for p in self.tree.parent}):
            mass, *moment = self.tree.inertia[leaf, :4]
            centre = np.array(moment) / mass if mass > 0 else np.zeros(3)
            chain = [places[:, leaf] + turns[:, leaf] @ centre]
            joint = leaf
            while joint >= 0:
                chain.append(places[:, joint])
                joint = int(self.tree.parent[joint])
            out += [*([nothing] if out else []), base, *chain[::-1]]
        return np.stack(out, axis=1).reshape(*q.shape[:-1], -1, 3)

    loads_of_gears: ClassVar[bool] = True

    def load(
        self,
        parameters: Mapping[str, Any],
        q: Array,
        w: Array,
        u: Array,
        p: Array | None = None,
    ) -> Array:
        """Torque that each joint's gear passes on in friction-free motion, shape (..., n) [N m].

        |B u - rotor dw/dt|: what the motor gives and its rotor does not take. That is the torque of
        the rigid bodies beyond the gear, on which the friction of geared joints depends.

        p : base parameters, where others hold than those of the physical ones
        """
        p = self.base(parameters) if p is None else p
        M, h = self.dynamics(p, q, w)
        force, base = self.motors * u, self.base_names
        shown = {x: p[..., base.index(x)] for x in self.tree.rotor_names if x in base}
        rotors = _stacked({**self.defaults, **parameters, **shown}, self.tree.rotor_names)
        R = self.tree.rotors
        return np.abs(force - ((solve(M, h + force) @ R.T) * rotors) @ R)

    def with_parameters(self, values: Mapping[str, float]) -> tuple[Tree, Array]:
        """The tree with a payload of these parameters, and the inertias (r,) of its rotors."""
        inertial = self._inertial({**self.defaults, **values})
        bodies = inertial[: 10 * self.n].reshape(self.n, 10)
        return replace(self.tree, inertia=bodies), inertial[10 * self.n :]

    def _inertial(self, values: Mapping[str, Any]) -> Array:
        """Inertial parameters (..., N) of physical ones."""
        for name, value in values.items():
            if hasattr(value, "detach"):
                raise InputError(f"{self.kind}: {name} is a tensor; trees of bodies need NumPy")
        bodies = self.tree.inertia
        if self.payload is not None:
            payload = _payload_inertia(values, self.payload)
            bodies = np.broadcast_to(bodies, (*payload.shape[:-1], self.n, 10)).copy()
            bodies[..., self.payload.body, :] += payload
        rotors = _stacked(values, self.tree.rotor_names)
        return side_by_side(bodies.reshape(*bodies.shape[:-2], -1), rotors)

    @cached_property
    def _geometry(self) -> Geometry:
        return geometry(self.tree, self.reduction)

    def _evaluate(
        self, loop: Callable[..., object], shapes: tuple[tuple[int, ...], ...], *arrays: Array
    ) -> list[Array]:
        """Arrays of these shapes that a loop fills, of p and states whose batch axes broadcast."""
        for x in arrays:
            if hasattr(x, "detach"):
                raise InputError(
                    f"{self.kind}: trees of rigid bodies are evaluated on NumPy arrays, not on "
                    "tensors; convert them with .numpy()"
                )
        return loops.evaluate(loop, self._geometry, shapes, *arrays)


def _stacked(values: Mapping[str, Any], names: Iterable[str]) -> Array:
    """Values (..., k) of these k names."""
    numbers = [values[name] for name in names]
    arrays = [x if hasattr(x, "shape") else np.asarray(x, dtype=float) for x in numbers]
    return np.stack(np.broadcast_arrays(*arrays), axis=-1)


def _payload_inertia(values: Mapping[str, Any], at: Attached) -> Array:
    """Inertial parameters (..., 10) that a payload adds to its body."""
    table = _stacked(values, (f"payload_{name}" for name, *_ in PAYLOAD))
    out = np.empty((*table.shape[:-1], 10))
    for k in np.ndindex(table.shape[:-1]):
        mass, center, six = table[k][0], table[k][1:4], table[k][4:]
        at_centre = np.array([mass, 0.0, 0.0, 0.0, *six])
        out[k] = moved(moved(at_centre, np.eye(3), center), at.turn, at.shift)
    return out


def parameters_of_tree(tree: Tree, rotors: Array, payload: bool) -> tuple[Parameter, ...]:
    """Physical parameters: the rotors' inertias, with these defaults, and those of a payload."""
    meaning = "inertia of a rotor, seen at its joint"
    rows = zip(tree.rotor_names, rotors.tolist(), tree.rotor_units, strict=True)
    return (
        *(Parameter(name, value, unit, meaning, rotor=True) for name, value, unit in rows),
        *(Parameter(f"payload_{n}", 0.0, unit, what) for n, unit, what in PAYLOAD if payload),
    )


_ROUNDING = 1e-14  # of the largest base parameter: what is left of sums that cancel
_LOWER = np.tril_indices(4)
_LEAST = 1e-6  # of a typical body, which every body has
_WEAK = 1e-4  # [standard errors] pull to the nominal bodies, where the data tell none apart


def pseudo_inertia(moments: Array) -> Array:
    """J (..., 4, 4) of moments (..., 10) about the origin of the body's frame, as of a `Tree`.

    >>> pseudo_inertia(np.array([2.0, 0.2, 0, 0, 0.01, 0, 0, 0.04, 0, 0.04])).diagonal()
    array([0.035, 0.005, 0.005, 2.   ])
    """
    turning = matrix_of(moments[..., 4:])
    half = np.trace(turning, axis1=-2, axis2=-1)[..., None, None] / 2
    J = np.empty((*moments.shape[:-1], 4, 4))
    J[..., :3, :3] = half * np.eye(3) - turning
    J[..., :3, 3] = J[..., 3, :3] = moments[..., 1:4]
    J[..., 3, 3] = moments[..., 0]
    return J


def moments_of(J: Array) -> Array:
    """Moments (..., 10) of pseudo-inertias (..., 4, 4), the inverse of `pseudo_inertia`."""
    S = J[..., :3, :3]
    turning = np.trace(S, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - S
    return np.concatenate([J[..., 3:, 3], J[..., :3, 3], turning[..., *UPPER]], axis=-1)


def nearest_consistent(mechanism: RigidBodyTree, wanted: Array, metric: Array) -> Array:
    """Consistent base parameters p (nb,) of the `nearest_bodies`."""
    bodies, rotors = nearest_bodies(mechanism, wanted, metric)
    return mechanism.reduction.regrouping @ np.append(bodies, rotors)


def nearest_bodies(mechanism: RigidBodyTree, wanted: Array, metric: Array) -> tuple[Array, Array]:
    """Bodies (n, 10) and rotors (r,) with the least (p - wanted)' metric (p - wanted).

    wanted : (nb,), base parameters ; metric : (nb, nb), such as the information of a fit

    Of the many that have the same base parameters, those near the mechanism's own. Cholesky factors
    of the pseudo-inertias, and roots of the rotors' inertias, are free: what they make is
    consistent by itself [Rucker2022].
    """
    tree, regrouping = mechanism.tree, mechanism.reduction.regrouping
    rotors = mechanism.with_parameters(mechanism.nominal())[1]
    J = pseudo_inertia(tree.inertia)
    size = np.maximum(np.trace(J, axis1=1, axis2=2), 1e-12)
    typical = np.median(size)
    floor = _LEAST * typical * np.eye(4)
    scale = np.sqrt(np.maximum(size, 1e-3 * typical))
    values, vectors = np.linalg.eigh(J - floor)
    positive = (vectors * np.maximum(values, floor[0, 0])[:, None]) @ np.swapaxes(vectors, 1, 2)
    most = max(float(np.abs(rotors).max(initial=0.0)), 1e-3 * typical)
    start = np.concatenate(
        [
            (np.linalg.cholesky(positive) / scale[:, None, None])[:, *_LOWER].ravel(),
            np.sqrt(np.maximum(rotors / most, 1e-3)),
        ]
    )
    spread, axes = np.linalg.eigh(metric)
    root = axes * np.sqrt(np.maximum(spread, 0.0))

    def physical(free: Array) -> tuple[Array, Array]:
        factors = np.zeros((tree.n, 4, 4))
        factors[:, *_LOWER] = free[: 10 * tree.n].reshape(tree.n, 10) * scale[:, None]
        bodies = moments_of(factors @ np.swapaxes(factors, 1, 2) + floor)
        return bodies, most * free[10 * tree.n :] ** 2

    def residual(free: Array) -> Array:
        off = regrouping @ np.append(*physical(free)) - wanted
        return np.append(off @ root, _WEAK * (free - start))

    solution = least_squares(residual, start, xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=300)
    return physical(solution.x)


# --- A base that moves ----------------------------------------------------------------------------


WRENCH = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")  # [N], [N m] in the frame of the base, at its origin


def with_free_base(mechanism: RigidBodyTree) -> RigidBodyTree:
    """The mechanism with `WRENCH` in front of its joints, and all inertial parameters as base ones.

    At position and velocity zero of the six, their torques are what pushes the base. Parameters are
    ten of the base link, ten of each body, and the rotors.
    """
    tree, axes, n = mechanism.tree, np.tile(np.eye(3), (2, 1)), mechanism.n
    count = 10 * (n + 1) + len(tree.rotors)
    inertia = np.concatenate([np.zeros((6, 10)), tree.inertia])
    whole = replace(
        tree,
        joints=(*WRENCH, *tree.joints),
        bodies=(*WRENCH, *tree.bodies),
        parent=np.concatenate([np.arange(-1, 5), np.where(tree.parent < 0, 5, tree.parent + 6)]),
        prismatic=np.concatenate([np.arange(6) < 3, tree.prismatic]),
        axis=np.concatenate([axes, tree.axis]),
        turn=np.concatenate([np.tile(np.eye(3), (6, 1, 1)), tree.turn]),
        shift=np.concatenate([np.zeros((6, 3)), tree.shift]),
        inertia=inertia,
        rotors=np.pad(tree.rotors, ((0, 0), (6, 0))),
    )
    names = tuple(map(str, range(count)))
    every = 50 + np.arange(count)  # the first five bodies are nothing
    silent = np.zeros(50 + count)
    return replace(
        mechanism,
        joints=whole.joints,
        position_units=("m",) * 3 + ("rad",) * 3 + mechanism.position_units,
        driven=(True,) * (n + 6),
        base_names=names,
        base_units=names,
        base_meanings=names,
        coupled=(),
        tree=whole,
        reduction=BaseParameters(names, names, every, np.eye(count), silent, 0),
        payload=None,
    )
