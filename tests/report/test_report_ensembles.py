"""Ensembles in the report: the spread of their members is stored, drawn and described."""

import numpy as np
import pytest
from fixtures import result_folders as made
from fixtures import tiny_pendulums as tiny
from matplotlib.collections import PolyCollection

from frictionid.comparison.cross_validate import Benchmark, run
from frictionid.comparison.registry import LAWS
from frictionid.comparison.tasks import Task, document
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.fitting.identifiers import BlackBox, LeastSquares
from frictionid.fitting.networks.compressed import CompressedNetwork
from frictionid.fitting.networks.network import Network
from frictionid.fitting.one_step.formulation import INTEGRAL
from frictionid.friction.laws import MLP, CoulombViscous, StateMLP, members_of
from frictionid.report.figures.curves import friction_curves, spread_caption, spreads
from frictionid.report.figures.style import drawing, rendered, styles


@pytest.fixture(scope="module")
def benchmark():
    data = tiny.dataset()
    return Benchmark(data, make_folds(data.recordings, Split(count=3)), Protocol((0.3,), every=0.5))


def ensemble(name="wide", offset=0.0, size=0.01):
    """A task whose members are its curve plus -2, ..., 2 times a size, `offset` off the truth."""
    task = made.task(name, motions=False)
    truth = np.asarray(made.about()["truth"])
    task["curves"] = np.repeat((truth + offset)[None], len(task["curves"]), axis=0)
    steps = np.arange(-2.0, 3.0)[:, None, None]
    task["members"] = task["curves"][-1] + size * steps
    return task


def gathered(folder, *tasks, **about):
    return made.section(folder, tasks, {"made": made.about(**about)})


def test_a_task_stores_the_curves_of_members_and_their_mean_is_the_fit(benchmark):
    identifier = CompressedNetwork(MLP((4,)), members=3, prior_deviations=(0.3,))
    result = run(benchmark, identifier, INTEGRAL)
    assert result.members.shape == (3, 401, 1)
    np.testing.assert_allclose(result.members.mean(axis=0), result.curves[-1], atol=1e-12)
    assert result.members.std(axis=0).max() > 0
    written = document(Task(benchmark, "mlp", identifier, INTEGRAL, 0), result, LAWS)
    np.testing.assert_array_equal(written["members"], result.members)


def test_what_is_no_ensemble_of_friction_has_no_members(benchmark):
    box = BlackBox(Network(StateMLP(hidden=(2,)), epochs=1, members=2))
    for identifier in (LeastSquares(CoulombViscous()), box):
        result = run(benchmark, identifier, INTEGRAL)
        assert not len(result.members)
    assert len(members_of(result.overall).theta) == 2  # of accelerations, which are no curves


def test_members_are_lines_and_no_band(tmp_path):
    section = gathered(tmp_path, ensemble(), made.task("other", 1, 1))
    with drawing():
        (curves,) = friction_curves(section, styles(section.models))
        (own,) = spreads(section, styles(section.models))
    for picture in (curves, own):
        drawn = [c for a in picture.axes for c in a.collections if isinstance(c, PolyCollection)]
        assert not drawn
    lower, scale = own.axes[1], 1e3  # about the mean [mN m]
    heights = sorted({round(float(line.get_ydata()[0]) / scale, 9) for line in lower.lines})
    assert set(np.arange(-2.0, 3.0) * 0.01).issubset(heights)


def test_without_a_truth_the_members_are_drawn(tmp_path):
    section = gathered(tmp_path, ensemble(), truth=False)
    words = spread_caption(section)
    assert "The 5 members of wide" in words and "no interval" in words
    with drawing():
        (picture,) = spreads(section, styles(section.models))
        assert len(rendered(picture, ["pdf"])["pdf"]) > 1000


def test_the_page_shows_the_picture_and_says_what_members_are(tmp_path, monkeypatch):
    made.leave_blank(monkeypatch)
    gathered(tmp_path, ensemble())
    made.built(tmp_path)
    assert 'href="figures/members--made.svg"' in (tmp_path / "index.html").read_text()
    assert "The 5 members of wide differ by their initial weights" in made.words(tmp_path)
    assert (tmp_path / "figures" / "members--made.pdf").exists()


def test_without_an_ensemble_nothing_is_drawn_or_told(tmp_path):
    section = gathered(tmp_path, made.task("plain"))
    assert spread_caption(section) == ""
    assert spreads(section, styles(section.models)) == []
