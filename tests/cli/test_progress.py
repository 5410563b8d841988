"""Progress: what runs stands behind the bar, not what has finished."""

import pytest

from frictionid.cli import progress


@pytest.fixture
def shown(monkeypatch):
    """What stands behind the bar after each step, the begin first."""
    from contextlib import contextmanager

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
