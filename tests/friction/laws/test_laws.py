"""Friction laws: the contract, their curves, and what they refuse."""

import numpy as np
import pytest
import torch
from fixtures.exact_problems import (
    BY_DIRECTION,
    COULOMB,
    WAVES,
    assert_recovered,
    explained_by,
    fit_to_all,
    splines,
)
from fixtures.memory_laws import Sampled
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.friction import Friction, Inputs, at_rest
from frictionid.friction.law import smooth_sign
from frictionid.friction.laws import (
    Cogging,
    CoulombViscous,
    Dahl,
    FilmLag,
    GearLoad,
    LoadDependent,
    LuGre,
    MotorLoad,
    NoFriction,
    Play,
    Quadratic,
    Ripple,
    Spline,
    Spring,
    Stribeck,
    Sum,
    Thermal,
    check_law,
)

LAWS = [
    NoFriction(),
    *(MotorLoad(shape=shape) for shape in ("tanh", "arctan")),
    *(MotorLoad(squared=True), GearLoad(0.5), GearLoad(0.0, shape="arctan")),
    *(CoulombViscous(shape=shape) for shape in ("tanh", "arctan")),
    *(Stribeck(0.005), Stribeck(shape="arctan")),
    *(Stribeck(shape=shape, symmetric=False) for shape in ("tanh", "arctan")),
    *(CoulombViscous(shape="arctan", symmetric=False), Quadratic(shape="arctan")),
    LoadDependent(shape="arctan"),
    *(LoadDependent(stribeck=True), CoulombViscous(symmetric=False), Quadratic(), LoadDependent()),
    *(Spline(), Spline((1.0, 3.0), 1), Spline(degree=3), Spline(symmetric=False)),
    Spline(loaded=True),
    *(Ripple(), Ripple("stribeck", (1, 3), 7.0), Ripple(Stribeck(symmetric=False), (2,))),
    *(Sum(), Sum((MotorLoad(squared=True), "quadratic"), shape="arctan")),
]
REMEMBERING = [FilmLag(), FilmLag(symmetric=False), Dahl(), Dahl(motor_load=True), LuGre()]
REMEMBERING += [LuGre(symmetric=False)]
OTHERS = [
    *(Play(), Play("stribeck", "coulomb_viscous"), Play({"kind": "motor_load", "squared": True})),
    *(Thermal(base) for base in ("coulomb_viscous", Stribeck(symmetric=False), "quadratic")),
    *(Cogging((1, 7), 2.0), Sum(("coulomb_viscous", {"kind": "cogging", "harmonics": [7]}))),
    *(Spring(), Sum(("stribeck", "spring"))),
]
W = np.array([-20.0, -3.0, -0.5, -0.05, 0.05, 0.5, 3.0, 20.0])


def draws(law, seed, *batch):
    """Parameters of two joints, shape (*batch, 2, P)."""
    theta = np.random.default_rng(seed).uniform(0.05, 1.0, (*batch, 2, len(law.names)))
    theta *= np.minimum(1.0, [high for _, high in law.bounds])
    if "stribeck_velocity" in law.names:
        theta[..., law.names.index("stribeck_velocity")] *= 5.0
    return theta


def speeds(n=2):
    """Inputs at the velocities W, at places and under torques and loads that differ."""
    q, u, load = np.random.default_rng(7).uniform(-1.0, 1.0, (3, len(W), n))
    return Inputs(q, np.repeat(W[:, None], n, axis=1), u, 1.0 + load)


@pytest.mark.parametrize("law", [*LAWS, *REMEMBERING, *OTHERS, Sampled()], ids=str)
def test_laws_keep_to_the_contract(law):
    check_law(law)
    assert repr(law).startswith(type(law).__name__)


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_the_gradient_is_the_complex_step_derivative_of_the_torque(law):
    theta = draws(law, 0, 5, 1)
    gradient = law.gradient(theta, speeds())
    assert gradient.shape == (5, len(W), 2, len(law.names))
    for i in range(len(law.names)):
        step = np.zeros(theta.shape, dtype=complex)
        step[..., i] = 1e-30j
        slope = law.torque(theta + step, speeds(), ()).imag / 1e-30
        assert_allclose(gradient[..., i], slope, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("law", [*LAWS, *REMEMBERING], ids=str)
def test_laws_run_alike_on_torch(law):
    theta, x = draws(law, 1, 4, 1), speeds()
    memory, dt = law.start(theta, x._replace(w=-x.w)), np.array([0.003])

    def values(theta, x, memory, dt):
        yield from law.start(theta, x)
        yield from law.advance(theta, x, memory, dt)
        yield law.torque(theta, x, memory)
        yield law.limit(theta, x, memory)
        if not memory:
            yield law.gradient(theta, x)

    tensor = torch.as_tensor
    there = values(tensor(theta), x.each(tensor), tuple(map(tensor, memory)), tensor(dt))
    for found, expected in zip(there, values(theta, x, memory, dt), strict=True):
        assert_allclose(found.numpy(), expected, rtol=1e-13 if memory else 1e-14)


@pytest.mark.parametrize("law", [*LAWS, *REMEMBERING], ids=str)
def test_torque_has_slopes_in_torch_at_every_velocity(law):
    theta = torch.tensor(draws(law, 3, 4, 1), requires_grad=bool(law.names))
    w = torch.tensor([[0.0, 0.0], *speeds().w.tolist()], dtype=torch.float64, requires_grad=True)
    x = at_rest(w.detach().numpy()).each(torch.as_tensor)._replace(w=w)
    memory = law.advance(theta, x, law.start(theta, x), torch.tensor([0.01], dtype=torch.float64))
    law.torque(theta, x, memory).sum().backward()
    assert torch.isfinite(w.grad).all()
    assert theta.grad is None or torch.isfinite(theta.grad).all()


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_friction_opposes_motion_and_without_velocity_there_is_none(law):
    theta = draws(law, 2, 20, 1)
    assert (law.torque(theta, speeds(), ()) * W[:, None] >= 0).all()
    still = law.torque(theta[:, 0], at_rest(np.zeros(2)), ())
    assert_array_equal(still, np.zeros((20, 2)))


@pytest.mark.parametrize(
    ("law", "plain"),
    [
        *((law(), Stribeck()) for law in (FilmLag, LuGre)),
        *((law(symmetric=False), Stribeck(symmetric=False)) for law in (FilmLag, LuGre)),
        (Dahl(), CoulombViscous()),
    ],
    ids=str,
)
def test_at_constant_speed_a_memory_does_not_show(law, plain):
    theta, w = draws(law, 6), W[np.abs(W) > 0.1]
    expected = Friction(plain, theta[:, : len(plain.names)]).curve(w)
    assert_allclose(Friction(law, theta).curve(w), expected, rtol=1e-9)


def test_the_smoothing_is_written_in_rad_per_second():
    for shape, value in (("tanh", np.tanh(1.0)), ("arctan", 0.5)):
        law = CoulombViscous(width=0.3, shape=shape)
        torque = law.torque(np.array([[2.0, 0.0]]), at_rest(np.array([0.3])), ())
        assert torque[0] == pytest.approx(2.0 * value)


# a law, which of its parameters or inputs are zero, and the law that is left of it
SIMPLER = [
    (CoulombViscous(), ("coulomb", "viscous"), NoFriction()),
    (Stribeck(), ("peak",), CoulombViscous()),
    (Quadratic(), ("drag",), CoulombViscous()),
    *((MotorLoad(), (zero,), CoulombViscous()) for zero in ("loss", "u")),
    (MotorLoad(squared=True), ("rise",), MotorLoad()),
    *((LoadDependent(), (zero,), CoulombViscous()) for zero in ("load_coefficient", "load")),
    (LoadDependent(stribeck=True), ("load",), Stribeck()),
    (LoadDependent(stribeck=True), ("peak",), LoadDependent()),
    (Ripple(Stribeck(symmetric=False), (2,)), ("cos_2", "sin_2"), Stribeck(symmetric=False)),
    (Ripple(), ("cos_1", "sin_1"), CoulombViscous()),
]


@pytest.mark.parametrize(("law", "zeros", "simpler"), SIMPLER, ids=str)
def test_laws_hold_the_simpler_ones(law, zeros, simpler):
    x, theta = speeds(), draws(law, 3)
    theta[:, [name in zeros for name in law.names]] = 0.0
    x = x._replace(**{name: 0.0 * x.w for name in zeros if name in x._fields})
    numbers = theta[:, [law.names.index(name) for name in simpler.names]]
    assert_allclose(law.torque(theta, x, ()), simpler.torque(numbers, x, ()), rtol=1e-14)


def after(law, theta, x):
    """Torque and limit behind a motion that was slower before."""
    memory = law.start(theta, x.each(lambda part: 0.3 * part))
    memory = law.advance(theta, x, memory, np.array([0.003]))
    return law.torque(theta, x, memory), law.limit(theta, x, memory)


SIDED = pytest.mark.parametrize("law", [CoulombViscous, Stribeck, FilmLag, LuGre])


@SIDED
def test_turning_the_axis_round_swaps_the_directions(law):
    own, x = law(symmetric=False), speeds()
    theta = draws(own, 4)
    other = {"positive": "negative", "negative": "positive"}
    parts = [name.rpartition("_") for name in own.names]
    places = [own.names.index(a + b + other.get(c, c)) for a, b, c in parts]
    torque, limit = after(own, theta, x)
    back, same = after(own, theta[:, places], x._replace(w=-x.w))
    assert_allclose(back, -torque, rtol=1e-13)
    assert_allclose(same, limit, rtol=1e-13)


@SIDED
def test_with_equal_levels_of_both_directions_it_is_the_symmetric_law(law):
    own, plain, x = law(symmetric=False), law(), speeds()
    theta = draws(plain, 5)
    names = [name.removesuffix("_positive").removesuffix("_negative") for name in own.names]
    alike = theta[:, [plain.names.index(name) for name in names]]
    for found, expected in zip(after(own, alike, x), after(plain, theta, x), strict=True):
        assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize(
    "law",
    [
        *(CoulombViscous, Stribeck, Quadratic, LoadDependent, Spline, Ripple),
        *(FilmLag, Dahl, LuGre),
    ],
)
@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"width": 0.0}, "width = 0.0 rad/s must be positive"),
        ({"width": float("nan")}, "width: it should be a finite number, not nan"),
        ({"shape": "tan"}, "shape = 'tan' is unknown; known are tanh, arctan"),
    ],
)
def test_laws_refuse_settings_that_mean_nothing(law, settings, complaint):
    with assert_refused(complaint):
        law(**settings)


def test_the_smooth_sign_refuses_unknown_shapes():
    with pytest.raises(ValueError, match="'tanh' or 'arctan', got 'step'"):
        smooth_sign(np.zeros(1), 0.1, "step")


@pytest.mark.parametrize(
    "law", [Stribeck(), Stribeck(symmetric=False), LoadDependent(stribeck=True)], ids=str
)
def test_starts_cover_the_stribeck_velocities_of_slow_and_fast_joints(law):
    place = law.names.index("stribeck_velocity")
    velocities = np.array([start[place] for start in law.initial])
    assert velocities.min() < 0.001 and velocities.max() > 50.0
    assert (velocities[1:] / velocities[:-1] < 2).all()


# ---------------------------------------------------------------- truth in, truth out

SIDED_BASE = Stribeck(symmetric=False)
DRAG = np.array([[0.1, 0.02, 0.003], [0.05, 0.0, 0.001]])
SPLINES = [Spline((0.5, 1.5, 3.0, 6.0), degree) for degree in (1, 2, 3)]
SIDED_SPLINE = Spline((0.5, 1.5, 3.0, 6.0), symmetric=False)


# law, parameters of each joint, and how far off they may be if not 1e-6: relative, absolute
RECOVERED = [
    (Dahl(motor_load=True), [[0.1, 0.02, 0.01, 0.15], [0.05, 0.03, 0.004, 0.3]]),
    (
        FilmLag(symmetric=False),
        [[0.1, 0.12, 0.06, 0.05, 1.5, 0.02, 0.03], [0.05, 0.04, 0.04, 0.03, 2.5, 0, 0.1]],
        *(1e-6, 1e-9),
    ),
    (
        LuGre(symmetric=False),
        [
            [0.1, 0.12, 0.06, 0.05, 1.5, 0.02, 0.03, 0.1, 0.5],
            [0.05, 0.04, 0.04, 0.03, 2.5, 0.01, 0.01, 0.1, 0.5],
        ],
    ),
    (CoulombViscous(symmetric=False), [[0.1, 0.14, 0.02], [0.05, 0.03, 0.01]], 1e-9),
    (Ripple("coulomb_viscous", (1, 2), 3.0), np.hstack([COULOMB, WAVES]), 1e-5, 1e-7),
    (Ripple(SIDED_BASE, (1, 2), 3.0), np.hstack([BY_DIRECTION, WAVES]), 1e-5, 1e-7),
    *((law, splines(law), 1e-6, 1e-9) for law in SPLINES),
    (SIDED_SPLINE, splines(SIDED_SPLINE), 1e-5, 1e-7),
    (LoadDependent(), [[0.04, 0.01, 0.02], [0.02, 0.005, 0.01]]),
    (LoadDependent(stribeck=True), [[0.04, 0.03, 1.5, 0.01, 0.02], [0.02, 0.03, 2.5, 0.005, 0.01]]),
    (Sum(), [[0.1, 0.04, 1.5, 0.02, 0.15], [0.05, 0.03, 0.8, 0.01, 0.3]]),
]
RECOVERED += [(Quadratic(), DRAG * k, 1e-8, 1e-12) for k in ([1, 1, 1], [0, 1, 1], [0, 0, 100])]
GAPS = (0.0079, 0.008, 0.0081, 0.0093, 0.012, 0.03)
RECOVERED += [(Play(), [[0.1, 0.02, gap], [0.05, 0.02, 2 * gap]], 1e-3) for gap in GAPS]
for way in (0.003, 0.1):
    both = [[0.1, 0.02, way], [0.05, 0.02, way / 2]]
    RECOVERED += [(Dahl(), both), (Dahl(), both * np.array([[100, 100, 1], [1, 1, 1]]))]
    RECOVERED += [(LuGre(), [[0.1, 0.06, ws, 0.02, way, 0.3, 0.5]]) for ws in (1.5, 4.0)]
for lag in (0.01, 0.3):
    RECOVERED += [(FilmLag(), [[0.1, 0.06, ws, 0.02, lag]]) for ws in (0.6, 4.0)]


@pytest.mark.parametrize("case", RECOVERED, ids=lambda case: str(case[0]))
def test_truth_in_truth_out(case):
    assert np.ptp(synthetic_problem(2).nodes.inputs.load, axis=0).min() > 1.0
    assert_recovered(*case)


def test_drag_alone_is_told_from_coulomb_friction_with_noise():
    problem = explained_by(Quadratic(), DRAG[:1] * [0, 0, 1], 1e-3)
    found = fit_to_all(LeastSquares(Quadratic()), problem).theta[0, 0]
    assert found[2] == pytest.approx(0.003, rel=0.05) and found[0] < 0.002


def test_drag_grows_with_the_square_of_the_velocity_and_opposes_it():
    w = np.array([-8.0, -4.0, 4.0, 8.0])
    drag = Friction(Quadratic(), DRAG * [0, 0, 1]).curve(w)[:, 0]
    assert_allclose(drag, [-0.192, -0.048, 0.048, 0.192])
