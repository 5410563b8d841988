"""Ensembles in the report: the spread of their members is stored, drawn and described."""

from __future__ import annotations

import numpy as np
import pytest
from fixtures import result_folders as made
from fixtures import tiny_pendulums as tiny
from matplotlib.collections import PolyCollection

from frictionid.comparison.cross_validate import Benchmark, run
from frictionid.comparison.registry import LAWS
from frictionid.comparison.tasks import Task, document
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.friction.laws import MLP, CoulombViscous, StateMLP, members_of
from frictionid.identifiers import BlackBox, CompressedNetwork, LeastSquares, Network, StateNetwork
from frictionid.identifiers.formulation import INTEGRAL
from frictionid.report.figures.curves import friction_curves
from frictionid.report.figures.ensembles import share_held, spread, spread_caption, spreads
from frictionid.report.figures.style import drawing, styles

DEVIATION = np.sqrt(2.5)  # of -2 .. 2


@pytest.fixture(scope="module")
def benchmark():
    data = tiny.dataset()
    return Benchmark(data, make_folds(data.recordings, Split(count=3)), Protocol((0.3,), every=0.5))


def ensemble(name="wide", offset=0.0, size=0.01):
    """A task whose members are its curve plus -2, ..., 2 times a size, `offset` off the truth."""
    task = made.task(name, {"made": made.rows(0.3, 0.2)}, motions=False)
    truth = np.asarray(made.about()["truth"])
    task["curves"] = np.repeat((truth + offset)[None], len(task["curves"]), axis=0)
    steps = np.arange(-2.0, 3.0)[:, None, None]
    task["members"] = task["curves"][-1] + size * steps
    return task


def gathered(folder, *tasks, **about):
    made.write(folder, list(tasks), {"made": made.about(**about)})
    return made.section(folder)


def test_a_task_stores_the_curves_of_members_and_their_mean_is_the_fit(benchmark):
    identifier = CompressedNetwork(MLP((4,)), members=3, prior_deviations=(0.3,))
    result = run(benchmark, identifier, INTEGRAL)
    assert result.members.shape == (3, 401, 1)
    np.testing.assert_allclose(result.members.mean(axis=0), result.curves[-1], atol=1e-12)
    assert result.members.std(axis=0).max() > 0
    written = document(Task(benchmark, "mlp", identifier, INTEGRAL, 0), result, LAWS)
    np.testing.assert_array_equal(written["members"], result.members)


def test_what_is_no_ensemble_of_friction_has_no_members(benchmark):
    box = BlackBox(StateNetwork(Network(StateMLP(hidden=(2,)), epochs=1, members=2)))
    for identifier in (LeastSquares(CoulombViscous()), box):
        result = run(benchmark, identifier, INTEGRAL)
        assert not len(result.members)
    assert len(members_of(result.overall).theta) == 2  # of accelerations, which are no curves


def test_the_band_is_one_standard_deviation_about_the_fit_to_all_data(tmp_path):
    section = gathered(tmp_path, ensemble(), made.task("other", {"made": made.rows(1, 1)}))
    wide, other = section.models
    np.testing.assert_allclose(spread(wide), 0.01 * DEVIATION)
    assert spread(other) is None
    with drawing():
        (curves,) = friction_curves(section, styles(section.models))
        (own,) = spreads(section, styles(section.models))
    for picture, count in ((curves, 2), (own, 4)):
        bands = [c for a in picture.axes for c in a.collections if isinstance(c, PolyCollection)]
        assert len(bands) == count  # of the ensemble's panels, for both joints
    w = section.description.velocity[:, 0]
    (band,) = (c for c in curves.axes[0].collections if isinstance(c, PolyCollection))
    x, y = band.get_paths()[0].vertices.T
    off = y - np.interp(x, w, wide.curves[-1][:, 0])
    np.testing.assert_allclose(np.abs(off), 0.01 * DEVIATION, atol=1e-9)


@pytest.mark.parametrize(("offset", "share"), [(0.0, 1.0), (0.015, 1.0), (0.017, 0.0)])
def test_where_the_truth_is_known_the_page_says_how_often_the_band_holds_it(
    tmp_path, offset, share
):
    section = gathered(tmp_path, ensemble(offset=offset))
    assert share_held(section.models[0], section.description) == share
    words = spread_caption(section)
    assert "the 5 members of wide" in words and "no calibrated interval" in words
    assert f"holds the truth: wide {share:.0%}".replace("%", " %") in words


def test_without_a_truth_nothing_is_told_of_it(tmp_path):
    section = gathered(tmp_path, ensemble(), truth=False)
    assert "truth" not in spread_caption(section)
    with drawing():
        assert len(spreads(section, styles(section.models))) == 1


def test_the_page_shows_the_picture_and_says_what_the_band_is(tmp_path):
    gathered(tmp_path, ensemble())
    made.built(tmp_path)
    page = (tmp_path / "summary.md").read_text()
    assert "(figures/members--made.png)" in page
    assert page.count("one standard deviation over the 5 members of wide") == 4  # two pictures
    assert (tmp_path / "figures" / "members--made.pdf").stat().st_size > 1000


def test_without_an_ensemble_nothing_is_drawn_or_told(tmp_path):
    section = gathered(tmp_path, made.task("plain", {"made": made.rows(0.3, 0.2)}))
    assert spread_caption(section) == ""
    assert spreads(section, styles(section.models)) == []
