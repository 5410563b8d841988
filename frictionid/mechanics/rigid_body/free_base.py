"""A floating tree with the forces and moments on its base as torques of six joints at its root."""

from dataclasses import replace

import numpy as np

from .base_parameters import BaseParameters
from .rigid_body_tree import RigidBodyTree

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
