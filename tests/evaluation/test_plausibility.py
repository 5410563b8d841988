"""Numbers of physical plausibility: planted violations are found, true friction passes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frictionid.evaluation.curves import (
    asymmetry,
    beyond_motion,
    cycle_work,
    dissipated,
    lowest_dissipation,
    tail_drop,
)
from frictionid.evaluation.statistics import information_criteria, trace_of_hat
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.fitting.sandwich import Groups, worth
from frictionid.friction import Friction, along
from frictionid.friction.laws import CoulombViscous, LuGre

GRID = np.linspace(-4.0, 4.0, 401)[:, None]
TRUE = 0.1 * np.sign(GRID) + 0.02 * GRID


def test_coulomb_and_viscous_friction_is_plausible():
    assert lowest_dissipation(GRID, TRUE) > 0.5
    assert asymmetry(GRID, TRUE) == pytest.approx(0.0, abs=1e-12)
    assert tail_drop(GRID, TRUE) < 0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_friction_that_drives_in_one_direction_is_found(side):
    drives = np.where(side * GRID > 3.0, -TRUE, TRUE)
    assert lowest_dissipation(GRID, drives) < -0.5
    assert np.sign(asymmetry(GRID, drives)) == -side


def test_a_falling_tail_is_found_in_either_direction():
    falls = np.where(np.abs(GRID) > 3.5, 0.5, 1.0) * TRUE
    for one in (falls, np.where(GRID > 0, falls, TRUE), np.where(GRID < 0, falls, TRUE)):
        assert tail_drop(GRID, one) > 0.3


def test_batches_and_joints_keep_their_places():
    both = np.concatenate([TRUE, -TRUE], axis=1)
    batch = np.stack([both, 2 * both])
    found = lowest_dissipation(np.repeat(GRID, 2, axis=1), batch)
    assert found.shape == (2, 2)
    assert_allclose(found[0], found[1])  # shares do not depend on the size
    assert (found[:, 0] > 0).all() and (found[:, 1] < -1).all()


def test_work_over_a_cycle_changes_sign_with_the_torque_and_not_with_a_spring():
    phase = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    w, spring = np.sin(phase), -np.cos(phase)  # a torque that follows the angle
    assert cycle_work(w, spring) == pytest.approx(0.0, abs=1e-12)
    assert cycle_work(w, -(w + spring)) == -cycle_work(w, w + spring)


def test_beyond_the_motion_laws_say_what_their_equation_says():
    theta = np.array([[[0.1, 0.02]], [[0.2, 0.0]]])
    found = beyond_motion(Friction(CoulombViscous(), theta), GRID)
    assert found.velocity[[0, -1], 0].tolist() == [-6.0, 6.0]
    assert_allclose(found.curves[:, -1, 0], [0.22, 0.2])
    assert_allclose(found.break_away, [[[0.1], [0.1]], [[0.2], [0.2]]])


def test_a_bristle_holds_by_its_memory_and_has_no_level_of_its_own():
    law = LuGre()
    theta = np.array(law.initial[0])[None, None]
    assert beyond_motion(Friction(law, theta), GRID).break_away.shape == (1, 2, 1)


def test_energy_of_the_true_friction_is_what_the_motion_implies():
    problem = synthetic_problem(joints=2)
    use = np.ones(len(problem.r), dtype=bool)
    implied, none = dissipated(problem, problem.r, use).sum(axis=-1)
    assert none == pytest.approx(0.0, abs=1e-12 * abs(implied))
    friction = Friction(CoulombViscous(), np.full((2, 2), 0.05))
    torque = problem.mean(along(friction, problem.nodes))
    w = problem.mean(problem.nodes.inputs.w)
    own = dissipated(problem, problem.residual(along(friction, problem.nodes)), use)[1]
    assert_allclose(own, problem.dt * (w * torque).sum(axis=-1), rtol=1e-9, atol=1e-15)


def test_a_prior_takes_from_the_trace_what_it_knows():
    rng = np.random.default_rng(0)
    J = rng.standard_normal((50, 3))
    H = J.T @ J
    ridge = np.full(3, 7.0)
    hat = J @ np.linalg.inv(H + np.diag(ridge)) @ J.T
    assert trace_of_hat(H, ridge) == pytest.approx(np.trace(hat), abs=1e-10)
    assert trace_of_hat(H, np.zeros(3)) == pytest.approx(3.0, abs=1e-10)
    assert trace_of_hat(H, np.full(3, 1e12)) < 1e-6


def test_a_parameter_must_save_more_than_it_costs():
    base = information_criteria([1.0, 2.0], [100.0, 100.0], 4)
    idle = information_criteria([1.0, 2.0], [100.0, 100.0], 5)
    good = information_criteria([0.8, 1.6], [100.0, 100.0], 5)
    assert idle == pytest.approx((base[0] + 2, base[1] + np.log(200)))
    assert good < base and good[1] < base[1]


@pytest.mark.parametrize("lasting, plain_errs", [(1, False), (20, True)])
def test_errors_that_last_do_not_make_a_richer_law_better(lasting, plain_errs):
    """A column too many is chosen in 16 % of the cases, as P(chi2 > 2) says, not in most."""
    chosen = []
    for seed in range(300):
        draw = np.random.default_rng(seed)
        X = draw.normal(size=(30, 20 // lasting, 2)).repeat(lasting, axis=1)
        e = draw.normal(size=(30, 20 // lasting)).repeat(lasting, axis=1)
        by_columns = []
        for D in (1, 2):
            H, g = np.einsum("gri,grj->gij", X, X)[:, :D, :D], np.einsum("gri,gr->gi", X, e)[:, :D]
            move = np.linalg.solve(H.sum(axis=0), g.sum(axis=0))
            left = float(((e - X[..., :D] @ move) ** 2).sum()) / e.size
            where = np.arange(30)
            groups = Groups(H / left, g / left, move, np.ones(D) > 0, where, where)
            count = worth(H.sum(axis=0) / left, groups)
            pairs = (D, None), (count, 30)
            by_columns.append(
                [information_criteria([left * e.size], [e.size], *pair)[0] for pair in pairs]
            )
        chosen.append(np.less(by_columns[1], by_columns[0]))
    plain, adjusted = np.mean(chosen, axis=0)
    assert 0.10 < adjusted < 0.22
    assert (plain > 0.5) == plain_errs
