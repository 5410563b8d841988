"""frictionid quick: the law that made the data, by a stated rule, in one verdict."""

import io
import json
import re
import shlex
import shutil
from contextlib import redirect_stdout
from dataclasses import replace

import numpy as np
import pytest
from drive_logs import ServoPendulum
from fixtures.changed_data import changed, each, subset
from fixtures.lab_tables import MACHINE, recordings, write_lab_tables
from fixtures.paths import ROOT
from fixtures.printed import assert_alike
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.servo_logs import by_torque
from fixtures.shared import shared
from fixtures.tiny_pendulums import dataset as tiny
from fixtures.tiny_pendulums import recordings as recordings_of_tiny

from frictionid.__main__ import main
from frictionid.check.findings import percent
from frictionid.comparison import cross_validate
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.data.servo import open_loop
from frictionid.errors import InputError, NoFitError
from frictionid.fitting.fit import UNEXPLAINED
from frictionid.friction.laws import Spline
from frictionid.mechanics import linear_axis
from frictionid.quickstart.plan import BY_ANGLES, plan_for
from frictionid.quickstart.quick import quick, shortened
from frictionid.quickstart.quick_report import against_nominal, quick_figure, quick_json, verdict
from frictionid.report.figures.style import png
from frictionid.simulate import Curve

LAWS = BY_ANGLES.steps[1:-1]
PAGE = ROOT / "docs/quickstart.md"


def shown(name):
    """Arguments of a command on the page for newcomers, and what the page shows below it."""
    blocks = re.findall(r"^```console\n\$ (.*)\n((?:.*\n)*?)```", PAGE.read_text(), re.MULTILINE)
    found = {shlex.split(command)[1]: (shlex.split(command)[1:], text) for command, text in blocks}
    return found[name]


def assert_shown(printed, text):
    """Check that a command prints every line of the page, in its order, but for its notes."""
    lines = (line for line in text.splitlines() if not line.strip().startswith("- "))
    assert_alike(printed, "\n".join(lines))  # which windows are left out depends on the machine


@shared
def place(shared_path):
    """A folder with the tables of the page for newcomers in `arm`, described by its `init`."""
    (shared_path / "arm").mkdir()
    for table in (ROOT / "docs/quickstart").glob("*.csv"):
        shutil.copy(table, shared_path / "arm")
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()) as out:
        patch.chdir(shared_path)
        patch.setattr("sys.argv", ["frictionid", *shown("init")[0]])
        assert main() == 0
    assert out.getvalue().strip() == shown("init")[1].strip()
    return shared_path


@shared
def found(place):
    """The verdict on these tables, and the steps that were reported."""
    steps = []
    return quick(load_dataset(place / "arm"), steps.append), steps


@shared
def result(found):
    return found[0]


def test_the_true_law_is_found_with_its_numbers(found):
    result, steps = found
    assert steps == list(BY_ANGLES.steps)
    assert result.check.level == "good" and result.chosen.name == "stribeck"
    w = result.velocity[:, 0]
    use = np.abs(w) > 0.05
    true = Curve((0.08,), (0.08,), (0.010,), (0.03,), (0.03,), (0.8,))
    true = true.torque(w[:, None], np.sign(w)[:, None])[use, 0]
    off = result.chosen.curves[-1][use, 0] - true
    assert np.sqrt(np.mean(off**2)) < 0.05 * np.sqrt(np.mean(true**2))
    names = [e.name for e in result.refined.parameters if e.block == "friction"]
    assert names == [f"{n} of joint 1" for n in ("coulomb", "peak", "stribeck_velocity", "viscous")]


def test_the_verdict_is_the_simplest_law_that_is_shown_to_predict_as_the_best(result):
    assert [c.name for c in result.candidates] == list(LAWS)
    assert all(len(c.by_fold) == result.folds for c in result.candidates)
    good = [c for c in result.candidates if c.standing in ("best", "adequate") and c.parameters]
    assert result.chosen is min(good, key=lambda c: c.parameters)


def test_the_words_and_the_numbers_agree(result):
    words = " ".join(verdict(result))
    assert words.startswith("Verdict: stribeck, Tf = (coulomb + peak")
    assert "Practically worse than" in words and "no friction, coulomb_viscous" in words
    document = json.loads(quick_json(result))
    assert document["chosen"] == "stribeck" and document["verdict"] == verdict(result)
    errors = {c["name"]: c["error"] for c in document["candidates"]}
    assert errors == {c.name: c.error for c in result.candidates}
    assert errors["stribeck"] < 0.2 * errors["none"]


@pytest.mark.parametrize(
    "worse, sentence",
    [
        ({"none"}, "Practically worse than spline: no friction."),
        (set(), "No other law is practically worse than spline."),
    ],
)
def test_no_friction_does_not_read_as_no_law(result, worse, sentence):
    standings = {name: "undecided" for name in LAWS} | dict.fromkeys(worse, "worse")
    standings["spline"] = "best"
    candidates = [replace(c, standing=standings[c.name]) for c in result.candidates]
    assert sentence in verdict(replace(result, candidates=tuple(candidates)))


def test_a_mass_that_is_not_nominal_is_said(result):
    """With the nominal mass 5 % too large, and with the true one."""
    read = [e for e in result.refined.parameters if e.block == "inertia"]
    wrong = [replace(e, nominal=1.05 * e.value) for e in read]
    (said,) = against_nominal(replace(result.refined, parameters=wrong))
    assert re.findall(r" by (.*?) %", said) == ["−4.76"] * len(wrong)
    right = [replace(e, nominal=e.value) for e in read]
    assert against_nominal(replace(result.refined, parameters=right)) == []


def test_torque_that_noise_does_not_leave_is_said(result):
    sound = result.chosen.torque
    assert (sound.left < sound.noise).all() and "of the torque" not in " ".join(verdict(result))
    torque = sound.assign(left=2.0 * sound.noise)
    said = verdict(replace(result, chosen=replace(result.chosen, torque=torque)))
    share = f"{percent(2.0 * sound.noise.iloc[-1])} of the torque, noise of the angles at most"
    assert sum(share in sentence for sentence in said) == 1


@pytest.mark.parametrize(
    "said",
    [
        "Not free, and would show: 'offset' (p = 3e-16). Free them.",
        f"Angle 1 is predicted 282 times worse than it is measured: {UNEXPLAINED}.",
    ],
)
def test_doubts_about_the_chosen_fit_are_said(result, said):
    """Also where too little motion was held out to compare laws."""
    doubted = replace(result, refined=replace(result.refined, warnings=("Odd.", said)))
    for one in (doubted, replace(doubted, folds=1)):
        assert said in verdict(one) and "Odd." not in verdict(one)
        assert said[:20] in repr(one) and said in json.loads(quick_json(one))["verdict"]
    assert said not in verdict(result)


def test_it_is_said_why_another_law_than_that_of_the_smallest_error_is_best(result):
    said = "The table has medians over all motion; the rule weighs all recordings alike"
    assert said not in " ".join(verdict(result))
    worst = [replace(c, error=1.0 if c.standing == "best" else c.error) for c in result.candidates]
    assert said in " ".join(verdict(replace(result, candidates=tuple(worst))))


def test_the_picture_is_one_and_always_the_same(result):
    picture = png(lambda: quick_figure(result))
    assert picture.startswith(b"\x89PNG") and picture == png(lambda: quick_figure(result))


def test_laws_beyond_the_colours_have_another_line(result):
    again = tuple(replace(c, name=f"{c.name} again") for c in result.candidates[-4:])
    many = replace(result, candidates=result.candidates + again)
    *lines, _ = quick_figure(many).legends[0].get_lines()
    assert len(lines) == len(BY_ANGLES.laws) - 1 + len(again)
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == len(lines)


def test_the_legend_speaks_of_loads_where_a_curve_depends_on_one(result):
    others = tuple(c for c in result.candidates if c.name not in ("load_dependent", "motor_load"))

    def legend(result):
        return [text.get_text() for text in quick_figure(result).legends[0].get_texts()]

    assert "each fold; all without load" in legend(result)
    assert legend(replace(result, candidates=others))[-1] == "each fold"


# --- The page for newcomers -----------------------------------------------------------------------


def test_the_command_says_what_the_page_shows(result, place, monkeypatch, run):
    def quick(_loaded, _done, checked, _jobs):
        checked(result.check)
        return result

    monkeypatch.setattr("frictionid.quickstart.quick.quick", quick)
    monkeypatch.setenv("COLUMNS", "110")
    arguments, text = shown("quick")
    code, out, err = run(place, *arguments)
    assert code == 0
    assert_shown(out + err, text)
    assert (place / "quick-arm.png").read_bytes() == png(lambda: quick_figure(result))
    code, out, err = run(place, *arguments)
    assert code == 0 and "written to quick-arm-2.png" in err
    outcome = run(place, *arguments, "--figure", "quick-arm.png")
    assert_one_line(outcome, "quick-arm.png exists")
    code, out, _ = run(place, *arguments, "--json", "--replace")
    assert code == 0 and json.loads(out) == json.loads(quick_json(result))


def test_what_the_check_says_is_printed_before_a_law_is_fitted(place, monkeypatch, run):
    def stopped(*_):
        raise InputError("stopped")

    monkeypatch.setattr("frictionid.quickstart.quick._compared", stopped)
    _, out, err = run(place, *shown("quick")[0])
    assert out.startswith("arm: the data are good\n")
    assert err == "1 of 10 done: check\nfrictionid: stopped\n"
    assert "law" not in run(place, *shown("quick")[0], "--json")[1]


def test_the_other_commands_of_the_page_run_too(place, monkeypatch, run):
    monkeypatch.setenv("COLUMNS", "110")
    for name in ("fit", "predict"):
        arguments, text = shown(name)
        code, out, err = run(place, *arguments)
        assert code == 0, name
        assert_shown(out + err, text)
    assert (place / "friction.png").exists() and (place / "predicted.csv").exists()


def test_the_intervals_on_the_page_hold_the_truth():
    truth = {"coulomb": 0.08, "peak": 0.03, "stribeck_velocity": 0.8, "viscous": 0.010}
    line = r"^ (\w+) of joint 1 .*\[([\d.]+), ([\d.]+)\]"
    intervals = re.findall(line, shown("quick")[1], re.MULTILINE)
    assert {name for name, *_ in intervals} == set(truth)
    for name, low, high in intervals:
        assert float(low) <= truth[name] <= float(high)


# --- Too little motion ----------------------------------------------------------------------------


def test_a_richer_law_is_chosen_for_a_parameter_that_shows_and_this_is_said(result):
    assert "but has a parameter" not in " ".join(verdict(result))
    factor = next(c.loss for c in result.candidates if c.loss)
    standings = {"coulomb_viscous": "best", "stribeck": "undecided"}
    near = [
        replace(c, standing=standings.get(c.name, "worse"), loss=factor) for c in result.candidates
    ]
    chosen = next(c for c in near if c.name == "stribeck")
    words = verdict(replace(result, candidates=tuple(near), chosen=chosen))
    assert any(w.startswith("coulomb_viscous predicts best; stribeck is ") for w in words)
    assert any(w.endswith("but has a parameter that these data identify.") for w in words)


def test_folds_without_motion_say_nothing(result):
    still = replace(result, folds=2, chosen=result.candidates[-1])
    assert any("Too little motion was held out" in words for words in verdict(still))
    assert result.folds == 5
    tied = [replace(c, standing="undecided") if c.name == "none" else c for c in result.candidates]
    words = " ".join(verdict(replace(result, candidates=tuple(tied))))
    assert "No friction at all is not shown to be practically worse" in words


def test_unusable_data_get_no_verdict_and_a_model_that_says_so(tmp_path, run):
    result = quick(changed(Dataset("turned", MACHINE, recordings()), "torque", np.negative))
    assert result.check.level == "unusable" and result.chosen is None and verdict(result) == []
    write_lab_tables(tmp_path / "arm", sign=-1.0)
    own = tmp_path / "arm/dataset.toml"
    own.write_text(
        'name = "arm"\n[mechanism]\nkind = "pendulum"\nparameters = { mass = 0.4, length = 0.25 }\n'
        '[columns]\ntime = "t_ms"\nangle = "pos_deg"\ntorque = "I_motor"\n'
        '[units]\ntime = "ms"\nangle = "deg"\ntorque = "A"\n[motor]\nkt = 0.035\ngear = 9.0\n'
        '[recordings]\npatterns = "*.csv"\n'
    )
    code, out, err = run(tmp_path, "quick arm")
    assert (code, err) == (2, "1 of 10 done: check\n") and "has the wrong sign" in out
    assert "No law was fitted" in out and not (tmp_path / "quick.png").exists()
    line = "fit arm --identifier coulomb_viscous --by one_step --out m.json --json"
    code, out, err = run(tmp_path, line)
    (words,) = json.loads(out)["provenance"]["limits"]
    assert (code, err) == (2, "") and words.startswith("the data are unusable: angle 1 has the wr")


def test_a_law_that_cannot_be_fitted_is_no_candidate(monkeypatch):
    def run(benchmark, identifier, *rest):
        if isinstance(getattr(identifier, "law", None), Spline):
            raise NoFitError("spline: too steep")
        return cross_validate.run(benchmark, identifier, *rest)

    laws = tuple(law for law in BY_ANGLES.laws if law.kind in ("none", "coulomb_viscous", "spline"))
    few_laws = BY_ANGLES._replace(laws=laws, further=())
    monkeypatch.setattr("frictionid.quickstart.quick.plan_for", lambda _: few_laws)
    monkeypatch.setattr("frictionid.quickstart.quick.run", run)
    few = tiny(recordings=recordings_of_tiny()[:4])
    result = quick(few)
    assert [c.name for c in result.candidates] == ["none", "coulomb_viscous"]
    assert result.not_fitted == ("spline: spline: too steep",) and "not fitted" in repr(result)
    fewer = few_laws._replace(laws=laws[::2])
    monkeypatch.setattr("frictionid.quickstart.quick.plan_for", lambda _: fewer)
    with assert_refused("spline: too steep"):
        quick(few)


def test_laws_that_are_fitted_side_by_side_have_the_same_numbers(monkeypatch):
    plan = BY_ANGLES._replace(laws=BY_ANGLES.laws[:2], further=BY_ANGLES.further[:1])
    monkeypatch.setattr("frictionid.quickstart.quick.plan_for", lambda _: plan)
    few, steps = subset(tiny(), 0, 3), []
    assert quick_json(quick(few, steps.append, jobs=2)) == quick_json(quick(few))
    assert sorted(steps) == sorted(plan.steps)


def test_what_one_step_shows_of_position_joins_the_laws(monkeypatch):
    """Magnets that pull by two thirds of the Coulomb level, which does not change itself."""
    plan = BY_ANGLES._replace(laws=BY_ANGLES.laws[:2], further=BY_ANGLES.further[:2])
    monkeypatch.setattr("frictionid.quickstart.quick.plan_for", lambda _: plan)
    servo = ServoPendulum(waves=((6, 0.02, 0.6),))
    logs = {f"{k}": servo.log(20.0, 0.2, seed=k, seconds=6.0) for k in range(4)}
    none, plain, cogging = quick(by_torque(servo, logs)).candidates
    assert plain.standing == "worse" and cogging.name == "cogging"
    assert cogging.error < 0.2 * plain.error < 0.2 * none.error


def test_the_share_of_a_motor_is_a_candidate_where_a_motor_drives():
    logged = subset(tiny(), 0, 1)
    passive = changed(logged, "torque", np.zeros_like)
    servo = open_loop(logged.recordings[0].torque)
    driven = each(passive, lambda r: replace(r, servo=servo))
    offered = [plan_for(data) for data in (logged, driven, passive)]
    assert ["motor_load" in plan.steps for plan in offered] == [True, True, False]
    assert ["quadratic" in plan.steps for plan in offered] == [False, False, True]


@pytest.mark.parametrize("torque", [np.ones_like, np.zeros_like])
def test_drag_is_a_candidate_where_the_load_never_changes(torque):
    axis = replace(changed(subset(tiny(), 0, 2), "torque", torque), mechanism=linear_axis(mass=2.0))
    assert "load_dependent" not in plan_for(axis).steps
    assert plan_for(axis).steps.count("quadratic") == 1
    masses = {r.name: 1.0 + k for k, r in enumerate(axis.recordings)}
    loaded = each(axis, lambda r: replace(r, parameters={"mass": masses[r.name]}))
    assert "load_dependent" in plan_for(loaded).steps


# --- As much as takes a minute --------------------------------------------------------------------


def test_short_data_are_used_as_they_are():
    data = tiny()
    assert shortened(data, 6_000) == (data, None)


@pytest.mark.parametrize("copies", [5, 40])
def test_long_data_are_shortened_to_the_same_work(copies):
    many = [replace(r, name=f"{r.name}-{k}") for k in range(copies) for r in recordings()]
    part, sample_time = shortened(Dataset("long", MACHINE, tuple(many)), 6_000)
    apart = sample_time or 0.01
    samples = sum(np.ptp(r.angle.time) / apart for r in part.recordings)
    assert samples <= 6_000 * 1.02
    assert len(part.recordings) >= 3
    assert all(r.name in {m.name for m in many} for r in part.recordings)


def test_parts_of_long_data_begin_where_they_move():
    """Logs of arms begin with seconds at rest, of which a verdict was made."""

    def resting(recording, seconds=8.0):
        def later(signal):
            rest = np.arange(0.0, seconds, 0.01)
            still = np.repeat(signal.value[:1], len(rest), axis=0)
            moving = signal.time - signal.time[0] + seconds
            value = np.concatenate([still, signal.value])
            return signal._replace(time=np.concatenate([rest, moving]), value=value)

        signals = {name: later(getattr(recording, name)) for name in ("angle", "torque")}
        return replace(recording, **signals, velocity=None, truth=None)

    many = tuple(replace(resting(r), name=f"{r.name}-{k}") for k in range(40) for r in recordings())
    part, _ = shortened(Dataset("late", MACHINE, many), 2_000)
    for recording in part.recordings:
        q = recording.angle.value
        early = recording.angle.time < recording.angle.time[0] + 0.5
        assert np.ptp(q[early]) > 0.02 * np.ptp(q)
