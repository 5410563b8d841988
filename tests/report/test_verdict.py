"""The verdict: its rule on result folders, its document, and what scripts may require of it."""

import json

import numpy as np
import pytest
from fixtures import result_folders as made

from frictionid.api.comparison import load_comparison
from frictionid.comparison.results import load_results
from frictionid.report import results_json, show, write
from frictionid.report.summary_table import summary_of, summary_table
from frictionid.report.terminal import verdict as words_of
from frictionid.report.verdict import verdict_of

SHARED = [0.001, -0.001, 0.002, -0.002]
LOUD = [0.02, -0.02, 0.01, -0.01]


def verdict(folder, tasks, **changes):
    """The verdict on a folder of these tasks."""
    return verdict_of(made.section(folder, tasks, **changes))


def model(name, error, *, size=4, noise=SHARED, role="fitted"):
    """A model with an error [rad] after 1 s, half of it after 0.5 s, and a number of parameters."""
    task = made.task(name, 0.3, error, noise=noise, role=role)
    task["rows"]["made"][-1][5] = float(size)
    return task


def test_a_simple_model_that_is_hardly_worse_is_enough(tmp_path):
    found = verdict(tmp_path, [model("rich", 0.2, size=40), model("plain", 0.204)])
    assert (found.kind, found.recommended) == ("simple_enough", "plain")
    assert "0 of 1 other models are practically worse, 1 not practically better" in found.sentence
    assert (found.folds, found.recordings, found.horizon) == (4, 5, 0.5)
    rich, plain = found.candidate("rich"), found.candidate("plain")
    assert rich.standing == "best" and rich.loss is None
    ratios = (0.102 + np.array(SHARED)) / (0.1 + np.array(SHARED))  # of the recordings
    assert plain.loss.measured.value == pytest.approx(np.exp(np.log(ratios).mean()))


def test_a_rich_model_is_recommended_where_simple_ones_are_practically_worse(tmp_path):
    found = verdict(tmp_path, [model("rich", 0.2, size=40), model("plain", 0.3)])
    assert (found.kind, found.recommended) == ("recommended", "rich")
    assert found.candidate("plain").standing == "worse"


def test_data_that_cannot_tell_say_so_and_how_much_to_record(tmp_path):
    found = verdict(tmp_path, [model("rich", 0.4, size=40), model("plain", 0.43, noise=LOUD)])
    assert (found.kind, found.recommended, found.provisional) == ("undecided", None, "rich")
    assert "cannot tell whether plain is enough or rich is needed" in found.sentence
    assert "recordings in place of 5" in found.record_next


def test_a_refined_model_is_taken_where_the_simpler_one_was_not_refined_and_is_farther_off(
    tmp_path,
):
    """By one recipe the data cannot tell the two apart; only one of them was fitted by a better."""
    rich, plain = model("rich", 0.4, size=40), model("plain", 0.43, noise=LOUD)
    refined = made.shot([made.parameter("friction", "coulomb", 0.1, 0.01, joint=0)])
    shot = made.task("rich", 0.3, 0.1, noise=SHARED, fit="shooting", refined=refined)
    for task in (rich, plain):
        task["method"] = {"corrects": ["inertia"]}
    found = verdict(tmp_path, [rich, plain, shot])
    assert (found.kind, found.recommended) == ("recommended", "rich (shooting)")
    assert "plain (integral), which was not refined, is 4." in found.sentence
    assert "these data cannot tell it from rich (integral)" in found.sentence


@pytest.mark.parametrize(
    "noise, recommended",
    [(LOUD, "a (shooting)"), (SHARED, "a (integral)")],
    ids=["undecided", "worse"],
)
def test_the_law_is_delivered_by_shooting_unless_that_is_shown_to_be_worse(
    noise, recommended, tmp_path
):
    of_one_step = model("a", 0.1)
    of_one_step["method"] = {"corrects": ["inertia"]}
    refined = made.shot([made.parameter("friction", "coulomb", 0.1, 0.01, joint=0)])
    shot = made.task("a", 0.3, 0.116, noise=noise, fit="shooting", refined=refined)
    found = verdict(tmp_path, [of_one_step, shot, model("none", 0.9, size=0, role="none")])
    assert found.recommended == recommended


def test_a_recording_that_a_model_misses_is_the_main_doubt(tmp_path):
    found = verdict(tmp_path, [model("a", 0.01, noise=[0, 0, 0.3, 0]), model("b", 0.9, size=9)])
    assert found.recommended == "a"
    assert found.main_doubt == "In recording 3 of 5 its error is 61 times that in most others."


@pytest.mark.parametrize(
    "term, error, recommended",
    [("coulomb", 0.01, "rich (shooting)"), ("coulomb", 0.1, "terms"), ("sign_1", 0.01, "terms")],
)
def test_a_law_with_the_terms_of_a_sum_and_an_identified_parameter_is_taken(
    tmp_path, term, error, recommended
):
    """Where errors cannot tell: the interval may be that of the law's fit by another recipe."""
    rich, plain = model("rich", 0.43, size=9, noise=LOUD), model("terms", 0.4)
    refined = made.shot([made.parameter("friction", "loss", 0.1, error, joint=0)])
    shot = made.task("rich", 0.3, 0.43, fit="shooting", refined=refined)
    for joint in rich["model"]["joints"]:
        joint["loss"] = {"value": 0.1, "unit": "1"}
    for joint in plain["model"]["joints"]:
        joint[term] = joint.pop("coulomb")
        joint["viscous"]["value"] = 0.0
    plain["model"]["provenance"] = {"equation": ["Tf1 = 0.1 N m s(w)"]}
    for task in (rich, plain):
        task["method"] = {"corrects": ["inertia"]}
    found = verdict(tmp_path, [rich, plain, shot])
    assert found.candidate("rich (integral)").standing == "undecided"
    assert found.recommended.startswith(recommended)
    adds = "it adds a parameter that these data identify" in found.sentence
    assert adds == (recommended == "rich (shooting)")


def test_the_truth_is_never_recommended(tmp_path):
    found = verdict(tmp_path, [model("ours", 0.2), model("truth", 0.1, size=0, role="truth")])
    assert found.recommended == "ours" and len(found.candidates) == 1
    assert made.answers(found)["truth"] == "no"


def test_published_numbers_that_were_fitted_to_these_recordings_are_never_recommended(tmp_path):
    paper = model("paper", 0.1, role="given")
    tasks = [model("ours", 0.2), paper]
    assert verdict(tmp_path / "a", tasks).recommended == "paper"
    paper["model"]["provenance"] = {"data": {"any.csv": "of these"}}
    seen = {"made": {"run.csv": "of these"}}
    assert verdict(tmp_path / "b", tasks, data=seen).recommended == "ours"
    others = {"made": {"run.csv": "of others"}}
    assert verdict(tmp_path / "c", tasks, data=others).recommended == "paper"


def test_a_model_that_diverges_in_a_fold_is_not_recommended(tmp_path):
    found = verdict(tmp_path, [model("plain", 0.1, noise=[0, 0, 0, float("inf")]), model("b", 0.2)])
    assert found.recommended == "b" and found.candidate("plain").standing == "diverged"


def test_without_folds_every_question_is_not_evaluated_with_a_reason(tmp_path):
    tasks = [made.task("a", folds=2)]
    found = verdict(tmp_path, tasks)
    assert found.kind == "not_evaluated" and found.recommended is None
    assert {q.answer for q in found.questions} == {"not_evaluated"}
    assert all("errors are known of 2 recordings or folds" in q.reason for q in found.questions)


def test_without_predictions_there_is_no_verdict_but_a_reason(tmp_path):
    found = verdict(tmp_path, [made.task("a", horizons=())])
    assert found.sentence == "No verdict: the comparison predicts no motion."
    assert [c.name for c in found.candidates] == ["a"]  # its checks stand, all the same


def test_motion_that_hardly_shows_friction_does_not_show_that_there_is_none(tmp_path):
    found = verdict(tmp_path, [model("none", 0.2, role="none"), model("plain", 0.203, size=9)])
    assert found.recommended == "plain"
    assert made.answers(found)["friction"] == "no"


def test_the_document_says_every_question_with_its_answer(typical):
    document = json.loads((typical / "verdict.json").read_text())
    (only,) = document["datasets"]
    assert only["recommended"] == "stribeck (integral)"
    answers = {q["name"]: q["answer"] for q in only["questions"]}
    assert answers["friction"] == "yes" and answers["published"] == "yes"
    assert answers["physics"] == "not_evaluated"
    assert all(q["reason"] for q in only["questions"])
    assert "verdict.json" in (typical / "SHA256SUMS").read_text()


@pytest.mark.parametrize(
    "requirement, status, words",
    [
        ("recommended", 0, ""),
        ("friction=yes", 0, ""),
        ("undecided", 1, "made: verdict is recommended, not undecided"),
        ("friction=no", 1, "made: friction is yes, not no"),
        ("recomended", 2, "did you mean 'recommended'?"),
        ("frction=yes", 2, "did you mean 'friction'?"),
    ],
)
def test_scripts_require_a_verdict(tmp_path, monkeypatch, requirement, status, words, run):
    monkeypatch.setattr(write, "_contents", lambda *_: {})  # tables and figures are not the matter
    made.typical(tmp_path / "made")
    code, _, err = run(tmp_path, "report made --require", requirement)
    assert code == status and words in err and err.count("\n") == bool(words)


# --- In the terminal, and as JSON -----------------------------------------------------------------


def test_the_verdict_is_that_of_the_page_of_the_summary_and_of_the_loaded_folder(typical, capsys):
    """It is printed last, before the path."""
    section, loaded = made.section(typical), load_comparison(typical)
    assert loaded.verdict.sentence == verdict_of(section).sentence
    assert [v.dataset for v in loaded.verdicts] == ["made"]
    said = words_of(section)
    assert said.startswith("- Use stribeck (integral), 0.050 rad off after 0.5 s")
    show(load_results(typical))
    page = typical.resolve() / "index.html"
    assert capsys.readouterr().out.endswith(f"{said}\n\n{page}\n")
    for line in said.splitlines():
        assert line in (typical / "summary.md").read_text()
        assert line.removeprefix("- ").partition(": ")[2] in made.words(typical)


def test_scripts_get_the_summary_as_json(tmp_path, monkeypatch, run):
    monkeypatch.setattr(write, "_contents", lambda *_: {})
    folder = made.typical(tmp_path / "made")
    code, out, err = run(tmp_path, "report made --json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert document == json.loads(results_json(load_results(folder))) | {"folder": "made"}
    held_out, unseen = document["datasets"]
    assert held_out["verdict"] == words_of(made.section(folder)) and unseen["verdict"] == ""
    best = next(m for m in held_out["models"] if m["recipe"] == "integral")
    assert best["rollout_angle_median_1s"] == 0.1


def test_given_models_are_ranked_with_the_fitted_ones(tmp_path):
    tasks = [
        made.task("none", 0.3, 0.9, role="none"),
        made.task("ours", 0.3, 0.3),
        made.task("paper", role="given"),
    ]
    section = made.section(tmp_path, tasks)
    assert "Use paper, 0.10 rad off after 0.5 s; 2 of 2 other models are" in words_of(section)
    table = summary_table(summary_of(section.fitted), "")
    bold = {line.cells[0].text: any(cell.best for cell in line.cells) for line in table.lines}
    assert bold == {"none": False, "ours": True, "paper": True}  # one step ahead they are level


def test_fits_to_torques_are_judged_by_the_torque_that_they_leave(tmp_path):
    """Whatever their predictions, which drift off without the controller of the arm."""
    rng, fold = np.random.default_rng(5), np.repeat(np.arange(made.FOLDS), 20)
    noise = 0.02 * rng.standard_normal((len(fold), 2))
    off = {"poor": noise + 0.1 * rng.choice([-1, 1], noise.shape), "good": noise}
    tasks = []
    for name, rollout in (("poor", 0.1), ("good", 0.3)):
        share = float(np.sqrt((off[name] ** 2).sum(axis=1).mean()))
        task = made.task(name, 0.3, rollout) | {"method": {"scheme": "inverse dynamics"}}
        task["rows"]["made"].append(["all", "torque_left", "share", None, "all", share, "1"])
        torque = {"torque": off[name], "torque_fold": fold, "torque_recording": 0 * fold}
        tasks.append(task | {"errors": task["errors"] | torque})
    verdict = verdict_of(made.section(tmp_path, tasks))
    assert verdict.recommended == "good" and np.isnan(verdict.horizon)
    assert f"Use good, which leaves {100 * share:.2g} % of the torque; 1 of 1" in verdict.sentence
    assert verdict.candidate("poor").loss.factor.value > 3.0
