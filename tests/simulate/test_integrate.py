"""The simulator's physics: set-valued friction, its events, and its memory."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from fixtures.true_curves import plain_friction
from numpy.random import default_rng
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear

from frictionid.mechanics import acrobot, pendulum
from frictionid.simulate import Curve, FilmLag, LoadFriction, LuGre, Stribeck
from frictionid.simulate import integrate as engine
from frictionid.simulate.integrate import TrueSystem, derivative, integrate_motion, next_modes

ACROBOT = acrobot()
CURVE = Curve(
    coulomb_positive=(0.165, 0.055),
    coulomb_negative=(0.165, 0.050),
    viscous=(0.004, 0.0008),
    peak_positive=(0.0, 0.028),
    peak_negative=(0.0, 0.036),
    stribeck_velocity=(1.0, 2.0),
)
LUGRE = LuGre(CURVE, (40.0, 12.0), (0.1, 0.02), (0.1, 0.1))
TRUTHS = {
    "coulomb_viscous": plain_friction((0.165, 0.055), (0.004, 0.0008)),
    "stribeck": Stribeck(CURVE),
    "film_lag": FilmLag(CURVE, (0.015, 0.015)),
    "lugre": LUGRE,
}
each_truth = pytest.mark.parametrize("truth", TRUTHS.values(), ids=TRUTHS)


def system(truth, mechanism=ACROBOT):
    return TrueSystem(mechanism, mechanism.base({}), truth)


def wheel(truth):
    """One joint of inertia 0.25 kg m^2 without gravity."""
    mechanism, own = pendulum(), {"length": 0.5, "g": 0.0}
    return TrueSystem(mechanism, mechanism.base(own), truth, own)


def step_of(truth):
    return 1 / 60 / (32 if truth is LUGRE else 8)


def driven(truth, substeps, seconds=0.25):
    """States of four acrobots under a torque that changes 60 times a second."""
    rng = default_rng(5)
    edges = np.arange(round(60 * seconds) + 1) / 60
    u = np.zeros((len(edges) - 1, 4, 2))
    u[..., 1] = 0.14 * np.sin(2 * np.pi * rng.uniform(0.7, 2.5, 4) * edges[:-1, None])
    start = rng.uniform(-2.0, 2.0, (4, 2))
    return integrate_motion(system(truth), start, 0 * start, u, edges, 1 / (60 * substeps))


# Events


@each_truth
def test_halving_the_step_divides_the_error_by_sixteen(truth):
    coarse, seconds = (64, 0.1) if truth is LUGRE else (12, 0.25)
    states = [driven(truth, coarse * factor, seconds)[:, :2] for factor in (1, 2, 4)]
    errors = [np.sqrt(((s - states[-1]) ** 2).mean()) for s in states[:-1]]
    # against the fourth of the step, order 4 makes it 17
    assert np.log2(errors[0] / errors[1]) == pytest.approx(np.log2(17.0), abs=0.5)
    assert np.abs(states[1] - states[2]).max() < 1e-6


def test_coulomb_friction_stops_a_wheel_when_it_should():
    truth = Stribeck(Curve((0.05,), (0.03,), (0.0,)))
    start = np.array([[2.0], [-1.0], [0.0]])
    end = integrate_motion(
        wheel(truth), 0 * start, start, np.zeros((1, 3, 1)), np.array([0, 20.0]), 0.07
    )[-1]
    way = np.array([2.0**2 * 0.25 / (2 * 0.05), -(1.0**2) * 0.25 / (2 * 0.03), 0.0])
    assert end[0].ravel() == pytest.approx(way, abs=1e-9)
    assert np.array_equal(end[1], np.zeros((3, 1)))


PEAKED = Curve((0.5,), (0.4,), (0.001,), (0.3,), (0.2,), (1.0,))


@pytest.mark.parametrize(
    ("truth", "torques"),
    [
        (Stribeck(PEAKED), (0.799, 0.82, -0.599, -0.62)),
        (FilmLag(PEAKED, (0.02,)), (0.799, 0.82, -0.599, -0.62)),
        # the motor that would move a joint presses it, too: up to coulomb / (1 - motor)
        (LoadFriction(PEAKED, motor=(0.2,)), (0.99, 1.01, -0.74, -0.76)),
    ],
)
def test_a_joint_sticks_up_to_break_away_and_slips_above(truth, torques):
    modes = next_modes(wheel(truth), np.zeros((3, 4, 1)), np.array(torques)[:, None])
    assert modes.ravel().tolist() == [0.0, 1.0, 0.0, -1.0]


def test_a_joint_breaks_away_when_its_load_reaches_the_level():
    """Until then the acrobot is one rigid pendulum, and the torque in its joint is known."""
    q, w, u, edges = np.zeros((1, 2)), np.array([[5.0, 0.0]]), np.zeros((60, 1, 2)), np.arange(61)
    loose, rigid = (
        integrate_motion(here, q, w, u, edges / 60, 1 / 600)
        for here in (system(plain_friction((0.0, c), (0.0, 0.0))) for c in (0.05, 9.0))
    )
    M, h = ACROBOT.dynamics(ACROBOT.base({}), rigid[:, 0, 0], rigid[:, 1, 0])
    load = h[:, 1] - M[:, 0, 1] * h[:, 0] / M[:, 0, 0]
    first = int(np.argmax(np.abs(load) > 0.05))
    assert 2 < first < 60
    assert np.array_equal(loose[:first], rigid[:first])
    assert (loose[:first, 1, 0, 1] == 0).all()
    assert loose[first, 1, 0, 1] != 0


def test_endless_changes_within_a_step_end_in_rest(monkeypatch):
    expected = driven(TRUTHS["stribeck"], 24)
    monkeypatch.setattr(engine, "_MAX_EVENTS", 1)
    assert 0.0 < np.abs(driven(TRUTHS["stribeck"], 24) - expected).max() < 0.1


def test_modes_agree_with_the_principle_of_least_constraint():
    """Friction at rest is what brings the accelerations nearest to none; no combinations needed."""
    rng = default_rng(2)
    w = rng.normal(size=(300, 2)) * rng.integers(0, 2, (300, 2))  # half of the joints at rest
    y = np.stack([rng.uniform(-np.pi, np.pi, (300, 2)), w, rng.uniform(0, 3, (300, 2))])
    u = rng.normal(size=(300, 2)) * 0.3
    for name in ("stribeck", "film_lag"):
        here = system(TRUTHS[name])
        modes = next_modes(here, y, u)
        found = derivative(here, y, u, modes)[1]
        assert len(np.unique(modes, axis=0)) == 9
        for r in range(300):
            assert found[r] == pytest.approx(_least_constraint(here, y[:, r], u[r]), abs=1e-6)


def _least_constraint(here, y, u):
    """Accelerations with the friction Tf in its band that minimises (f - Tf)' M^-1 (f - Tf)."""
    q, w, z = y
    M, h = here.mechanism.dynamics(here.p, q, w)
    ends = [here.torque(y, u, np.where(w == 0, s, np.sign(w))) for s in (-1.0, 1.0)]
    root = np.linalg.cholesky(np.linalg.inv(M)).T
    bounds = (ends[0] - 1e-12, ends[1] + 1e-12)
    Tf = lsq_linear(root, root @ (h + u), bounds, method="bvls", tol=1e-15).x
    return np.linalg.solve(M, h + u - Tf)


def test_a_loaded_joint_slips_at_the_level_of_its_load():
    """One joint against the formula, term by term, in all cases of its square."""
    truth = LoadFriction(
        *(Curve((0.1,), (0.1,), (0.01,), (0.05,), (0.05,), (2.0,)), (0.02,), (0.2,), (0.1,)),
        *((0.05,), (0.04,), (0.03,), (0.02,), 1.5),
    )
    machine, own = pendulum(), {"mass": 0.5, "length": 0.3}
    here = TrueSystem(machine, machine.base(own), truth, own)
    rng = default_rng(2)
    q, w, u = rng.uniform(-2, 2, (3, 200, 1))
    inertia, gravity = here.p
    a = (u - gravity * np.sin(q)) / inertia  # free of friction: what presses the bearing
    N = 0.5 * np.hypot(0.3 * a + 9.81 * np.sin(q), 0.3 * w**2 + 9.81 * np.cos(q))
    te = -1.5 * np.sin(q)
    square = np.where(u * te < 0, np.where(abs(u) > abs(te), 0.02 * te**2, 0.03 * u**2), 0.0)
    peaks = 0.05 + abs(0.05 * u - 0.04 * te) + square
    level = 0.1 + 0.02 * N + abs(0.2 * u - 0.1 * te) + np.exp(-((w / 2.0) ** 2)) * peaks
    found = derivative(here, np.stack([q, w, 0 * w]), u, np.sign(w))[1]
    Tf = level * np.sign(w) + 0.01 * w
    assert found == pytest.approx((u - gravity * np.sin(q) - Tf) / inertia, abs=1e-9)


# Energy and symmetry


@each_truth
def test_energy_falls_without_input(truth):
    rng = default_rng(3)
    q, w = rng.uniform(-1.5, 1.5, (3, 2)), rng.normal(size=(3, 2)) * (2.0, 5.0)
    here = system(truth)
    u, edges = np.zeros((180, 3, 2)), np.arange(181) / 60
    states = integrate_motion(here, q, w, u, edges, step_of(truth))
    energy = here.mechanism.terms(here.p, states[:, 0], states[:, 1]).energy
    if truth is LUGRE:  # a bent bristle stores energy
        energy = energy + (0.5 * np.array(LUGRE.bristle_stiffness) * states[:, 2] ** 2).sum(axis=-1)
    assert np.diff(energy, axis=0).max() < 1e-9
    assert (energy[-1] < energy[0] - 0.05).all()
    speed = np.abs(states[-1, 1]).max()
    assert speed < 0.1 if truth is LUGRE else speed == 0.0


@each_truth
def test_the_mirrored_rig_moves_mirrored(truth):
    turned = {
        f"{part}_{side}": getattr(truth.curve, f"{part}_{other}")
        for part in ("coulomb", "peak")
        for side, other in (("positive", "negative"), ("negative", "positive"))
    }
    mirrored = replace(truth, curve=replace(truth.curve, **turned))
    q, u = np.array([[1.2, -0.7]]), np.full((40, 1, 2), (0.0, 0.13))
    edges, step = np.arange(41) / 60, step_of(truth)
    one = integrate_motion(system(truth), q, 0 * q, u, edges, step)
    other = integrate_motion(system(mirrored), -q, 0 * q, -u, edges, step)
    assert one[:, :2] == pytest.approx(-other[:, :2], abs=1e-8)


def test_a_batch_equals_its_recordings_alone():
    rng = default_rng(4)
    q, u = rng.uniform(-2, 2, (4, 2)), rng.normal(size=(15, 4, 2)) * (0.0, 0.1)
    edges = np.arange(16) / 60
    for truth in TRUTHS.values():
        step = step_of(truth)
        batch = integrate_motion(system(truth), q, 0 * q, u, edges, step)
        alone = integrate_motion(system(truth), q[2:3], 0 * q[2:3], u[:, 2:3], edges, step)
        assert batch[:, :, 2:3] == pytest.approx(alone, abs=1e-10)


# Friction with memory


@pytest.mark.parametrize("name", ["film_lag", "lugre"])
def test_memory_ends_on_the_steady_state_curve(name):
    truth = TRUTHS[name]
    for speed in (-20.0, -1.0, -0.05, 0.05, 1.0, 20.0):
        w = np.full((1, 2), speed)
        mode = np.sign(w)
        after = solve_ivp(
            lambda _, z, w=w, mode=mode: truth.rate(w, z[None], mode)[0],
            (0.0, 0.3 + 0.3 / abs(speed)),
            np.zeros(2),
            method="LSODA",
            rtol=1e-10,
            atol=1e-14,
        ).y[:, -1]
        expected = CURVE.torque(w, mode)
        assert truth.torque(w, after[None], mode) == pytest.approx(expected, rel=1e-5)
        assert truth.torque(w, truth.start(w), mode) == pytest.approx(expected, rel=1e-12)
        assert truth.rate(w, truth.start(w), mode) == pytest.approx(0.0 * w, abs=1e-12)


def test_film_lag_delays_the_curve_and_not_the_direction():
    truth = FilmLag(CURVE, (0.015, 0.015))
    w, mode = np.array([[-0.01, -0.01]]), np.array([[-1.0, -1.0]])
    fast = truth.torque(w, np.array([[10.0, 10.0]]), mode)
    slow = truth.torque(w, np.array([[0.0, 0.0]]), mode)
    assert (fast < 0).all()
    assert fast[0, 1] - slow[0, 1] == pytest.approx(0.036, rel=1e-3)  # the peak comes back late


def test_lugre_takes_energy_in_every_cycle():
    dt = 1e-4
    frequency, height = np.array([[1.0, 1.0, 5.0, 20.0], [0.02, 5.0, 0.3, 0.5]])[..., None]
    z, work, least = np.zeros((4, 2)), np.zeros((4, 2)), 0.0
    for k in range(10_000):  # the midpoint rule over 1 s, whole cycles of all
        now, then = (
            height * np.sin(2 * np.pi * frequency * t) * np.ones(2)
            for t in (k * dt, (k + 0.5) * dt)
        )
        half = z + 0.5 * dt * LUGRE.rate(now, z, np.sign(now))
        work += dt * then * LUGRE.torque(then, half, np.sign(then))
        z = z + dt * LUGRE.rate(then, half, np.sign(then))
        least = min(least, (work - 0.5 * np.array(LUGRE.bristle_stiffness) * z**2).min())
    assert least > -1e-6  # it never gives back more than the bristle stores
    assert (work > 1e-4).all()


def test_lugre_bends_before_it_slips():
    truth = LuGre(Curve((0.5,), (0.5,), (0.0,)), (100.0,), (1.0,), (0.1,))
    u = np.array([[0.2], [0.6]])
    q = np.zeros((2, 1))
    end = integrate_motion(wheel(truth), q, q, u[None], np.array([0.0, 3.0]), 1e-3)[-1]
    assert end[2, 0, 0] == pytest.approx(0.2 / 100.0, rel=0.01)
    assert 0.001 < end[0, 0, 0] < 0.02  # shaking lets a bristle creep
    assert abs(end[1, 0, 0]) < 1e-3
    assert end[0, 1, 0] > 1.0


@pytest.mark.parametrize(
    ("build", "reason"),
    [
        (lambda: Curve((0.1,), (0.1, 0.1), (0.0,)), "one number for each of 1 joints"),
        (lambda: Curve((-0.1,), (0.1,), (0.0,)), "greater than or equal to 0"),
        (lambda: Curve((0.1,), (0.1,), (np.nan,)), "a finite number"),
        (lambda: Curve((0.1,), (0.1,), (0.0,), stribeck_velocity=(0.0,)), "greater than 0"),
        (lambda: FilmLag(CURVE, (0.01, 0.0)), "lag.*greater than 0"),
        (lambda: LuGre(CURVE, (40.0, 0.0), (0.1, 0.1), (0.1, 0.1)), "greater than 0"),
        (
            lambda: replace(LUGRE, bristle_damping=(0.1, 5.0)),
            r"joint 2: LuGre is passive if .* lower bristle_damping",
        ),
    ],
)
def test_impossible_friction_is_refused(build, reason):
    with assert_refused(reason):
        build()
