"""Machines and states drawn at random, and what the tests of mechanics compare with."""

import numpy as np

from frictionid.mechanics import acrobot, double_pendulum, pendulum

PAIRS = [(True, True), (False, True), (True, False), (False, False)]
MECHANISMS = {
    "acrobot": acrobot(),
    "acrobot-relative": acrobot(link2_rate="relative"),
    "acrobot-shapes": acrobot(inertias="shapes"),
    "acrobot-shapes-relative": acrobot("shapes", "relative"),
    **{f"double_pendulum-{int(a)}{int(b)}": double_pendulum((a, b)) for a, b in PAIRS},
    "pendulum": pendulum(),
    "pendulum-passive": pendulum(driven=False),
}
STEP = 1e-30  # of complex-step differences, which cancel nothing and so are exact to rounding


def physical(mechanism, rng, shape=()):
    """Random physical parameters, each possible for a machine made of matter."""
    out = {k: v * rng.uniform(0.5, 1.5, shape) for k, v in mechanism.defaults.items()}
    kind = mechanism.description.kind
    rotor = "Ir" if kind == "double_pendulum" else "rotor"
    out[rotor] = rng.uniform(0.0, 2e-5, shape)
    if kind == "double_pendulum":
        out["gr"] = rng.uniform(3.0, 20.0, shape)
        for link in "12":  # inertia about the joint, no smaller than that of a point mass
            point = out[f"m{link}"] * out[f"r{link}"] ** 2
            out[f"I{link}"] = point * rng.uniform(1.05, 2.0, shape)
    if kind == "pendulum":
        out["inertia"] = rng.uniform(0.0, 0.3, shape)
        out["gear"] = rng.uniform(3.0, 20.0, shape)
    return out


def states(mechanism, rng, shape=(200,)):
    q = rng.uniform(-np.pi, np.pi, (*shape, mechanism.n))
    return q, rng.uniform(-15.0, 15.0, (*shape, mechanism.n))


def random_case(mechanism, seed, shape=(200,)):
    """Base parameters, angles and velocities, one machine per row."""
    rng = np.random.default_rng(seed)
    return mechanism.base(physical(mechanism, rng, shape)), *states(mechanism, rng, shape)


def close(actual, expected, tolerance=1e-12):
    """Equal up to rounding, measured by the largest of the numbers compared."""
    scale = np.abs(np.asarray(expected)).max() + 1e-12
    np.testing.assert_allclose(actual, expected, rtol=tolerance, atol=tolerance * scale)


def gradient(f, x):
    """df/dx by complex steps, shape of f plus (n,); x has shape (..., n)."""
    steps = 1j * STEP * np.eye(x.shape[-1])
    return np.stack([f(x + step).imag / STEP for step in steps], axis=-1)


def assert_same_terms(a, b, tolerance=1e-12):
    for name, left, right in zip(a._fields, a, b, strict=True):
        assert left.shape == right.shape, name
        close(left, right, tolerance)
