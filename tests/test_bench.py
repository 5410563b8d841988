"""The benchmark: sides in alternation, honest ratios, and what it writes; bars are never tested."""

import sys
from itertools import count

import numpy as np
import pandas as pd
import pytest
from fixtures.paths import ROOT


@pytest.fixture
def bench(monkeypatch):
    """Modules of comparisons/bench by their names, unloaded again after the test."""
    from importlib import import_module
    from types import SimpleNamespace

    monkeypatch.syspath_prepend(str(ROOT / "comparisons/bench"))
    monkeypatch.setattr(sys, "path", list(sys.path))  # samples adds folders of peers
    names = ("samples", "case", "measure", "results", "picture", "physics", "states")
    for name in names:
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield SimpleNamespace(**{name: import_module(name) for name in names})
    for name in names:
        sys.modules.pop(name, None)


@pytest.fixture
def ticking(bench, monkeypatch):
    """A clock that ticks once between any two looks at it."""
    ticks = count()
    monkeypatch.setattr(bench.measure, "used", lambda: bench.measure.Spent(*[next(ticks)] * 2))


def row(bench, ratios, error=(1.0, 2.0), **asked):
    own, peer = (bench.case.Side(what, lambda: 0.0) for what in ("ours", "theirs"))
    made = bench.case.Case("work", own, peer, "angle [rad]", **asked)
    return bench.measure.Row(made, np.array(ratios), 1.5, 1.0, 2.0, 0.0, 0.0, *error)


@pytest.mark.usefixtures("ticking")
def test_sides_run_in_turn_and_shared_ones_once_a_round(bench):
    calls = []
    a, b, c = (bench.case.Side(name, lambda name=name: calls.append(name) or 0.5) for name in "abc")
    part = bench.case.Part((bench.case.Case("ab", a, b), bench.case.Case("ac", a, c)), rounds=2)
    rows = bench.measure.measured(part)
    assert calls == list("abcabc")
    assert [r.ours_error for r in rows] == [0.5, 0.5]


@pytest.mark.usefixtures("ticking")
def test_a_share_of_the_work_stands_for_all_of_it(bench):
    whole, tenth = bench.case.Side("whole", float), bench.case.Side("tenth", float, share=0.1)
    made = bench.case.Case("work", whole, tenth)
    (found,) = bench.measure.measured(bench.case.Part((made,), rounds=3))
    assert (found.ours, found.peer, found.ratio) == pytest.approx((1.0, 10.0, 10.0))


def test_imports_and_the_first_call_count_where_work_is_done_once(bench):
    case, measure = bench.case, bench.measure
    own, peer = case.Side("ours", float), case.Side("theirs", float)
    none = measure.Spent(0.0, 0.0)
    second, half = measure.Spent(1.0, 1.0), measure.Spent(0.5, 0.5)
    ours = measure.Times((second, half), half, 0.0)
    theirs = measure.Times((second, second), none, 0.0)
    once = measure._row(case.Case("work", own, peer, once=True), ours, theirs)
    again = measure._row(case.Case("work", own, peer), ours, theirs)
    assert once.ratios.tolist() == pytest.approx([1.0 / 1.5, 1.0])
    assert again.ratios.tolist() == [2.0]
    assert (again.first, again.imports) == (0.5, 0.5)


@pytest.mark.parametrize(
    ("ratios", "error", "asked", "holds"),
    [
        ([3.0], (1.0, 2.0), {}, None),
        ([3.0, 5.0], (1.0, 2.0), {"bar": 4.0}, True),
        ([3.0, 4.9], (1.0, 2.0), {"bar": 4.0}, False),
        ([9.0], (1.0, 2.0), {"bar": 4.0, "error_bar": 0.1}, False),
        ([9.0], (0.1, 2.0), {"bar": 4.0, "error_bar": 0.1}, True),
    ],
)
def test_what_is_asked_for_holds_or_is_said_to_be_missed(bench, ratios, error, asked, holds):
    made = row(bench, ratios, error, **asked)
    assert made.holds is holds
    said = bench.results.cells(made)[5]
    assert said.endswith({None: "", True: ": holds", False: ": missed"}[holds])


def test_both_sides_of_one_step_and_of_residuals_give_the_same_numbers(bench):
    for part in (bench.physics.one_step(), bench.states.residual()):
        (case,) = part.cases
        assert case.ours.run() == 0.0 and case.peer.run() < 1e-12


def test_table_and_picture_have_every_row(bench, tmp_path):
    rows = [row(bench, [2.0, 3.0], bar=2.0), row(bench, [0.5], (np.nan, np.nan))]
    text = bench.results.markdown(rows, bench.results.machine())
    assert text.count("| work | theirs |") == 2
    assert "2.5 (2 to 3) | >= 2: holds | 1 / 2 angle [rad] |" in text
    assert "cores" in text and "numpy" in text and "Python" in text
    frame = bench.results.frame(rows)
    frame.to_csv(tmp_path / "bench.csv", index=False)
    assert pd.read_csv(tmp_path / "bench.csv").ratio.tolist() == [2.5, 0.5]
    labels = [t.get_text() for t in bench.picture.picture(rows).axes[0].get_yticklabels()]
    assert labels == ["work\nbeside theirs"] * 2
