"""A report that tests of several files read and none changes."""

import pytest
from fixtures import result_folders as made


@pytest.fixture(scope="session")
def typical(tmp_path_factory):
    """A report of a folder made by hand, with blank pictures."""
    return made.blank(made.typical(tmp_path_factory.mktemp("typical")))
