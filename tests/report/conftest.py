"""A report that tests of several files read and none changes."""

import pytest
from fixtures import result_folders as made


@pytest.fixture(scope="session")
def typical(tmp_path_factory):
    """A report of a folder made by hand, with blank pictures."""
    with pytest.MonkeyPatch.context() as patch:
        made.leave_blank(patch)
        return made.built(made.typical(tmp_path_factory.mktemp("typical")))
