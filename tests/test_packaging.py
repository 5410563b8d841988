"""The house around the code: pinned versions, set-up, what git keeps, the README."""

import os
import re
import shutil
import subprocess
import tomllib
from importlib.metadata import version

import pytest
from fixtures.paths import ROOT
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

# --- Versions ---------------------------------------------------------------------------------


def _project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def _pins():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(name): Version(version) for name, version in pins}


def _requirements(group):
    """Packages of the project itself ("core") or of an extra, and of the extras that it names."""
    project = _project()
    extras = {"core": project["dependencies"], **project["optional-dependencies"]}
    for requirement in map(Requirement, extras[group]):
        if requirement.name == project["name"]:
            for extra in requirement.extras:
                yield from _requirements(extra)
        else:
            yield requirement


def test_the_program_itself_needs_few_packages():
    names = {requirement.name for requirement in _requirements("core")}
    assert len(names) <= 14 and "torch" not in names


def test_all_has_every_extra_of_a_user():
    tools = {"all", "dev", "docs", "peers", "test", "dask", "engines", "export", "gym", "ros"}
    extras = [name for name in _project()["optional-dependencies"] if name not in tools]
    wanted = {r.name for extra in extras for r in _requirements(extra)}
    assert {r.name for r in _requirements("all")} == wanted


@pytest.mark.parametrize("group", ["core", "test", "dev", "peers"])
def test_constraints_pin_every_requirement_within_its_bounds(group):
    pins = _pins()
    for requirement in _requirements(group):
        assert requirement.specifier.contains(pins[canonicalize_name(requirement.name)]), (
            requirement
        )


def test_constraints_name_versions_that_everyone_can_get():
    assert {name for name, version in _pins().items() if version.local} == set()


def test_requirements_are_lower_bounds():
    groups = ["core", *_project()["optional-dependencies"]]
    assert {s.operator for group in groups for r in _requirements(group) for s in r.specifier} == {
        ">="
    }


def test_one_version_is_said_everywhere():
    said = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.M)
    newest = re.search(r"^## \[([\d.]+)\]", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert said and newest
    assert {said[1], newest[1], version("frictionid")} == {_project()["version"]}


# --- Set-up -----------------------------------------------------------------------------------

TOO_OLD = "#!/bin/sh\necho Python 3.9.2\n"
BARE = '#!/bin/sh\n[ "$1" = --version ] && echo Python 3.12.1 && exit\necho Traceback >&2\nexit 1\n'
GOOD = '#!/bin/sh\n[ "$1" = --version ] && echo Python 3.13.0\nexit 0\n'


def _script(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def _checkout(folder, interpreters):
    """Write what make needs of a checkout, and a bin folder with these interpreters."""
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, folder)
    _script(folder / "bin/cat", f'#!/bin/sh\nexec {shutil.which("cat")} "$@"\n')
    for name, text in interpreters.items():
        _script(folder / "bin" / name, text)


def _make(folder, *arguments):
    """What make does on a machine that has only what is in the checkout's bin folder."""
    make = shutil.which("make")
    if make is None:
        pytest.skip("make is not installed")
    # without what a make around the tests passes on to a make inside them
    kept = {k: v for k, v in os.environ.items() if not re.fullmatch("(GNU)?MAKE.*|MFLAGS", k)}
    environment = {**kept, "PATH": str(folder / "bin")}
    return subprocess.run(
        [make, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


NEEDS = "frictionid needs Python 3.11 or newer; found"
MISSING = {
    "old": ({"python3": TOO_OLD}, [], f"{NEEDS} Python 3.9.2 at BIN/python3: install one"),
    "old, named": ({"old": TOO_OLD}, ["PYTHON=old"], f"{NEEDS} Python 3.9.2 at BIN/old: "),
    "none": ({}, [], f"{NEEDS} no python3: "),
    "none, named": ({"python3": GOOD}, ["PYTHON=gone"], f"{NEEDS} no gone: "),
    "bare": (
        {"python3": BARE},
        [],
        "python3-venv is missing for BIN/python3: sudo apt install python3-venv",
    ),
    "old and bare": (
        {"python3": TOO_OLD, "python3.12": BARE},
        [],
        "python3.12-venv is missing for BIN/python3.12: sudo apt install python3.12-venv",
    ),
}


@pytest.mark.parametrize("target", ["compare", "test"])
@pytest.mark.parametrize(
    ("interpreters", "arguments", "expected"), MISSING.values(), ids=MISSING.keys()
)
def test_make_says_in_one_line_what_is_missing(target, interpreters, arguments, expected, tmp_path):
    _checkout(tmp_path, interpreters)
    done = _make(tmp_path, *arguments, target)
    assert done.returncode != 0
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert expected.replace("BIN", str(tmp_path / "bin")) in done.stderr
    assert f"make PYTHON=python3.12 {target}" in done.stderr
    assert not (tmp_path / ".venv").exists()


def test_make_takes_the_first_interpreter_that_will_do(tmp_path):
    _checkout(tmp_path, {"python3": TOO_OLD, "python3.13": BARE, "python3.12": GOOD})
    done = _make(tmp_path, "--dry-run", "compare")
    assert done.returncode == 0, done.stderr
    assert f'"{tmp_path}/bin/python3.12" -m venv --clear .venv' in done.stdout


@pytest.mark.parametrize(
    ("target", "extra"),
    [("compare", "all"), ("test", "test"), ("check", "dev"), ("docs", "docs")],
)
def test_make_installs_the_extra_of_each_target(target, extra, tmp_path):
    _checkout(tmp_path, {"python3": GOOD})
    done = _make(tmp_path, "--dry-run", target)
    assert f"-e '.[{extra}]' " in done.stdout
    subprocess.run(["sh", "-n", "-c", done.stdout], check=True)  # every quotation mark is closed


# What stands in .venv beforehand; does make set it up from nothing, and does it install?
ENVIRONMENTS = {
    "complete": ({"place": "HERE\n", "frictionid.core": ""}, False, False),
    "made by hand": ({}, False, True),
    "interrupted": ({"place": "HERE\n", "frictionid.core": "", "installing": ""}, True, True),
    "moved": ({"place": "/elsewhere\n", "frictionid.core": ""}, True, True),
}


@pytest.mark.parametrize(
    ("files", "created", "installed"), ENVIRONMENTS.values(), ids=ENVIRONMENTS.keys()
)
def test_make_redoes_only_what_must_be_redone(files, created, installed, tmp_path):
    _checkout(tmp_path, {"python3": GOOD})
    _script(tmp_path / ".venv/bin/python", GOOD)
    for name, text in files.items():
        (tmp_path / ".venv" / name).write_text(text.replace("HERE", str(tmp_path.resolve())))
    done = _make(tmp_path, "--dry-run", "compare")
    assert done.returncode == 0, done.stderr
    assert ("-m venv --clear" in done.stdout) is created
    assert ("-m pip install" in done.stdout) is installed


@pytest.mark.parametrize("changed", ["pyproject.toml", "constraints.txt"])
def test_make_installs_again_when_the_requirements_change(changed, tmp_path):
    _checkout(tmp_path, {"python3": GOOD})
    _script(tmp_path / ".venv/bin/python", GOOD)
    stamp = tmp_path / ".venv/frictionid.core"
    stamp.touch()
    later = stamp.stat().st_mtime + 10
    os.utime(tmp_path / changed, (later, later))
    assert "-m pip install" in _make(tmp_path, "--dry-run", "compare").stdout


PIP = """#!/bin/sh
case "$*" in (*pip\\ install*) echo Collecting numpy; echo Installing all; exit STATUS;; esac
exit 0
"""


@pytest.mark.parametrize("status", [0, 1])
def test_make_keeps_what_pip_says_for_when_it_fails(tmp_path, status):
    _checkout(tmp_path, {"python3": GOOD})
    _script(tmp_path / ".venv/bin/python", PIP.replace("STATUS", str(status)))
    for tool in ("sh", "touch", "rm", "tail", "sleep", "pwd"):
        (tmp_path / "bin" / tool).symlink_to(shutil.which(tool) or tool)
    _script(tmp_path / ".venv/bin/frictionid", "#!/bin/sh\necho compared\n")
    done = _make(tmp_path, "compare")
    assert "Collecting" not in done.stdout
    assert (tmp_path / ".venv/pip.log").read_text().endswith("Installing all\n")
    assert (done.returncode == 0) is (status == 0) is done.stdout.endswith("compared\n")
    assert ("Installing all" in done.stderr) is (status == 1)
    assert (tmp_path / ".venv/installing").exists() is (status == 1)


# --- What git keeps ---------------------------------------------------------------------------


def _git(*arguments):
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    return subprocess.run(
        ["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("path", "ignored"),
    [
        ("report/acrobot/scores.csv", True),
        ("report/README.md", False),
        ("frictionid/report/page.html", False),
        (".venv/bin/python", True),
    ],
)
def test_git_ignores_results_and_nothing_else_of_report(path, ignored):
    assert (_git("check-ignore", "--no-index", "-q", path).returncode == 0) is ignored


def test_no_committed_file_is_over_one_megabyte():
    listing = _git("ls-files", "-z").stdout.split("\0")
    paths = [ROOT / name for name in listing if name]
    assert paths
    assert [p for p in paths if p.is_file() and p.stat().st_size > 1_000_000] == []


# --- Tests and README -------------------------------------------------------------------------

SKIPPED = """
import pytest

def test_asks(real_data):
    assert False

@pytest.mark.real
def test_is_marked():
    pytest.skip("no such file")

def test_plain():
    pytest.skip("no engine")
"""


@pytest.mark.parametrize(
    ("required", "expected"),
    [("1", {"skipped": 1, "failed": 1, "errors": 1}), ("", {"skipped": 3})],
)
def test_required_recordings_may_not_be_skipped(
    required,
    expected,
    pytester,
    monkeypatch,
):
    monkeypatch.setenv("FRICTIONID_DATA", str(pytester.path / "nowhere"))
    monkeypatch.setenv("FRICTIONID_REQUIRE_REAL", required)
    pytester.makeconftest((ROOT / "tests/conftest.py").read_text())
    pytester.makeini("[pytest]\nmarkers = real\n")
    pytester.makepyfile(SKIPPED)
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    result.assert_outcomes(**expected)
    if required:
        result.stdout.fnmatch_lines(
            ["*FRICTIONID_REQUIRE_REAL=1, yet *test_is_marked was skipped*"]
        )
