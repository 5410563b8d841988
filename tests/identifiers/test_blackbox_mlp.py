"""The mlp without physics: a known acceleration found again, files, seeds, refusals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from fixtures.black_box_pendulum import acceleration, found, pendulum

from frictionid.comparison.cross_validate import compare
from frictionid.comparison.registry import IDENTIFIERS, LAWS
from frictionid.errors import InputError
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.friction import Friction, along
from frictionid.friction.laws import StateMLP, check_law, members_of
from frictionid.friction.model_files import load_model, save_model
from frictionid.identifiers import BlackBox, Network, StateNetwork, check_identifier
from frictionid.identifiers.formulation import INTEGRAL, training_problem
from frictionid.identifiers.residual import sliding
from frictionid.identifiers.synthetic_problem import synthetic_problem
from frictionid.mechanics import unit_inertia_plant

SMALL = StateMLP(hidden=(4,))
BOX = IDENTIFIERS["blackbox_mlp"](hidden=[16], epochs=60, batch=64)


@cache
def learned() -> Friction:
    return found(BOX)


def test_the_acceleration_of_a_pendulum_is_learned() -> None:
    nodes = training_problem(pendulum(), unit_inertia_plant(pendulum()), INTEGRAL).nodes
    true = acceleration(*nodes.inputs[:3])
    error = -along(learned(), nodes) - true
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean(true**2))


def test_it_predicts_what_was_held_out() -> None:
    folds = make_folds(pendulum().recordings, Split(count=2))
    protocol = Protocol((0.25,), every=0.5)
    (result,) = compare(pendulum(), {"box": BOX}, folds, protocol=protocol).values()
    changes = training_problem(pendulum(), unit_inertia_plant(pendulum()), INTEGRAL).r
    left = result.value("one_step_integral", "rms")
    assert left < 0.5 * np.sqrt(np.mean(changes**2))
    assert result.value("rollout_angle", "median", 0.25) < 0.1
    assert np.isnan(result.curves).all()  # it is no friction curve


def test_it_keeps_to_the_contract() -> None:
    check_law(SMALL, level=False)
    check_identifier(BlackBox(StateNetwork(Network(SMALL, epochs=2))))


def test_another_seed_gives_another_network() -> None:
    problem = synthetic_problem(1)
    weights = np.ones((1, len(problem.r)))
    box = BlackBox(StateNetwork(Network(SMALL, epochs=1)))
    one, two = (box.fit(problem, weights, seed).theta for seed in (0, 1))
    assert not np.allclose(one, two)


def test_a_file_holds_all_of_it(tmp_path) -> None:
    save_model(learned(), tmp_path / "box.json", LAWS)
    back = load_model(tmp_path / "box.json", LAWS)
    assert back.mechanism == "unit" and back.law == learned().law
    assert np.array_equal(back.theta, learned().theta)


@pytest.mark.parametrize(
    ("settings", "words"),
    [({"hidden": [0]}, "hidden"), ({"epochs": 0}, "epochs"), ({"width": -1.0}, "width")],
)
def test_settings_that_mean_nothing_are_refused(settings, words) -> None:
    with pytest.raises(InputError, match=words):
        IDENTIFIERS["blackbox_mlp"](**settings)


def test_rows_that_are_open_at_rest_are_refused() -> None:
    problem = sliding(synthetic_problem(1), 1.0)
    with pytest.raises(InputError, match="rest = 0"):
        BOX.fit(problem, np.ones((1, len(problem.r))), 0)


@pytest.mark.parametrize("kind", ["blackbox_mlp", "blackbox_lstm"])
def test_an_ensemble_is_the_mean_of_its_members_from_a_file_too(kind, tmp_path) -> None:
    problem = synthetic_problem(1)
    box = IDENTIFIERS[kind](members=2, epochs=1)
    friction = box.fit(problem, np.ones((1, len(problem.r))), 0)[0]
    each = along(members_of(friction), problem.nodes)
    assert np.abs(each[0] - each[1]).max() > 0
    np.testing.assert_allclose(along(friction, problem.nodes), each.mean(axis=0), rtol=1e-12)
    save_model(friction, tmp_path / "box.json", LAWS)
    back = load_model(tmp_path / "box.json", LAWS)
    assert back.law == friction.law and np.array_equal(back.theta, friction.theta)
