"""Friction as tables and equations: YAML for feed-forward, LaTeX for papers."""

import re

import numpy as np
import pytest
import yaml
from targets import written
from test_programs import LAWS, exported_by, friction_by

from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.friction import Friction
from frictionid.friction import laws as known


def straight(joint, w):
    """The table of a joint between its velocities, and straight beyond the last two."""
    x, y = np.array(joint["velocity"]), np.array(joint["torque"])
    low, high = (np.polyfit(x[s], y[s], 1) for s in (slice(2), slice(-2, None)))
    inside = np.interp(w, x, y)
    return np.where(w > x[-1], np.polyval(high, w), np.where(w < x[0], np.polyval(low, w), inside))


@pytest.mark.parametrize("name", ["stribeck_asymmetric", "quadratic", "lugre"])
def test_a_table_holds_steady_sliding_as_near_as_it_says(name):
    own = exported_by(LAWS[name], 11, ("hip", "knee"))
    made = writer_of("yaml")(own, ExportSettings())
    document = yaml.safe_load(made.files[".yaml"])
    said = float(re.search(r"at most ([\d.e-]+) off", made.lost[0])[1])
    w = np.concatenate([-np.geomspace(3e-3, 9.0, 60), np.geomspace(3e-3, 9.0, 60)])
    expected = own.friction.curve(w, 20.0)
    for j, joint in enumerate(document["joints"]):
        off = np.abs(straight(joint, w) - expected[:, j])
        assert off[np.abs(w) <= own.speeds[j]].max() <= 1.1 * said
        assert off.max() < 0.02 * np.abs(expected).max()
        assert joint["velocity"] == sorted(joint["velocity"])
        assert max(joint["velocity"]) == pytest.approx(own.speeds[j])
    np.testing.assert_allclose(made.held.curve(w), expected, atol=0.02 * np.abs(expected).max())


def test_a_table_says_what_it_cannot_hold():
    rng = np.random.default_rng(12)
    lost = {
        name: " ".join(
            writer_of("yaml")(exported(friction_by(LAWS[name], rng)), ExportSettings()).lost
        )
        for name in ("stribeck", "lugre", "gear_load")
    }
    assert "memory" in lost["lugre"] and "memory" not in lost["stribeck"]
    assert "zero of the angle and the motor torque" in lost["gear_load"]
    assert "zero" not in lost["stribeck"]


def test_an_equation_reads_as_the_law(tmp_path):
    friction = Friction(known.CoulombViscous(), [[0.12, 0.05]])
    friction = friction.noted({"half_widths": np.array([[0.01, np.nan]])})
    text = written(exported(friction, ("left_hip",), (2.0,)), "latex", tmp_path)[".tex"].read_text()
    assert r"T &= 0.12 \, \tanh\left(\frac{\omega}{0.02}\right) + 0.05 \, \omega" in text
    assert r"left\_hip & coulomb & $0.12$ & $[0.11, 0.13]$ & N m \\" in text
    assert r"left\_hip & viscous & $0.05$ &  & N m s/rad \\" in text


@pytest.mark.parametrize("name", [n for n, law in LAWS.items() if not law.is_network])
def test_every_equation_is_sound_latex(name, tmp_path):
    own = exported_by(LAWS[name], 13)
    text = written(own, "latex", tmp_path)[".tex"].read_text()
    plain = text.replace(r"\{", "").replace(r"\}", "")
    assert plain.count("{") == plain.count("}")
    assert text.count(r"\left") == text.count(r"\right")
    assert re.findall(r"\\begin{(.*?)}", text).count("align*") == text.count(r"\end{align*}") == 2
