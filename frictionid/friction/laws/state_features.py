"""What a model without physics sees: the states and torques of all joints, at about one in size.

Its parameters begin with three scales, of acceleration, speed and torque, which training keeps.
"""

from __future__ import annotations

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs
from frictionid.friction.laws.levels import Range
from frictionid.friction.laws.network_law import Scale
from frictionid.friction.smooth_sign import smooth_sign

_ABOVE: Range = (1e-9, float("inf"))
SCALES = (
    Scale("acceleration", "rad/s^2", _ABOVE, 10.0),
    Scale("speed", "rad/s", _ABOVE, 5.0),
    Scale("torque", "N m", _ABOVE, 1.0),
)


def width_of(joints: int, turning: bool) -> int:
    """Number of features.

    >>> width_of(2, True), width_of(1, False)
    (10, 4)
    """
    return joints * (4 + turning)


def state_features(theta: Array, x: Inputs, joints: int, turning: bool, width: float) -> Array:
    """Features (..., n, a), alike for all n joints: place, w, its smooth sign, and u of each.

    Place is sin q and cos q, or q where the joints slide. Joints beyond `joints` are left out,
    those that there are not are zero.
    """
    xp, n = namespace(theta, x.w), x.w.shape[-1]
    speed, torque = theta[..., 1], theta[..., 2]
    zero = 0.0 * (x.w + x.q + x.u + speed)
    out = []
    for j in range(joints):
        if j >= n:
            out += [zero] * (4 + turning)
            continue
        q, w, u = (part[..., j : j + 1] for part in (x.q, x.w, x.u))
        out += [xp.sin(q), xp.cos(q)] if turning else [q]
        out += [w / speed, smooth_sign(w, width, "tanh"), u / torque]
    return xp.stack([f + zero for f in out], axis=-1)
