"""What tests of the rig share: calls of the command line in a folder."""

from functools import partial

import pytest
from fixtures.command_line import run_command


@pytest.fixture
def run(monkeypatch, capsys):
    """A function of a folder and words: exit code, output, error output of `frictionid WORDS`."""
    return partial(run_command, monkeypatch, capsys)
