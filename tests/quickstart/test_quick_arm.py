"""frictionid quick of an arm: laws are fitted to torques, and judged by the torque they leave."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.changed_data import changed
from fixtures.shared import shared

import frictionid as fid
from frictionid.check import check
from frictionid.data.recordings import Dataset
from frictionid.quickstart.plan import BY_ANGLES, BY_TORQUES, plan_for
from frictionid.quickstart.quick import quick
from frictionid.quickstart.quick_report import quick_figure, quick_json, verdict
from frictionid.report.figures.style import png


@shared
def data(tmp_path_factory):
    """Ten seconds of an arm with Coulomb and viscous friction in four parts, 1 % of noise."""
    arm = wrist.mechanism(tmp_path_factory.mktemp("arm"))
    return wrist.dataset(arm, wrist.frame(arm, 10.0, rate=100.0))


FRICTION = BY_TORQUES.recipe.model_copy(update={"free": ["friction"]})
PLAN = BY_TORQUES._replace(recipe=FRICTION, laws=BY_TORQUES.laws[:3], folds=3)


@shared
def result(data):
    """The verdict on three laws."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("frictionid.quickstart.quick.plan_for", lambda _: PLAN)
        return quick(data)


def test_the_true_friction_is_found(result):
    assert [c.name for c in result.candidates] == list(PLAN.steps[1:])
    assert result.chosen.name == "coulomb_viscous"
    w = np.array([-0.5, 0.5])
    true = np.sign(w)[:, None] * wrist.COULOMB + w[:, None] * wrist.VISCOUS
    np.testing.assert_allclose(result.friction.curve(w), true, rtol=0.02)


def test_it_is_judged_by_the_torque_left(result):
    """The noise alone is left, and more without friction."""
    assert np.isnan(result.horizon) and result.folds == PLAN.folds
    by_name = {c.name: c for c in result.candidates}
    assert result.chosen.error < 0.02 < by_name["none"].error
    assert by_name["none"].standing == "worse"
    assert result.chosen.torque["left"].iloc[-1] == result.chosen.error


def test_the_words_and_the_picture_are_of_torques(result):
    words, text = " ".join(verdict(result)), repr(result)
    assert "of the torque on held-out motion" in words and "rad" not in words
    assert "Practically worse" in words and "torque left" in text and "N m" in text
    document = json.loads(quick_json(result))
    assert document["horizon"] is None and document["verdict"] == verdict(result)
    assert png(lambda: quick_figure(result)).startswith(b"\x89PNG")


def test_many_inertial_parameters_are_counted_and_not_listed(result):
    friction = result.refined.parameters[0]
    inertial = [
        replace(friction, block="inertia", name=f"Ixx_{k}", identified=k < 3) for k in range(30)
    ]
    for count, listed in ((30, False), (5, True)):
        parameters = (friction, *inertial[:count])
        text = repr(replace(result, refined=replace(result.refined, parameters=parameters)))
        assert friction.name in text and ("Ixx_4" in text) == listed
        assert ("30 inertial parameters, 3 of them identified" in text) != listed


def test_the_method_is_that_of_a_fit(data):
    acrobot = fid.load_dataset("acrobot_clean")
    assert plan_for(data) is BY_TORQUES and plan_for(acrobot) == BY_ANGLES
    idle = np.arange(data.mechanism.n) > 0
    by_angles = plan_for(changed(data, "torque", lambda u: u * idle))
    assert by_angles.recipe == BY_ANGLES.recipe and by_angles.folds < BY_ANGLES.folds
    assert {*BY_ANGLES.steps} - {*by_angles.steps} == {"stribeck_asymmetric", "spring"}
    assert {law.label for law in by_angles.further} == {"ripple", "cogging", "spring"}


ROBOT = """<robot name="r"><link name="base"/><link name="part"><inertial><mass value="20"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="{kind}"><parent link="base"/><child link="part"/><axis xyz="0 0 1"/>
<limit lower="-9" upper="9" effort="900" velocity="9"/></joint></robot>"""


@pytest.mark.parametrize("kind", ["continuous", "prismatic"])
def test_a_wheel_may_have_drag_and_a_hoist_is_not_dropped(tmp_path, kind):
    """Along a vertical axis: of a wheel no weight loads the gear, a cage would fall to its end."""
    (tmp_path / "r.urdf").write_text(ROBOT.format(kind=kind))
    time = np.linspace(0.0, 6.0, 600)
    log = {"time": time, "angle": np.sin(2 * time), "torque": 10 * np.cos(3 * time)}
    machine = {"urdf": str(tmp_path / "r.urdf")}
    data = Dataset.from_arrays({"a": log, "b": log}, machine, hold="linear")
    steps = plan_for(data).steps
    assert ("quadratic" in steps, "load_dependent" in steps) == (kind[0] == "c", kind[0] == "p")
    assert not any("free decay" in advice for advice in check(data).next)
