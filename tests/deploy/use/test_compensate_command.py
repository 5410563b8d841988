"""The command writes a compensation as a table or as code, and says in one line what it lacks."""

import csv
import re
import runpy

import numpy as np
import pytest
from fixtures.refusals import assert_one_line
from numpy.testing import assert_allclose

from frictionid.deploy.compensation import Compensation, compensating
from frictionid.friction import Friction
from frictionid.friction.laws import LuGre, Stribeck
from frictionid.friction.model_files import save_model

FRICTION = Friction(Stribeck(), [[0.10, 0.04, 0.3, 0.02], [0.08, 0.03, 0.2, 0.01]])
SETTINGS = "--speed 5 --gain 0.8 --limit 0.12 --smooth 0.1"
CURVE = compensating(FRICTION, Compensation(gain=0.8, smooth=0.1, torque_limit=0.12)).curve


@pytest.fixture
def call(run, tmp_path):
    save_model(FRICTION, tmp_path / "model.json")
    return lambda options: run(tmp_path, f"compensate model.json {options}")


def test_a_table(call, tmp_path):
    code, out, _ = call(f"--out table.csv {SETTINGS}")
    assert code == 0 and "table.csv" in out and "add it to the motor torque (a joint without" in out
    said = float(re.search(r"at most ([\d.e-]+) off", out)[1])
    assert said < 0.005
    rows = list(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    for j in range(2):
        own = [row for row in rows if row["joint"] == f"joint {j + 1}"]
        w, torque = (np.array([float(row[key]) for row in own]) for key in ("velocity", "torque"))
        assert_allclose(torque, CURVE(w)[:, j], atol=1e-8)


def test_code(call, tmp_path):
    for to in ("c", "st"):
        code, out, _ = call(f"--out own.{to} --to {to} {SETTINGS}")
        assert code == 0 and ("compensation_torque(" in out or "compensation(w := w)" in out)
        assert "compensation" in (tmp_path / f"own.{to}").read_text()
    assert call(f"--out own.py --to python {SETTINGS}")[0] == 0
    module = runpy.run_path(str(tmp_path / "own.py"))
    for w in (-2.0, -0.01, 0.0, 0.3, 4.0, 50.0):  # also beyond the speeds, within the limit
        found = module["torque"]([w, w])
        assert_allclose(found, CURVE(np.array([w]))[0], atol=1e-9)


def test_a_table_of_bristles_says_that_it_has_no_memory(call, tmp_path):
    bristles = Friction(LuGre(), [[0.12, 0.05, 0.3, 0.01, 0.002, 0.0, 0.1]])
    save_model(bristles, tmp_path / "model.json")
    code, out, _ = call("--out table.csv --speed 5")
    assert code == 0 and "a table has no memory" in out


def test_a_model_without_speeds_asks_for_them(call):
    assert_one_line(call("--out table.csv"), "give --speed")
