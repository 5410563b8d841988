"""Analysis of memory: its advantage is divided as it was put in, and what is left is named."""

import pytest
from fixtures import result_folders as made

from frictionid.report.memory import memory_analysis

METHODS = {  # recipe: scheme, what corrects it, by how much memory is ahead
    "study": ("euler", [], 0.07),
    "late": ("euler", ["delay"], 0.03),
    "heavy": ("euler", ["inertia"], 0.05),
    "both": ("euler", ["delay", "inertia"], 0.02),
    "ours": ("integral", ["delay", "inertia"], 0.0),
}
WOBBLE = (0.001, -0.001, 0.002, -0.002)


def written(folder, left=0.0, rollout=0.0, methods=METHODS):
    """Results in which memory is ahead by known amounts; `left` where all is corrected."""
    tasks = [made.task("none", 0.61, 0.9, role="none", fit="study")]
    for fit, (scheme, corrects, ahead) in methods.items():
        ahead = left if fit == "ours" else ahead
        static = made.task("mlp", 0.44, 0.2, fit=fit)
        dynamic = made.task("lstm", 0.44 - ahead, 0.2 - rollout, noise=WOBBLE, fit=fit)
        dynamic["loops"] = [
            {"joint": joint, "kind": kind, "frequency": 1.0, "width": [0.1], "lag": [0.01]}
            | {"velocity": [1.0, 2.0], "torque": [[1.0, 1.0]]}
            for joint in (0, 1)
            for kind in ("reversing", "offset")
        ]
        for task in (static, dynamic):
            task["method"] = {"scheme": scheme, "corrects": corrects}
        tasks += [static, dynamic]
    return made.write(folder, tasks)


def analysed(*args):
    return memory_analysis(made.section(written(*args)).fitted)


def test_the_parts_of_an_advantage_are_those_that_corrections_take_away(tmp_path):
    found = analysed(tmp_path)
    assert [loss for _, loss in found["losses"]] == pytest.approx([0.61, 0.44, 0.37])
    assert (found["in_order"], found["folds"]) == (4, 4)
    assert found["raw"].mean == pytest.approx(0.07) and found["raw"].clear
    # both orders of correction: ((.07 - .03) + (.05 - .02)) / 2 and ((.07 - .05) + (.03 - .02)) / 2
    assert found["shares"] == pytest.approx({"delay": 0.035, "inertia": 0.015, "scheme": 0.02})
    assert sum(found["shares"].values()) == pytest.approx(0.07)
    assert found["remaining"].clear is False
    assert [pair.clear for _, pair in found["rollouts"]] == [False, False]


@pytest.mark.parametrize("left, rollout", [(0.01, 0.05), (-0.01, -0.05)])
def test_what_is_left_is_the_advantage_where_all_is_corrected(tmp_path, left, rollout):
    found = analysed(tmp_path, left, rollout)
    assert found["scheme"] == "integral" and len(found["corrects"]) == 2
    assert found["remaining"].mean == pytest.approx(left) and found["remaining"].clear
    assert [pair.mean for _, pair in found["rollouts"]] == pytest.approx([rollout / 2, rollout])


def test_corrections_that_are_known_together_alone_are_not_divided(tmp_path):
    some = {name: METHODS[name] for name in ("study", "both")}
    found = analysed(tmp_path, 0.0, 0.0, some)
    assert found["shares"] == pytest.approx({"delay and inertia": 0.05})


def test_the_page_names_what_is_left(tmp_path):
    said = made.words(made.undrawn(written(tmp_path)))
    assert "Advantage of memory, nothing corrected: 0.070 ± 0.001 rad/s" in said
    assert "delay of the torque 0.035 rad/s" in said
    assert "inertia that the nominal mechanism lacks 0.015 rad/s" in said
    assert "95 % interval with zero: no memory shows" in said
