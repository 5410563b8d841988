"""The names of `import frictionid`: light, whole, and the same for editors."""

import ast
import subprocess
import sys

import pytest
from fixtures.paths import ROOT

import frictionid

HEAVY = ("numpy", "scipy", "pandas", "sympy", "torch", "matplotlib", "sklearn", "pydantic", "numba")
SOURCE = ROOT / "frictionid/__init__.py"


def loaded(code):
    """Which of the heavy modules a piece of code loads in a new interpreter."""
    tail = f"import sys; print(*[m for m in {HEAVY!r} if m in sys.modules])"
    command = [sys.executable, "-c", f"{code}; {tail}"]
    run = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    return set(run.stdout.split())


def test_the_import_loads_nothing_heavy():
    assert loaded("import frictionid; dir(frictionid); frictionid.__version__") == set()


def test_data_and_fits_load_no_networks_and_no_pictures():
    some = loaded("import frictionid as fid; fid.Dataset; fid.Signal")
    assert not some & {"torch", "matplotlib", "sklearn", "pandas"}


def test_every_name_is_there():
    for name in dir(frictionid):
        assert getattr(frictionid, name) is not None


def test_editors_know_the_same_names():
    tree = ast.parse(SOURCE.read_text())
    (block,) = [n for n in tree.body if isinstance(n, ast.If)]
    typed = {alias.asname for node in block.body for alias in node.names}
    assert typed == set(frictionid.__all__) - {"__version__"}


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'fitt'"):
        frictionid.fitt  # noqa: B018


def test_a_room_of_the_same_name_does_not_take_the_place_of_a_function():
    import frictionid.check.findings
    import frictionid.simulate.rig

    assert frictionid.check.__module__ == "frictionid.api.check"
    assert frictionid.simulate.__module__ == "frictionid.api.simulate"
    from frictionid.check import Finding

    assert Finding.__module__ == "frictionid.check.findings"


def test_a_script_is_typed(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import frictionid as fid\n"
        "data = fid.Dataset.from_frames({}, fid.mechanisms.pendulum(), angle='q')\n"
        "reveal_type(fid.check(data))\n"
        "reveal_type(fid.fit(data, 'stribeck').frame)\n"
        "reveal_type(fid.compare(data, ['none'])['none'].friction)\n"
    )
    api = pytest.importorskip("mypy.api")
    out, _, status = api.run([str(script), "--config-file", str(ROOT / "pyproject.toml")])
    assert status == 0, out
    for name in ("api.check.Verdict", "DataFrame", "friction.Friction"):
        assert name in out
