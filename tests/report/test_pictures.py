"""Pictures show what is there: no ramp at reversals, a marker for each recipe, no empty panel."""

import numpy as np
import pytest
from fixtures import result_folders as made
from fixtures import tiny_pendulums as tiny
from matplotlib.colors import to_hex
from numpy.testing import assert_allclose

from frictionid.check.motion import motions_of, unit_rows
from frictionid.data.plants import plant_of
from frictionid.evaluation.hysteresis import HysteresisSettings, hysteresis_loops
from frictionid.friction import Friction
from frictionid.friction.laws import LSTM, CoulombViscous
from frictionid.report.figures.curves import curve_and_band, friction_curves
from frictionid.report.figures.fits import friction_of_the_choice
from frictionid.report.figures.motion import torque_over_time
from frictionid.report.figures.scores import errors_of_models, loss_against
from frictionid.report.figures.style import drawing, styles
from frictionid.report.memory import loop_pictures
from frictionid.rig.align.recording_folder import least_squares_friction

PLANT = plant_of(tiny.dataset())[0]
GRID = np.linspace(-10.0, 10.0, 401)[:, None]


def section(folder, *fits, **changes):
    """What was fitted: pairs of identifier and recipe, with their scores."""
    tasks = [
        made.task(name, 0.4, 0.1, curve=0.1, fit=fit, joints=1) | changes for name, fit in fits
    ]
    return made.section(folder, tasks, {"made": made.about(1)})


def drawn(figure, own):
    """What a figure draws of a section."""
    return figure(own, styles(own.models))


def steps(picture):
    """Velocities of both ends of every line that is drawn in panels of reversing motion."""
    for axis in picture.axes[::2] if len(picture.axes) > 1 else picture.axes:
        for line in axis.get_lines():
            w = np.asarray(line.get_xdata(), dtype=float)
            if len(w) > 2:
                yield w[:-1], w[1:]


@pytest.mark.parametrize("law", [CoulombViscous(), LSTM(sample_time=1 / 60)], ids=["fine", "60 Hz"])
def test_no_line_joins_samples_across_a_reversal(tmp_path, law):
    theta = np.full((made.FOLDS + 1, 1, len(law.names)), 0.05)
    loops = hysteresis_loops(Friction(law, theta), PLANT, HysteresisSettings(), GRID, 1 / 60)
    own = section(tmp_path, ("one", "integral"), loops=[loop._asdict() for loop in loops])
    ((picture,),) = drawn(loop_pictures, own).values()
    pairs = list(steps(picture))
    assert pairs
    for before, after in pairs:
        joined = np.isfinite(before) & np.isfinite(after)
        across = joined & (np.sign(before) != np.sign(after))
        assert np.abs(after - before)[across].max(initial=0.0) <= 0.01 * 10.0
        assert joined.any()


@pytest.mark.parametrize("recipes", [("integral",), ("study", "integral"), ("a", "b", "c", "d")])
def test_each_recipe_has_a_marker_of_its_own(tmp_path, recipes):
    own = section(tmp_path, *(("stribeck", recipe) for recipe in recipes))
    picture = drawn(loss_against, own)
    points = [line for line in picture.axes[0].get_lines() if len(line.get_xdata()) == 1]
    looks = {(p.get_marker(), to_hex(p.get_markerfacecolor())) for p in points}
    assert len(looks) == len(points) == len(recipes)
    (legend,) = picture.legends
    named = [text.get_text() for text in legend.get_texts()]
    assert [name for name in named if "recipe" in name] == (
        [f"{recipe} recipe" for recipe in recipes] if len(recipes) > 1 else []
    )


def test_no_panel_of_the_curves_is_empty(tmp_path):
    fits = [("a", "study"), ("a", "integral"), ("b", "integral"), ("c", "integral")]
    own = section(tmp_path, *fits, ("d", "shooting"), ("e", "shooting"))
    with drawing():
        pictures = drawn(friction_curves, own)
    panels = [axis for picture in pictures for axis in picture.axes]
    assert len(panels) == 6
    assert all(axis.axison and len(axis.get_lines()) >= made.FOLDS for axis in panels)
    assert len({axis.get_ylim() for axis in panels}) == 1
    titles = [axis.get_title() for axis in panels]
    assert titles[:2] == ["a (study)", "a (integral)"]  # recipes of one law side by side


def test_the_friction_beside_the_motion_is_what_was_put_in():
    data = tiny.dataset()
    motions = motions_of(data.recordings)
    rows = unit_rows(PLANT.mechanism, motions)
    coulomb, viscous = 0.03, 0.004
    torque = coulomb * rows.friction[..., 0] + viscous * rows.friction[..., 1]
    noise = 1e-4 * np.random.default_rng(0).standard_normal(torque.shape)
    found = least_squares_friction(rows, torque + noise)
    use = rows.moving[:, 0]
    assert_allclose(found[use], torque[use], atol=1e-4)


def test_a_verdict_s_error_picture_has_a_dot_for_each_fold_of_each_model(tmp_path):
    own = section(tmp_path, ("one", "study"), ("one", "integral"), ("two", "integral"))
    (axis,) = drawn(errors_of_models, own).axes
    dots = [line.get_xdata() for line in axis.get_lines() if line.get_marker() == "o"]
    assert [len(folds) for folds in dots] == 3 * [made.FOLDS]
    assert len(axis.get_yticks()) == 3
    assert [text.get_text() for text in axis.texts if "recipe" in text.get_text()] == [
        "recipe study",
        "recipe integral",
    ]


def test_no_band_is_clipped(tmp_path):
    """However wide the band of the model that is shown, its axis holds it."""
    level = 0.1 * np.sign(made.about(1)["velocity"])
    wide = level * np.array([-2.0, 4.0, 1.0, 1.0, 1.0])[:, None, None]
    own = section(tmp_path, ("one", "integral"), ("two", "integral"), curves=wide)
    picture = drawn(friction_of_the_choice, own)
    low, high = picture.axes[0].get_ylim()
    _, curve, half = curve_and_band(own.models[0], own.description, 0)
    assert np.nanmax(half) > np.abs(curve).max()
    assert low <= np.nanmin(curve - half) and np.nanmax(curve + half) <= high


def test_curves_of_an_arm_leave_room_for_the_errors_below(tmp_path):
    tasks = [made.task("one", 0.4, 0.1, curve=0.1, joints=7)]
    own = made.section(tmp_path, tasks, {"made": made.about(7)})
    width, height = drawn(friction_of_the_choice, own).get_size_inches()
    assert height < 0.6 * width


def test_a_curve_under_no_load_says_so(tmp_path):
    plain = section(tmp_path / "plain", ("one", "integral"))
    document = dict(plain.models[0].document) | {"joints": [{"load_coefficient": {"value": 0.1}}]}
    loaded = section(tmp_path / "loaded", ("one", "integral"), model=document)
    for own, words in ((plain, "one"), (loaded, "one, unloaded")):
        picture = drawn(friction_of_the_choice, own)
        assert picture.legends[0].get_texts()[0].get_text() == words


def test_torque_is_drawn_as_measured_as_modelled_and_without_friction(tmp_path):
    time = np.linspace(0.0, 1.0, 11)
    rigid = np.sin(6.0 * time)[:, None]
    torque = {"recording": "run", "time": time, "measured": rigid + 0.3, "model": rigid + 0.2}
    own = section(tmp_path, ("one", "integral"), torque=torque | {"rigid": rigid})
    (axis,) = drawn(torque_over_time, own).axes
    found = [line.get_ydata() for line in axis.get_lines()]
    assert_allclose(found, [rigid[:, 0] + up for up in (0.3, 0.2, 0.0)])
    none = section(tmp_path / "none", ("one", "integral"))
    assert torque_over_time(none, styles(none.models)) is None
