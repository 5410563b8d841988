"""Progress: what runs stands behind the bar, not what has finished."""

from contextlib import contextmanager

import pytest

from frictionid.cli import progress


@pytest.fixture
def shown(monkeypatch):
    """What stands behind the bar after each step, the begin first."""
    texts = []

    @contextmanager
    def counted(*arguments):
        texts.append(arguments[-1])
        yield texts.append

    monkeypatch.setattr(progress, "counted", counted)
    return texts


def test_what_runs_is_shown_from_the_begin_to_the_end(shown):
    with progress.running(["a", "b", "c"], "work", 2) as done:
        assert shown == ["a, b"]
        done("b")
        done("a")
        done("c")
    assert shown == ["a, b", "a, c", "c", ""]


def test_steps_of_one_name_are_counted(shown):
    with progress.running(["a", "a"], "work") as done:
        done("a")
        done("a")
    assert shown == ["a", "a", ""]


def test_reported_steps_move_the_bar_of_a_fit(monkeypatch):
    from frictionid.progress import report_step

    seen = []

    class Bar:
        tasks = [type("Task", (), {"completed": 4})()]

        def update(self, task, *, completed, total, last):
            seen.append((task, completed, total, last))

    @contextmanager
    def bar(*_):
        yield Bar(), 7

    monkeypatch.setattr(progress, "_bar", bar)
    with progress.heard("fitting"):
        report_step("windows", 3)
    report_step("unheard", 1)
    assert seen == [(7, 5, 8, "windows")]
