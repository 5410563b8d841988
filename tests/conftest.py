"""What all tests share: where measured recordings are, and that CI may not skip them."""

import gc
import os
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

pytest_plugins = ["pytester"]
sys.path.append(str(Path(__file__).parents[1] / "comparisons"))

# tests run side by side already: what they start takes one process where it is told no number
os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")


# laws, not speed: a busy machine may be slow; each run draws others
settings.register_profile(
    "laws",
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
settings.load_profile("laws")


@pytest.fixture(scope="session")
def real_data():
    """Folder of the public recordings, one subfolder per collection; a test that asks is `real`."""
    named = os.environ.get("FRICTIONID_DATA")
    if not named:
        pytest.skip("FRICTIONID_DATA does not name a folder with the public recordings")
    if not Path(named).is_dir():
        pytest.skip(f"FRICTIONID_DATA names {named}, which is no folder")
    return Path(named)


@pytest.fixture
def run(monkeypatch, capsys):
    """Exit code, output and error output of a command in a folder.

    The first words stand in one line, as in a shell; others, such as paths, one by one.
    """
    from frictionid.__main__ import main

    def called(folder, line="", *words):
        monkeypatch.chdir(folder)
        monkeypatch.setattr("sys.argv", ["frictionid", *shlex.split(str(line)), *map(str, words)])
        return main(), *capsys.readouterr()

    return called


@pytest.fixture(scope="module")
def shared_path(tmp_path_factory):
    """A folder that the tests of a file share."""
    return tmp_path_factory.mktemp("shared")


@pytest.fixture(scope="session")
def clean():
    """Three recordings of the acrobot without faults."""
    from fixtures.paths import DATA

    from frictionid.data.readers.dataset import load_dataset

    data = load_dataset(DATA / "acrobot_clean")
    names = ("03_decay", "04_sine", "14_steps")
    return replace(data, recordings=tuple(r for r in data.recordings if r.name in names))


def pytest_collection():
    """Let nothing be looked through for garbage that is imported, and stays."""
    gc.set_threshold(0)


def pytest_collection_finish():
    """From here on only what tests make is looked through, seldom: a fifth of their time saved."""
    gc.freeze()
    gc.set_threshold(20_000)


def pytest_collection_modifyitems(items):
    """Mark every test `real` that asks for the recordings, so that none can be forgotten."""
    for item in items:
        if "real_data" in getattr(item, "fixturenames", ()):
            item.add_marker("real")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    """Turn a skipped `real` test into a failure where FRICTIONID_REQUIRE_REAL=1 says so."""
    report = yield
    required = os.environ.get("FRICTIONID_REQUIRE_REAL") == "1"
    skipped = report.skipped and not hasattr(report, "wasxfail")
    if required and skipped and item.get_closest_marker("real"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"FRICTIONID_REQUIRE_REAL=1, yet {item.nodeid} was skipped: {reason}"
    return report
