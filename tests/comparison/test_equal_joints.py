"""Joints declared equal: truth in, truth out, narrower intervals, and a test whether they are."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fixtures.exact_problems import everything, half_widths
from fixtures.mistakes import mistakes
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from fixtures.true_curves import plain_friction
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.arrays import times
from frictionid.comparison.cross_validate import complexity_score
from frictionid.comparison.equal_joints import LEVEL, differences
from frictionid.data.servo import Servo, servo_torque
from frictionid.data.signals import Signal
from frictionid.evaluation.statistics import effective_parameters
from frictionid.fitting.identifiers import LeastSquares, SINDy
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.fitting.one_step.recipe import covariance_of_fit, one_step_fit
from frictionid.fitting.parameter_block import values_of, with_values
from frictionid.fitting.parameters import ActuatorBlock, FrictionBlock, GainBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.fitting.shooting.stages import prepare_fit
from frictionid.friction import DataRange, Friction, along, constraints_of
from frictionid.friction.laws import CoulombViscous, Dahl, Spline, Stribeck
from frictionid.simulate import Camera, Rig, Run, Sine, Steps, simulate, write_dataset

EQUAL = ((1, 2),)


def problem_of(law, theta, noise=0.0, twins=False, seed=0):
    """One-step problem of two joints with friction; of twins, uncoupled, with the same motion."""
    problem = synthetic_problem(2, 0.0)
    if twins:
        nodes = problem.nodes
        inputs = nodes.inputs._replace(w=np.repeat(nodes.inputs.w[:, :1], 2, axis=1))
        G = problem.G[:, :1, :1] * np.eye(2)
        problem = replace(problem, nodes=nodes._replace(inputs=inputs), G=G)
    torque = problem.mean(along(Friction(law, np.array(theta)), problem.nodes))
    r = times(problem.G, torque)
    return replace(problem, r=r + noise * np.random.default_rng(seed).standard_normal(r.shape))


LAWS = (CoulombViscous(), Stribeck(), Spline((1.0, 4.0)))
TRUTHS = ([0.1, 0.02], [0.1, 0.04, 1.5, 0.02], [0.1, 0.14, 0.2])


@pytest.mark.parametrize("law, true", [*zip(LAWS, TRUTHS, strict=True)])
def test_truth_in_truth_out(law, true):
    problem = problem_of(law, [true] * 2)
    found = LeastSquares(law, equal=EQUAL).fit(problem, np.ones((2, len(problem.r))), 0).theta
    assert (found[:, 0] == found[:, 1]).all()
    assert_allclose(found[:, 0], [true] * 2, rtol=1e-6)


@pytest.mark.parametrize("law", LAWS[:2], ids=str)
def test_the_fit_is_the_least_squares_one_among_equal_joints(law):
    """Joints that are not equal: no other common parameters leave less."""
    problem = problem_of(Stribeck(), [[0.1, 0.04, 1.5, 0.02], [0.06, 0.03, 2.0, 0.01]], 1e-3)
    found = LeastSquares(law, equal=EQUAL, robust=None).fit(problem, everything(problem), 0)

    def cost(theta):
        return float(
            (problem.residual(along(Friction(found.law, theta), problem.nodes)) ** 2).sum()
        )

    best = cost(found.theta[0])
    for i in range(found.theta.shape[-1]):
        for sign in (1, -1):
            moved = found.theta[0].copy()
            moved[:, i] *= 1 + sign * 1e-3
            assert cost(moved) > best


def test_joints_that_are_not_named_keep_their_own():
    range_ = DataRange(np.full((1, 4), 0.1), np.full((1, 4), 5.0))
    own = constraints_of(CoulombViscous(), range_, equal=((1, 3),)).at(0)
    assert own.owner.tolist() == [0, 1, 0, 3]
    assert own.tie.shape == (8, 6) and (own.tie.sum(axis=1) == 1).all()


def test_intervals_of_two_equal_joints_are_narrower_by_the_root_of_two():
    """Twins with the same motion and noise of their own, 20 sets, seeds 0 to 19."""
    law, squares = CoulombViscous(), []
    for seed in range(20):
        problem = problem_of(law, [[0.1, 0.02]] * 2, 1e-3, twins=True, seed=seed)
        weights = everything(problem)
        tied, apart = (
            half_widths(LeastSquares(law, equal=e).fit(problem, weights, 0)[0], problem, weights[0])
            for e in (EQUAL, ())
        )
        squares.append([(tied**2).mean(axis=0), (apart**2).mean(axis=0)])
    tied, apart = np.sqrt(np.mean(squares, axis=0))
    assert_allclose(tied / apart, np.sqrt(0.5), rtol=0.1)


def test_equal_joints_count_their_parameters_once():
    problem = problem_of(CoulombViscous(), [[0.1, 0.02]] * 2, 1e-3)
    weights = everything(problem)
    for equal, count in (((), 4.0), (EQUAL, 2.0)):
        fit = LeastSquares(CoulombViscous(), equal=equal).fit(problem, weights, 0)[0]
        assert effective_parameters(fit, problem, weights[0]) == pytest.approx(count)


def test_a_prior_as_wide_as_the_data_takes_half_of_its_parameter():
    """Two routes: standard errors between stretches, and the trace of the hat matrix."""
    problem, law = synthetic_problem(1, 1e-3), CoulombViscous()
    weights = everything(problem)
    plain = LeastSquares(law).fit(problem, weights, 0)[0]
    covariance, _ = covariance_of_fit(plain, problem, weights[0])
    for i, name in enumerate(law.names):
        prior = {name: (float(plain.theta[0, i]), float(np.sqrt(covariance[i, i])))}
        fit = LeastSquares(law, prior=prior).fit(problem, weights, 0)[0]
        assert effective_parameters(fit, problem, weights[0]) == pytest.approx(1.5, abs=0.02)


def p_values(second, seed):
    """P-values of the test of twins whose second joint has another friction."""
    law = CoulombViscous()
    problem = problem_of(law, [[0.1, 0.02], second], 1e-3, twins=True, seed=seed)
    weights = everything(problem)
    fit = one_step_fit(LeastSquares(law).fit(problem, weights, 0), problem, weights[0])
    return differences(fit, EQUAL)


def test_equal_joints_pass_and_unequal_ones_are_named():
    """200 sets of equal twins, seeds 0 to 199: at most 3 % at a level of 1 %; 20 unequal ones."""
    alarms = [min(d.p_value for d in p_values([0.1, 0.02], k)) < LEVEL for k in range(200)]
    assert np.mean(alarms) <= 0.03
    for seed in range(20):
        named = {d.parameter for d in p_values([0.11, 0.02], seed) if d.p_value < LEVEL}
        assert named == {"coulomb"}


# --- Shooting, and what a user sees ---------------------------------------------------------------


def rig(levels):
    """A double pendulum with a motor at each joint: set-valued friction, four runs of 2.5 s."""
    runs = tuple(
        Run(f"r{k}", (0.4 * k - 1, 0.3 * k), torques=(Steps(0.9, 0.3 + 0.05 * k), Sine(0.5, 0.9)))
        for k in range(4)
    )
    friction = plain_friction(levels, [0.01, 0.01])
    table = {"kind": "double_pendulum", "driven": [True, True]}
    camera = Camera(samples=150, angle_noise=0.001)
    return Rig("two", table, friction, camera, runs, seed=7, substeps=4)


@shared
def equal_data():
    return simulate(rig((0.08, 0.08)))


def test_shooting_finds_the_common_friction_with_narrower_intervals(equal_data):
    law = fid.CoulombViscous()
    shot = {"method": "shooting", "free": ["friction"]}
    tied = fid.fit(equal_data, law, equal=[["joint 1", "joint 2"]], **shot)
    apart = fid.fit(equal_data, law, **shot)
    theta = tied.friction.theta
    assert (theta[0] == theta[1]).all()
    assert_allclose(theta[0], [0.08, 0.01], rtol=0.01)
    one, other = (
        f.frame.sort_values(["joint", "parameter"], ignore_index=True)[["low_95", "high_95"]]
        for f in (tied, apart)
    )
    assert (one.high_95 - one.low_95 < other.high_95 - other.low_95).all()
    assert tied.covariance.loc["coulomb of joint 1", "coulomb of joint 2"] == pytest.approx(
        tied.covariance.loc["coulomb of joint 1", "coulomb of joint 1"]
    )
    speeds = DataRange(np.full((1, 2), 0.1), np.full((1, 2), 9.0))
    for equal, count in ((EQUAL, 2.0), ((), 4.0)):
        limits = constraints_of(law, speeds, equal=equal).at(0)
        start = replace(tied.friction, constraints=limits)
        assert complexity_score(refine(start, equal_data, (FrictionBlock(),))).value == count
    assert "joints 1 and 2: fitted apart, they do not differ" in repr(tied)


def servo_driven(data):
    """The recordings as if servos drove both joints, to where these are a little later."""

    def driven(recording):
        time, q = recording.angle.time, np.asarray(recording.angle.value)
        goal, on = Signal(time, q + 0.2 * np.sin(3 * time)[:, None]), np.ones(q.shape)
        on[len(on) // 2 :, 0] = 0.0
        numbers = {"gain": 3.0, "limit": 1.0, "supply": 7.0, "kt": 0.4, "R": 4.0}
        servo = Servo(goal, Signal(time, on, "previous"), **numbers)
        return replace(recording, servo=servo, torque=servo_torque(servo, recording.angle))

    return replace(data, recordings=tuple(map(driven, data.recordings)))


@pytest.mark.parametrize("servo", [False, True], ids=["torque", "servo"])
@pytest.mark.parametrize("law", [CoulombViscous(), Dahl()], ids=["static", "memory"])
def test_derivatives_by_common_parameters_are_sums_of_each_joints(equal_data, servo, law):
    data = servo_driven(equal_data) if servo else equal_data
    data = replace(data, recordings=data.recordings[:2])
    names = data.mechanism.base_names
    blocks = (FrictionBlock(), InertiaBlock(fixed=tuple(names[:-1])))
    blocks += (ActuatorBlock(prior=0.1),) if servo else (GainBlock(),)
    theta, range_ = np.array([law.initial[0]] * 2), DataRange(np.full(2, 1e-3), np.full(2, 20.0))
    by = []
    for equal in (EQUAL, ()):
        friction = Friction(law, theta, constraints=constraints_of(law, range_, equal=equal))
        problem, estimate = prepare_fit(friction, intervals_of(data), blocks, Settings())
        rows = np.arange(0, len(problem.intervals.dt), 7)
        lines = problem.linearise(estimate, problem.initial_nodes(estimate), rows)
        by.append(lines.by[rows])
        values = values_of(estimate, problem.blocks)
        moved = with_values(estimate, problem.blocks, 1.1 * values).friction.theta
        assert_allclose(moved, 1.1 * theta)
    tied, apart = by
    P = len(law.names)
    assert tied.shape[-1] == P + 3
    both = apart[..., :P] + apart[..., P : 2 * P]
    assert_allclose(tied[..., :P], both, atol=1e-12 * np.abs(both).max())
    assert_allclose(tied[..., P:], apart[..., 2 * P :], rtol=1e-12)


def test_the_command_names_joints_that_are_not_equal(tmp_path, run):
    write_dataset(simulate(rig((0.08, 0.04))), tmp_path / "data")
    line = "fit data --identifier coulomb_viscous --by shooting --free friction --out m.json"
    code, out, err = run(tmp_path, line, "--equal", "joint 1, 2")
    assert code == 0, err
    assert "joints 1 and 2 are not equal: fitted apart, coulomb is 0.0" in out
    assert fid.load_model(tmp_path / "m.json").friction.provenance.equality


REFUSED = r"""
[["joint 1", "joint 3"]] => there is no joint 'joint 3'; did you mean
[[1, 3]]                 => equal = \[\[1, 3\]\]: each group names two joints or more by their
[[1]]                    => each group names two joints or more
[[1, 2, 2]]              => names a joint twice
[[1, 2], [2, 1]]         => names a joint twice
[1, 2]                   => must be groups of joints, such as
"""


@mistakes(REFUSED)
def test_joints_that_cannot_be_equal_are_refused_in_one_line(equal_data, wrong, words):
    with assert_refused(words):
        fid.fit(equal_data, "coulomb_viscous", equal=json.loads(wrong))


def test_what_holds_no_joints_equal_refuses_in_one_line(equal_data):
    for law in (SINDy(), "mlp", "none"):
        with assert_refused("holds no joints equal: laws with parameters do"):
            fid.fit(equal_data, law, equal=EQUAL)
    with assert_refused("these joints have different laws"):
        fid.fit(equal_data, ["stribeck", "coulomb_viscous"], equal=EQUAL)
    with assert_refused("inverse dynamics gives each joint parameters of its own"):
        fid.fit(equal_data, "coulomb_viscous", equal=EQUAL, method="inverse_dynamics")
