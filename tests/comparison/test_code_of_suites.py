"""Suites name code of their own folder or of installed packages, and nothing else is imported."""

import sys

import pytest
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.tiny_pendulums import tasks_in, write_suite

from frictionid.errors import InputError

HARM = 'from pathlib import Path\nPath("harm").touch()\ndef make():\n    Path("harm").touch()\n'


@pytest.fixture
def complaint(tmp_path, monkeypatch):
    """What is said to an identifier of a suite, which leaves no trace."""
    (tmp_path / "suites").mkdir()
    (tmp_path / "elsewhere.py").write_text(HARM)
    monkeypatch.chdir(tmp_path)

    def call(**entry):
        file = write_suite(tmp_path / "suites", [("identifiers", [entry])])
        with pytest.raises(InputError) as caught:
            tasks_in(file)
        assert not (tmp_path / "harm").exists() and "elsewhere" not in sys.modules
        return str(caught.value)

    return call


@pytest.mark.parametrize("kind", ["subprocess:Popen", "os:system", "elsewhere:make", "nowhere:x"])
def test_code_from_elsewhere_is_not_imported(complaint, kind):
    said = complaint(kind=kind, args=["touch", "harm"])
    assert f"{kind!r} is neither in a module beside the file nor in an installed package" in said


def test_a_file_of_the_name_of_a_python_module_does_not_open_it(complaint, tmp_path):
    (tmp_path / "suites/subprocess.py").write_text("mine = 1\n")
    assert "is neither in a module beside" in complaint(
        kind="subprocess:Popen", args=["touch", "harm"]
    )


@pytest.mark.parametrize("kind", ["joblib:load", "numpy:load", "sklearn.svm:SVR"])
def test_installed_packages_are_asked_for_identifiers_only(complaint, kind):
    assert "is no class derived from frictionid.Identifier" in complaint(kind=kind)


ESTIMATORS = {
    "subprocess:Popen": "is of no installed package",
    "os.system": "is of no installed package",
    "elsewhere:make": "is of no installed package",
    "joblib:load": "is no class with fit and predict",
    "sklearn.utils.Bunch": "is no class with fit and predict",
}


@pytest.mark.parametrize("name, words", ESTIMATORS.items(), ids=ESTIMATORS)
def test_estimators_are_classes_of_installed_packages(complaint, name, words):
    settings = {"args": ["touch", "harm"]}
    assert words in complaint(kind="sklearn", estimator=name, settings=settings)


OWN_ARM = """
from frictionid.mechanics import pendulum

def arm():
    return pendulum(mass=0.3, length=0.2, inertia=0.001)
"""


def test_a_suite_names_the_mechanism_of_its_data_sets(tmp_path):
    (tmp_path / "arm_beside.py").write_text(OWN_ARM)
    file = write_suite(tmp_path, 'datasets.0.mechanism = "arm_beside:arm"')
    own = {task.benchmark.dataset.mechanism for task in tasks_in(file)}
    plain = write_suite(tmp_path, name="plain.toml")
    table = {task.benchmark.dataset.mechanism for task in tasks_in(plain)}
    (mechanism,), (usual,) = own, table
    assert mechanism.nominal() == usual.nominal() | {"inertia": 0.001}
    digests = [{t.digest for t in tasks_in(f)} for f in (file, plain)]
    assert not digests[0] & digests[1]


@pytest.mark.parametrize("kind", ["subprocess:Popen", "os:system", "nowhere:x"])
def test_a_mechanism_from_elsewhere_is_not_imported(tmp_path, kind):
    file = write_suite(tmp_path, [("datasets.0.mechanism", kind)])
    with assert_refused("is neither in a module beside the file nor in an"):
        tasks_in(file)


BESIDE = {
    "identifier": ("identifiers", [{"kind": "harmful:make"}]),
    "identifier that is installed": ("identifiers", [{"kind": "sklearn.svm:SVR"}]),
    "mechanism": ("datasets.0.mechanism", "harmful:make"),
}


@pytest.mark.parametrize("change", BESIDE.values(), ids=BESIDE)
def test_code_beside_a_suite_runs_only_where_it_is_trusted(change, tmp_path, monkeypatch, run):
    (tmp_path / "harmful.py").write_text(HARM)
    monkeypatch.setattr(sys, "path", before := list(sys.path))
    monkeypatch.delitem(sys.modules, "harmful", raising=False)
    file = write_suite(tmp_path, [change])
    for command in ("compare", "sensitivity"):
        outcome = run(tmp_path, command, file, "--out", "out")
        assert_one_line(outcome, "is code, which runs with your rights: read it, and give --trust")
    assert not (tmp_path / "harm").exists() and sys.path is before and str(tmp_path) not in before
    assert "harmful" not in sys.modules
    with assert_refused("harmful|SVR"):
        tasks_in(file)
    assert (tmp_path / "harm").exists() == ("harmful" in str(change))


def test_settings_of_code_beside_a_suite_are_not_tuned_without_trust(tmp_path, run):
    (tmp_path / "harmful.py").write_text(HARM)
    entry = {"kind": "harmful:make", "search": {"width": {"low": 0.1, "high": 0.2}}}
    file = write_suite(tmp_path, [("identifiers", [entry])])
    assert_one_line(run(tmp_path, "tune", file, "--out", "out"), "give --trust")
    assert not (tmp_path / "harm").exists()
