"""Torques of a tree, their derivatives, the regressor and M [Featherstone2008]."""

from typing import Any

from frictionid.programs.machine_code import inlined

from .kinematics import add_to_parents, cross_force, cross_motion, dot, momentum


@inlined
def _sum(x: Any, y: Any) -> Any:
    return x[0] + y[0], x[1] + y[1], x[2] + y[2], x[3] + y[3], x[4] + y[4], x[5] + y[5]


@inlined
def torques(parent: Any, S: Any, v: Any, a: Any, inertia: Any, force: Any, out: Any) -> None:
    """Write the torques (n,) of a motion without those of the rotors, and the forces (n, 6).

    The torque of joint i is S_i' of the forces I a + v x* I v of all bodies that it carries.

    v, a, inertia : velocities, accelerations less gravity and inertias of the bodies
    """
    for i in range(len(parent)):
        inert = momentum(inertia[i], a[i])
        carried = cross_force(v[i], momentum(inertia[i], v[i]))
        for c in range(6):
            force[i, c] = inert[c] + carried[c]
    add_to_parents(parent, force, 6)
    for i in range(len(parent)):
        out[i] = dot(S[i], force[i])


@inlined
def lagrangian_slopes(
    tree: Any, base: Any, S: Any, v: Any, dS: Any, inertia: Any, carried: Any, moving: Any, out: Any
) -> float:
    """Write dL/dq (n,) without that of the rotors; the potential energy [J], zero in the origin.

    Where joint i moves all that it carries, momentum and all, its kinetic energy stays; so dT/dq_i
    is the momentum's product with v_p x S_i, and -dV/dq_i the power of gravity on S_i.

    base : see `kinematics.motion`; where it accelerates, that acts like gravity
    carried : inertia of all that each joint carries; moving (n, 6) : scratch, for their momenta
    """
    g0, g1, g2 = -base[6], -base[7], -base[8]
    energy = 0.0
    for i in range(len(out)):
        moment = momentum(inertia[i], v[i])
        for c in range(6):
            moving[i, c] = moment[c]
        energy -= inertia[i, 1] * g0 + inertia[i, 2] * g1 + inertia[i, 3] * g2
    add_to_parents(tree.parent, moving, 6)
    for i in range(len(out)):
        m, h0, h1, h2 = carried[i, 0], carried[i, 1], carried[i, 2], carried[i, 3]
        weight = (h1 * g2 - h2 * g1, h2 * g0 - h0 * g2, h0 * g1 - h1 * g0, m * g0, m * g1, m * g2)
        out[i] = dot(dS[i], moving[i]) + dot(S[i], weight)
    return energy


@inlined
def add_mass_matrix(parent: Any, S: Any, carried: Any, M: Any) -> None:
    """Add S_j' I_i S_i to M_ji and M_ij (n, n) for every joint j that carries joint i.

    carried : array, shape (n, 10), inertia I_i of all that joint i carries
    """
    for i in range(len(parent)):
        force = momentum(carried[i], S[i])
        M[i, i] += dot(S[i], force)
        j = parent[i]
        while j >= 0:
            value = dot(S[j], force)
            M[j, i] += value
            M[i, j] += value
            j = parent[j]


@inlined
def _cross(x: Any, y: Any) -> Any:
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@inlined
def _dot(x: Any, y: Any) -> float:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@inlined
def _relative(e: Any, rate: Any, omega: Any) -> Any:
    """Acceleration of a point at e against its body's origin: rate x e + omega x (omega x e)."""
    first, second = _cross(rate, e), _cross(omega, _cross(omega, e))
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


@inlined
def _wrenches(R: Any, o: Any, v: Any, a: Any, out: Any) -> None:
    """Forces about the base's origin (10, 6) that units of a body's ten parameters need."""
    omega, rate = (v[0], v[1], v[2]), (a[0], a[1], a[2])
    turned, turning = _cross(omega, (v[3], v[4], v[5])), _relative(o, rate, omega)
    # acceleration of the body's origin less gravity
    point = (
        a[3] + turned[0] + turning[0],
        a[4] + turned[1] + turning[1],
        a[5] + turned[2] + turning[2],
    )
    moment = _cross(o, point)
    for c in range(3):
        out[0, c], out[0, 3 + c] = moment[c], point[c]
    for axis in range(3):
        e = (R[0, axis], R[1, axis], R[2, axis])
        force = _relative(e, rate, omega)
        first, second = _cross(o, force), _cross(e, point)
        for c in range(3):
            out[1 + axis, c], out[1 + axis, 3 + c] = first[c] + second[c], force[c]
    k = 4
    for i in range(3):
        x = (R[0, i], R[1, i], R[2, i])
        for j in range(i, 3):
            y = (R[0, j], R[1, j], R[2, j])
            half = 0.5 if i == j else 1.0
            wx, wy = half * _dot(x, omega), half * _dot(y, omega)
            ax, ay = half * _dot(x, rate), half * _dot(y, rate)
            spin = (x[0] * wy + y[0] * wx, x[1] * wy + y[1] * wx, x[2] * wy + y[2] * wx)
            gyro = _cross(omega, spin)
            for c in range(3):
                out[k, c], out[k, 3 + c] = x[c] * ay + y[c] * ax + gyro[c], 0.0
            k += 1


@inlined
def torque_regressor(
    parent: Any, frames: Any, S: Any, v: Any, a: Any, columns: Any, wrench: Any, out: Any
) -> None:
    """Write the torques (n, C) of a motion with one unit parameter each.

    frames : R and o of the bodies, see `kinematics.placements`
    columns : array of int, shape (C,), in order, of the 10 n parameters of all bodies
    wrench : scratch (10, 6)
    """
    R, o = frames
    last = -1
    for c in range(len(columns)):
        body = columns[c] // 10
        if body != last:
            _wrenches(R[body], o[body], v[body], a[body], wrench)
            last = body
        for i in range(len(parent)):
            out[i, c] = 0.0
        j = body
        while j >= 0:
            out[j, c] = dot(S[j], wrench[columns[c] % 10])
            j = parent[j]


@inlined
def _coriolis(inertia: Any, v: Any, moving: Any, out: Any) -> None:
    """2 B of one body: N (9 numbers) and 2 p (3 numbers); `moving` is its momentum."""
    trace = inertia[4] + inertia[7] + inertia[9]
    xx, yy, zz = trace / 2 - inertia[4], trace / 2 - inertia[7], trace / 2 - inertia[9]
    xy, xz, yz = -inertia[5], -inertia[6], -inertia[8]
    power = 2.0 * (inertia[1] * v[3] + inertia[2] * v[4] + inertia[3] * v[5])
    for c in range(3):
        s0, s1, s2 = (xx, xy, xz) if c == 0 else ((xy, yy, yz) if c == 1 else (xz, yz, zz))
        h = inertia[1 + c]
        out[c] = -2.0 * (v[1] * s2 - v[2] * s1 + v[3] * h)
        out[3 + c] = -2.0 * (v[2] * s0 - v[0] * s2 + v[4] * h)
        out[6 + c] = -2.0 * (v[0] * s1 - v[1] * s0 + v[5] * h)
        out[4 * c] += power
    out[9], out[10], out[11] = 2.0 * moving[3], 2.0 * moving[4], 2.0 * moving[5]


@inlined
def _times(B: Any, x: Any) -> Any:
    """2 B x."""
    return (
        B[0] * x[0] + B[1] * x[1] + B[2] * x[2],
        B[3] * x[0] + B[4] * x[1] + B[5] * x[2],
        B[6] * x[0] + B[7] * x[1] + B[8] * x[2],
        x[1] * B[11] - x[2] * B[10],
        x[2] * B[9] - x[0] * B[11],
        x[0] * B[10] - x[1] * B[9],
    )


@inlined
def _transposed_times(B: Any, x: Any) -> Any:
    """(2 B)' x, of which only the first three numbers are not zero."""
    return (
        B[0] * x[0] + B[3] * x[1] + B[6] * x[2] + B[10] * x[5] - B[11] * x[4],
        B[1] * x[0] + B[4] * x[1] + B[7] * x[2] + B[11] * x[3] - B[9] * x[5],
        B[2] * x[0] + B[5] * x[1] + B[8] * x[2] + B[9] * x[4] - B[10] * x[3],
    )


@inlined
def prepare(
    tree: Any, base: Any, S: Any, v: Any, dS: Any, a: Any, inertia: Any, B: Any, twice: Any
) -> None:
    """Write 2 B (n, 12) of all that each joint carries, and ddS (n, 6)."""
    still = (base[0], base[1], base[2], 0.0, 0.0, 0.0)
    lifted = (base[3], base[4], base[5], base[6], base[7], base[8])
    for i in range(len(S)):
        p = tree.parent[i]
        _coriolis(inertia[i], v[i], momentum(inertia[i], v[i]), B[i])
        first = cross_motion(lifted, S[i]) if p < 0 else cross_motion(a[p], S[i])
        second = cross_motion(still, dS[i]) if p < 0 else cross_motion(v[p], dS[i])
        for c in range(6):
            twice[i, c] = first[c] + second[c]
    add_to_parents(tree.parent, B, 12)


@inlined
def torque_derivatives(
    parent: Any, S: Any, dS: Any, twice: Any, J: Any, B: Any, f: Any, by_q: Any, by_w: Any
) -> None:
    """Write the derivatives by q and by w (n, n) of the torques of a motion, see `rnea.torques`.

    J, B, f, twice : inertia (n, 10), 2 B and force (n, 6) of all that each joint carries, and ddS
    """
    by_q[:], by_w[:] = 0.0, 0.0
    for i in range(len(parent)):
        x0, x1, x2 = momentum(J[i], twice[i]), _times(B[i], dS[i]), cross_force(S[i], f[i])
        y0, y1 = momentum(J[i], dS[i]), _times(B[i], S[i])
        x, y = _sum(_sum(x0, x1), x2), _sum(_sum(y0, y0), y1)
        row, inert = _transposed_times(B[i], S[i]), momentum(J[i], S[i])
        by_q[i, i], by_w[i, i] = dot(S[i], x), dot(S[i], y)
        j = parent[i]
        while j >= 0:
            d, s = dS[j], S[j]
            by_q[j, i], by_w[j, i] = dot(s, x), dot(s, y)
            turned = row[0] * d[0] + row[1] * d[1] + row[2] * d[2]
            by_q[i, j] = turned + dot(twice[j], inert)
            turned = row[0] * s[0] + row[1] * s[1] + row[2] * s[2]
            by_w[i, j] = turned + 2.0 * dot(d, inert)
            j = parent[j]
