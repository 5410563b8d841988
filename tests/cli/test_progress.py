"""Progress: what runs stands behind the bar, not what has finished."""

from contextlib import contextmanager

import pytest

from frictionid.cli import command


@pytest.fixture
def shown(monkeypatch):
    """What stands behind the bar after each step, the begin first."""
    texts = []

    @contextmanager
    def counted(*arguments):
        texts.append(arguments[-1])
        yield texts.append

    monkeypatch.setattr(command, "counted", counted)
    return texts


@pytest.mark.parametrize(
    "names, jobs, ends, texts",
    [("abc", 2, "bac", ["a, b", "a, c", "c", ""]), ("aa", 1, "aa", ["a", "a", ""])],
)
def test_what_runs_is_shown_from_the_begin_to_the_end(shown, names, jobs, ends, texts):
    with command.running([*names], "work", jobs) as done:
        for number, name in enumerate(ends):
            assert shown == texts[: number + 1]
            done(name)
    assert shown == texts


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

    monkeypatch.setattr(command, "_bar", bar)
    with command.heard("fitting"):
        report_step("windows", 3)
    report_step("unheard", 1)
    assert seen == [(7, 5, 8, "windows")]
