"""What pip installs: a wheel with suites and data, a source distribution with all tests."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile

import pytest
from fixtures.paths import ROOT
from packaging.requirements import Requirement


def test_every_extra_is_imported_somewhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    files = (p for room in ("frictionid", "comparisons", "tests") for p in (ROOT / room).rglob("*"))
    source = "\n".join(path.read_text() for path in files if path.suffix == ".py")
    imported = set(re.findall(r'(?:^\s*(?:import|from) |importorskip\(")(\w+)', source, re.M))
    tools = {"all", "dev", "docs", "test"}
    modules = {
        "array-api-compat": "array_api_compat",
        "opencv-python-headless": "cv2",
        "pin": "pinocchio",
        "pyserial": "serial",
        "pyyaml": "yaml",
        "scikit-learn": "sklearn",
        "usd-core": "pxr",
    }
    optional = project["optional-dependencies"]
    wanted = {Requirement(r).name for extra in optional.keys() - tools for r in optional[extra]}
    assert {name for name in wanted if modules.get(name, name) not in imported} == set()


FOREIGN = """
import sys
from pathlib import Path
import frictionid
from frictionid.comparison.suite import load_suite
from frictionid.files import suite_path
from frictionid.comparison.suite import tasks_of
assert Path(frictionid.__file__).is_relative_to(sys.argv[1]), frictionid.__file__
suite = suite_path(Path("acrobot"))
tasks = tasks_of(load_suite(suite), suite)
print(*sorted({f"{task.benchmark.dataset.name}:{task.name}" for task in tasks}))
assert frictionid.load_dataset("acrobot_lag").recordings
"""


def _run(words, cwd, path=None):
    """Output of Python with some words in a folder, with another PYTHONPATH."""
    done = subprocess.run(
        [sys.executable, *words],
        cwd=cwd,
        env=os.environ if path is None else {**os.environ, "PYTHONPATH": str(path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def _built(kind, folder):
    _run(["-m", "hatchling", "build", "-t", kind, "-d", str(folder)], ROOT)
    (built,) = folder.iterdir()
    return built


def test_the_default_comparison_runs_from_a_wheel_in_any_folder(tmp_path):
    site, elsewhere = tmp_path / "site", tmp_path / "elsewhere"
    with zipfile.ZipFile(_built("wheel", tmp_path / "dist")) as wheel:
        wheel.extractall(site)
    share = site / "frictionid/share"
    for kind, pattern in (("comparisons", "*.toml"), ("data", "**/*")):
        here = {p.relative_to(ROOT) for p in (ROOT / kind).glob(pattern) if p.is_file()}
        there = {p.relative_to(share) for p in (share / kind).rglob("*") if p.is_file()}
        assert there == here
    elsewhere.mkdir()
    said = _run(["-c", FOREIGN, str(site)], elsewhere, site)
    for dataset in ("acrobot_clean", "acrobot_sim"):
        for name in ("none", "stribeck", "sindy", "mlp", "lstm", "truth"):
            assert f"{dataset}:{name}" in said.split()


def test_tests_are_collected_from_the_source_distribution(tmp_path):
    with tarfile.open(_built("sdist", tmp_path / "dist")) as sdist:
        safely = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # from 3.11.4 on
        sdist.extractall(tmp_path, **safely)
    (root,) = tmp_path.glob("frictionid-*")
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    kept = listing.stdout.decode().split("\0")
    needed = [name for name in kept if name and not name.startswith(".ci/")]
    assert [name for name in needed if not (root / name).exists()] == []
    said = _run(
        ["-m", "pytest", "--collect-only", "-q", "tests/docs", "tests/programs"], root, root
    )
    assert "::" in said
