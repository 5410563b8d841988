"""The objects that come back: what they show is what the commands print and write."""

import importlib
import inspect
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from fixtures.arm_frames import arm, frames
from fixtures.paths import ROOT
from fixtures.refusals import assert_refused
from fixtures.result_folders import leave_blank
from fixtures.seven_joints import urdf_text
from fixtures.shared import shared
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.api.models import identifier_of
from frictionid.comparison.suite_recipes import usual_method

TOML = """
name = "arm"
[mechanism]
kind = "pendulum"
[mechanism.parameters]
mass = 0.4
length = 0.25
[columns]
time = "t_ms"
angle = "pos_deg"
torque = "current_A"
[units]
time = "ms"
angle = "deg"
torque = "A"
[motor]
kt = 0.035
gear = 9.0
[hold]
torque = "linear"
[recordings]
patterns = ["*.csv"]
"""


@shared
def data():
    return arm()


@shared
def folder(shared_path):
    """The same data as files."""
    (shared_path / "dataset.toml").write_text(TOML)
    for name in frames():
        source = ROOT / f"docs/quickstart/{name}.csv"
        (shared_path / f"{name}.csv").write_bytes(source.read_bytes())
    return shared_path


@shared
def shot(data):
    return fid.fit(data, "coulomb_viscous", method="shooting", free=["inertia"])


@shared
def stribeck(data):
    """What a law is fitted by where nothing else is said."""
    return fid.fit(data, "stribeck")


@shared
def one_step(data):
    return fid.fit(data, "stribeck", method="one_step")


@shared
def plain(data):
    return fid.fit(data, "coulomb_viscous")


@shared
def bench(data):
    return fid.compare(data, ["none", "stribeck", fid.SINDy()], folds=3, horizons=[0.5, 1.0])


def test_the_command_writes_of_files_the_model_of_frames(stribeck, folder, tmp_path, run):
    model = tmp_path / "model.json"
    code, said, _ = run(tmp_path, "fit", folder, "--identifier", "stribeck", "--out", model)
    assert code == 0 and stribeck.method == "shooting"
    assert said == f"{stribeck!r}\nwritten to {model}\n"
    assert_array_equal(fid.load_model(model).friction.theta, stribeck.friction.theta)


def test_the_command_prints_the_verdict_of_the_function(data, folder, run):
    verdict = fid.check(data)
    assert run(folder, "check", folder)[1].rstrip() == repr(verdict).rstrip()
    assert verdict.level == "good" and "arm" in verdict._repr_html_()
    assert list(verdict.findings.columns[:4]) == ["level", "kind", "text", "remedy"]
    assert len(verdict.questions) == len(verdict.details.questions) > 0


def test_findings_are_a_frame(data):
    turned = {name: frame.assign(pos_deg=-frame.pos_deg) for name, frame in frames().items()}
    found = fid.check(data.with_frames(turned)).findings
    assert found.level[0] == "unusable" and "sign" in found.text[0]


def test_the_command_scores_as_the_function(plain, data, folder, tmp_path, run):
    plain.save(tmp_path / "mine.json")
    table = tmp_path / "scores.csv"
    run(tmp_path, "evaluate", tmp_path / "mine.json", folder, "--out", table)
    mine = fid.evaluate({"mine": plain.friction}, fid.load_dataset(folder))
    written = pd.read_csv(table)
    assert_allclose(written.value, mine.value, rtol=1e-8)
    assert_allclose(plain.score(folder).value, mine.value, rtol=1e-12)
    with pytest.warns(UserWarning, match="fitted to 5 of the 5 files"):
        plain.score(data)


def test_a_fit_shows_its_parameters_with_intervals(shot):
    frame = shot.frame.set_index("parameter")
    assert list(frame.index) == ["coulomb", "viscous", "inertia", "gravity"]
    assert (frame.low_95 < frame.value).all() and (frame.value < frame.high_95).all()
    assert frame.identified.all() and frame.nominal["inertia"] == pytest.approx(0.025)
    text = repr(shot)
    for word in ("value", "95 % interval", "unit", "converged", "coulomb of joint 1", "N m s/rad"):
        assert word in text and word in shot._repr_html_()
    assert "shooting fit to 'arm': 5 recordings" in text
    assert_array_equal(shot.covariance.index, shot.covariance.columns)
    assert shot.convergence.settled and shot.calibration.base is not None


def test_one_step_fits_have_intervals_too(one_step):
    assert np.isfinite(one_step.frame.low_95).all() and one_step.frame.identified.all()
    assert one_step.covariance is None
    text = repr(one_step)
    assert "interval of the noise alone" in text and "95 %" not in text
    assert "takes masses, gains, delay and bias as given" in text


USUAL = {
    "free": ("coulomb_viscous", {"free": ["inertia"]}, "shooting"),
    "a recipe": ("stribeck", {"recipe": "study"}, "one_step"),
    "a black box": ("sindy_dynamics", {}, "one_step"),
}


@pytest.mark.parametrize("law, settings, method", USUAL.values(), ids=USUAL)
def test_the_method_is_that_which_suits_what_is_fitted(data, law, settings, method):
    assert fid.fit(data, law, **settings).method == method


def test_an_arm_is_fitted_to_its_torques(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_text())
    t = np.arange(50) / 100.0
    wave = np.sin(t)[:, None] * np.ones(7)
    run = {"time": t, "angle": wave, "torque": wave}
    arm = fid.Dataset.from_arrays({"run": run}, fid.mechanisms.urdf(tmp_path / "arm.urdf"))
    assert usual_method(arm, identifier_of("stribeck")) == "inverse_dynamics"
    assert usual_method(arm, identifier_of("mlp")) == "one_step"
    acrobot = fid.load_dataset("acrobot_clean")
    assert usual_method(acrobot, identifier_of("mlp")) == "shooting"
    assert usual_method(acrobot, identifier_of("lstm")) == "one_step"


def test_a_late_torque_is_no_friction(data):
    """The friction that the recordings were made with, 6 ms late: docs/quickstart.md."""
    late = tuple(
        replace(r, torque=r.torque._replace(time=r.torque.time + 0.006)) for r in data.recordings
    )
    late_data = replace(data, recordings=late)
    by_default, fast = (fid.fit(late_data, "stribeck", method=m) for m in (None, "one_step"))
    rows = by_default.frame.set_index("parameter")
    for name, true in (("coulomb", 0.08), ("peak", 0.03), ("viscous", 0.010)):
        assert rows.low_95[name] < true < rows.high_95[name]
    assert abs(fast.frame.set_index("parameter").value["viscous"] - 0.010) > 0.001


def test_intervals_of_one_step_fits_are_kept_in_files_and_in_comparisons(one_step, data, tmp_path):
    one_step.save(tmp_path / "one_step.json")
    compared = fid.compare(data, ["stribeck"], folds=3, recipes="integral", horizons=[0.5])
    for other in (fid.load_model(tmp_path / "one_step.json"), compared["stribeck"].fit):
        for column in ("value", "low_95", "high_95"):
            assert_allclose(other.frame[column], one_step.frame[column], rtol=1e-5)


def test_a_saved_fit_is_the_same_but_for_its_data(shot, data, tmp_path):
    shot.save(tmp_path / "model.json")
    loaded = fid.load_model(tmp_path / "model.json")
    pd.testing.assert_frame_equal(loaded.frame, shot.frame)
    w = [-1.0, 0.5, 3.0]
    pd.testing.assert_frame_equal(loaded.curve(w), shot.curve(w))
    pd.testing.assert_frame_equal(
        loaded.predict(data, start=1.0), shot.predict(start=1.0), check_exact=False, rtol=1e-9
    )
    with assert_refused("from a file and has no data"):
        loaded.predict()


def test_a_prediction_starts_at_the_moment_that_is_asked(shot, data):
    one = shot.predict("run2", start=2.0, horizon=0.5)
    assert set(one.recording) == {"run2"} and one.start_s.nunique() == 1
    assert one.start_s[0] == pytest.approx(2.0) and one.ahead_s.iloc[-1] == pytest.approx(0.5)
    pd.testing.assert_frame_equal(one, shot.predict(data["run2"], start=2.0, horizon=0.5))
    again = shot.predict(frames()["run2"], start=2.0, horizon=0.5).assign(recording="run2")
    pd.testing.assert_frame_equal(one, again)
    assert (one.q1 - one.measured_q1).abs().max() < 0.1


def test_a_fit_without_parameters_shows_no_table(data):
    fit = fid.fit(data, "none", method="one_step")
    assert repr(fit).startswith("none, one-step fit to 'arm'")
    assert "interval" not in repr(fit) and len(fit.frame) == 0


def test_inverse_dynamics_frees_friction_beside_what_is_named(data):
    fit = fid.fit(data, "coulomb_viscous", method="inverse_dynamics", free=["inertia"])
    assert fit.method == "inverse_dynamics" and "inverse dynamics fit to 'arm'" in repr(fit)
    assert set(fit.frame.block) == {"friction", "inertia"}


def test_a_calibration_may_be_a_fit(data, shot):
    held = fid.fit(data, "coulomb_viscous", calibration=shot)
    assert_array_equal(held.calibration.base, shot.calibration.base)


def test_a_comparison_has_frames_and_a_verdict(bench):
    assert list(bench) == [(n, "shooting") for n in ("none", "stribeck", "sindy")]
    frame = bench.frame.set_index("identifier")
    error = frame["rollout_angle_median_1s"]
    assert error["stribeck"] < 0.2 * error["none"]
    assert bench["stribeck"].value("rollout_angle", "median", 1.0) == error["stribeck"]
    assert "rad off after 0.5 s" in repr(bench)
    assert "<img" in bench._repr_html_() and "stribeck" in bench._repr_html_()
    model = bench["stribeck"]
    assert model.folds.theta.shape == (3, 1, 4) and model.friction.theta.shape == (1, 4)
    assert set(bench.scores.identifier) == {"none", "stribeck", "sindy"}


def test_a_model_of_a_comparison_is_the_fit_of_all_data(bench, data, stribeck):
    theta = bench["stribeck"].friction.theta
    assert_allclose(theta, stribeck.friction.theta, rtol=1e-12)
    assert bench["stribeck"].recipe == stribeck.method
    assert bench["stribeck"].fit.data is data


def test_a_suite_gives_the_numbers_of_the_function(bench, folder, tmp_path, monkeypatch):
    leave_blank(monkeypatch)
    suite = tmp_path / "suite.toml"
    suite.write_text(
        f'name = "s"\nhorizons = [0.5, 1.0]\n[folds]\ncount = 3\n'
        f'[[datasets]]\npath = "{folder}"\n[[recipes]]\nname = "shooting"\n'
        '[[identifiers]]\nkind = "stribeck"\n'
    )
    run = fid.run_suite(suite, out=tmp_path / "out", jobs=1)
    of = ("rollout_angle", "q90", 1.0)
    assert run["stribeck"].value(*of) == pytest.approx(bench["stribeck"].value(*of), rel=1e-12)
    loaded = fid.load_comparison(tmp_path / "out")
    assert_array_equal(loaded["stribeck"].friction.theta, bench["stribeck"].friction.theta)
    assert (tmp_path / "out/summary.md").exists()


def test_a_folder_holds_the_same_comparison(data, tmp_path, monkeypatch):
    leave_blank(monkeypatch)
    models, out = ["none", Own], tmp_path / "out"
    written = fid.compare(data, models, folds=2, horizons=[0.5], folder=out)
    memory = fid.compare(data, models, folds=2, horizons=[0.5])
    pd.testing.assert_frame_equal(written.frame, memory.frame)
    read = fid.load_comparison(out, laws=[Own])
    for bench in (written, read):
        assert_array_equal(bench["Own"].friction.theta, memory["Own"].friction.theta)
    assert (out / "summary.md").read_text() and list((out / "figures").glob("*.svg"))
    with assert_refused("is no comparison|holds no comparison|holds"):
        (tmp_path / "other").mkdir()
        (tmp_path / "other/mine.txt").write_text("mine")
        fid.compare(data, ["none"], folds=2, horizons=[0.5], folder=tmp_path / "other")


def test_figures_are_figures(bench, shot, data):
    verdict = fid.check(data)
    made = [bench.plot(kind) for kind in ("rollouts", "curves", "motion", "one_step", "rollout")]
    made += [shot.plot(kind) for kind in ("motion", "correlation", "friction")]
    made += [verdict.plot(kind) for kind in ("residual", "coverage", "motion")]
    for figure in made:
        assert isinstance(figure, Figure) and figure.axes
    assert all(figure._repr_png_()[:4] == b"\x89PNG" for figure in made[4::3])
    import matplotlib._pylab_helpers as windows

    assert not windows.Gcf.figs  # no window, no list of pyplot


def test_pictures_do_not_depend_on_the_settings_of_the_moment(shot):
    import matplotlib

    figure = shot.plot()
    before = figure._repr_png_()
    with matplotlib.rc_context({"font.size": 20, "xtick.labelsize": 20}):
        assert shot.plot()._repr_png_()[:4] == before[:4]
        assert figure.axes[0].get_xticklabels()[0].get_fontsize() == 7


@dataclass(frozen=True)
class Own(fid.Law):
    """Coulomb friction alone."""

    width: float = 0.02
    names = ("coulomb",)
    units = ("N m",)
    bounds = ((0.0, np.inf),)

    def torque(self, theta, x, memory):
        return theta[..., 0] * np.tanh(x.w / self.width)

    def limit(self, theta, x, memory):
        return theta[..., 0] + 0.0 * x.w


def test_a_law_of_ones_own_is_fitted_compared_saved_and_read(data, tmp_path):
    fit = fid.fit(data, Own)
    assert fit.law == "Own" and fit.frame.parameter[0] == "coulomb"
    fit.save(tmp_path / "own.json")
    with assert_refused("law 'Own' is unknown"):
        fid.load_model(tmp_path / "own.json")
    loaded = fid.load_model(tmp_path / "own.json", laws=[Own])
    assert_array_equal(loaded.friction.theta, fit.friction.theta)
    bench = fid.compare(data, [Own, Own(width=0.1)], folds=2, horizons=[0.5])
    assert [name for name, _ in bench] == ["Own 1", "Own 2"]


def test_each_joint_may_have_a_law_of_its_own():
    fit = fid.fit("acrobot_clean", ["stribeck", fid.CoulombViscous], method="one_step")
    assert fit.law == "per_joint"
    assert fit.frame.groupby("joint").size().tolist() == [4, 2]
    with assert_refused("did you mean|known|should be"):
        fid.fit("acrobot_clean", ["stribek", "none"])
    with assert_refused("joint"):
        fid.fit("acrobot_clean", ["stribeck"] * 3)


SAME = {
    "fit": ("recipe", "sample_time", "seed", "windows", "iterations", "calibration"),
    "evaluate": ("sample_time", "whole", "initial_states"),
    "predict": ("horizon", "every", "whole"),
    "simulate": ("seed", "noise_free"),
    "suggest": (
        *("recordings", "length", "drive_rate", "camera_rate", "noise", "robust", "effort", "seed"),
        "friction",
    ),
}


@pytest.mark.parametrize("name", SAME)
def test_functions_have_the_names_and_defaults_of_the_commands(name):
    command = importlib.import_module("frictionid.__main__")
    own, theirs = (inspect.signature(getattr(place, name)).parameters for place in (fid, command))
    for argument in SAME[name]:
        assert own[argument].default == theirs[argument].default, argument


def test_a_suggestion_is_frames(data):
    limits = {"torque": 0.6, "velocity": 8.0}
    found = fid.suggest(data, limits, recordings=1, length=2.0, effort=6)
    (table,) = found.frames.values()
    assert list(table.columns) == ["time", "u1"] and table.u1.abs().max() <= 0.6
    assert [*found.document["parameters"][0]][:3] == ["name", "unit", "prior"]
    assert "expected of a fit" in repr(found) and isinstance(found.plot(), Figure)


def test_laws_are_a_frame():
    assert fid.laws().loc["stribeck", "parameters"].startswith("coulomb [N m]")
    assert "symmetric" in fid.identifiers("stribeck").index


def test_a_model_that_is_not_compared_is_named(bench):
    with assert_refused("'lugre' is no model of the comparison"):
        bench["lugre"]
    with assert_refused("these models have no picture of kind 'learning'"):
        bench.plot("learning")
    with assert_refused("did you mean 'curves'"):
        bench.plot("curvs")
