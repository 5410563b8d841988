"""The table of cogging torques, as a CSV and as C: the law's torque over a turn of the motor."""

import ctypes
import shutil
import subprocess

import numpy as np
import pandas as pd
import pytest

import frictionid as fid
from frictionid.deploy.export.exported import ExportSettings
from frictionid.friction import at_rest
from frictionid.friction.laws import Cogging, Sum

GEAR = 9.0
LAW = Sum(("coulomb_viscous", Cogging((6, 12), GEAR)))
THETA = np.array([[0.1, 0.02, 0.03, -0.01, 0.004, 0.0], [0.2, 0.0, 0.0, 0.0, -0.02, 0.05]])
JOINTS = ("hip", 'knee "left", upper')


def named(precision):
    return ExportSettings(name="leg", joints=JOINTS, precision=precision, stem="map")


@pytest.fixture
def made(tmp_path):
    model = fid.Friction(LAW, THETA)
    return fid.export(model, "cogging", tmp_path / "map.csv", settings=named("double"))


def wanted(angle):
    x = at_rest(np.zeros((len(angle), 2)))._replace(q=np.stack([angle, angle], axis=1))
    return Cogging((6, 12), GEAR).torque(THETA[:, 2:], x, ())


def test_the_table_is_the_torque_over_a_turn_of_the_motor(made):
    table = pd.read_csv(made.paths[0], comment="#")
    angle = table["angle [rad]"].to_numpy()
    assert list(table)[1:] == [f"{joint} [N m]" for joint in JOINTS]
    np.testing.assert_allclose(table.to_numpy()[:, 1:], wanted(angle), atol=1e-8)
    step = np.diff(angle)
    assert angle[-1] + step[-1] == pytest.approx(2 * np.pi / GEAR) and np.ptp(step) < 1e-8


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
@pytest.mark.parametrize("precision", ["double", "float"])
def test_the_header_compiles_without_a_warning_and_interpolates(tmp_path, precision):
    model = fid.Friction(LAW, THETA)
    fid.export(model, "cogging", tmp_path / "map.csv", settings=named(precision))
    real = {"double": ctypes.c_double, "float": ctypes.c_float}[precision]
    source = tmp_path / "map.c"
    source.write_text(
        f'#include "map.h"\n{precision} at(int j, {precision} q);\n'
        f"{precision} at(int j, {precision} q) {{ return leg_cogging(j, q); }}\n"
    )
    library = tmp_path / "map.so"
    flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, str(source), "-o", str(library), "-lm"], check=True)
    at = ctypes.CDLL(str(library)).at
    at.restype, at.argtypes = real, [ctypes.c_int, real]
    angle = np.random.default_rng(1).uniform(-7.0, 7.0, 300)
    for j, truth in enumerate(wanted(angle).T):
        own = np.array([at(j, q) for q in angle])
        assert np.abs(own - truth).max() < 0.002 * np.abs(truth).max()


def test_friction_alone_has_no_table(tmp_path):
    ripple = fid.Friction(fid.Ripple(), [[0.1, 0.02, 0.1, 0.0]])
    with pytest.raises(fid.InputError, match="Ripple has no torque of the position alone"):
        fid.export(ripple, "cogging", tmp_path / "map.csv")
