"""Recordings that several tests of checks share."""

from dataclasses import replace

import pytest
from fixtures.paths import DATA

from frictionid.data.readers.dataset import load_dataset


@pytest.fixture(scope="session")
def clean():
    """Three recordings of the acrobot without faults."""
    data = load_dataset(DATA / "acrobot_clean")
    names = ("03_decay", "04_sine", "14_steps")
    return replace(data, recordings=tuple(r for r in data.recordings if r.name in names))
