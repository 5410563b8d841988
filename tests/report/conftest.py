"""A report that tests of several files read and none changes."""

import pytest
from fixtures import result_folders as made


@pytest.fixture(scope="session")
def typical(tmp_path_factory):
    """A report of a folder made by hand, with blank pictures."""
    return made.blank(made.typical(tmp_path_factory.mktemp("typical")))


@pytest.fixture
def undrawn(monkeypatch):
    """Builds that leave out the pictures, for tests of words and tables: those take longest."""
    made.undraw(monkeypatch)


@pytest.fixture
def blank(monkeypatch):
    """Builds that write blank pictures, for tests of which files there are."""
    made.leave_blank(monkeypatch)
