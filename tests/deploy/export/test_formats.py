"""All formats alike: laws of every kind are written or refused, and packages are asked for."""

import sys
from importlib import import_module

import pytest
from fixtures.refusals import assert_refused
from test_programs import LAWS, exported_by

from frictionid.deploy.export import FORMATS
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings
from frictionid.errors import InputError

CODE = ("c", "st", "python", "casadi", "onnx", "torchscript", "yaml", "latex")


@pytest.mark.parametrize("to", CODE)
def test_every_law_is_written_or_refused_in_one_line(to):
    """No law is refused but networks as equations, and no friction at all as a graph."""
    refused = set()
    for name, law in LAWS.items():
        if law.is_network and name != "mlp":  # whose code is long
            continue
        own = exported_by(law, 16)
        try:
            made = writer_of(to)(own, ExportSettings())
        except InputError:
            refused.add(name)
        else:
            assert all(made.files.values()) and made.notes
    assert refused == {"latex": {"mlp"}, "onnx": {"none"}, "torchscript": {"none"}}.get(to, set())


@pytest.mark.parametrize(
    "module, package, extra",
    [
        ("export.formats.casadi", "casadi", "export"),
        ("export.formats.onnx", "onnx", "export"),
        ("export.formats.usd", "pxr", "usd"),
        ("export.formats.yaml", "yaml", "export"),
        ("gym_env", "gymnasium", "gym"),
    ],
)
def test_a_missing_package_is_asked_for(module, package, extra, monkeypatch):
    monkeypatch.delitem(sys.modules, f"frictionid.deploy.{module}", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    with assert_refused(rf"not installed: pip install 'frictionid\[{extra}\]'"):
        import_module(f"frictionid.deploy.{module}")


def test_the_help_lists_the_formats_that_are_there(tmp_path, run):
    code, out, _ = run(tmp_path, "export", "--help")
    said = "".join(c if c.isalpha() else " " for c in out).split()
    assert code == 0 and ["Format", *FORMATS] == said[said.index("Format") :][: len(FORMATS) + 1]
