"""The tutorial without hardware: its commands, as they stand on the page, one after the other."""

import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import fields
from typing import get_args

import numpy as np
import pytest
from fixtures.drive_ports import until
from fixtures.paths import ROOT

from frictionid.__main__ import main
from frictionid.config import checked
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.dataset_toml import check_dataset_toml
from frictionid.data.readers.formats import READERS
from frictionid.data.readers.formats.ros import RosSettings
from frictionid.data.signals import sample
from frictionid.rig.align.align_files import AngleColumns
from frictionid.rig.rig_settings import rig_settings_of, written
from frictionid.simulate.rig import AnyFriction, Camera, Drive, Rig, Run, Variation
from frictionid.simulate.torques import AnyCommand, Controller, Fourier
from frictionid.simulate.true_friction import Curve

MAIN = "import sys; from frictionid.__main__ import main; sys.exit(main())"


def commands():
    """Lines of the page's shell blocks."""
    text = (ROOT / "docs/tutorial.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for path in (ROOT / "docs/tutorial").iterdir():
        shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_commands_of_the_tutorial_run(folder, monkeypatch, capsys):
    running, out = [], {}
    try:
        for line in commands():
            words = shlex.split(line.removesuffix("&"))
            if line.endswith("&"):
                until(lambda: not (folder / "drive").is_symlink())
                running.append(subprocess.Popen([sys.executable, "-c", MAIN, *words[1:]]))
                until(lambda: (folder / "drive").exists())
                continue
            if words[0] == "python":
                runpy.run_path(words[1], run_name="__main__")
                out[line] = capsys.readouterr().out
                continue
            monkeypatch.setattr(sys, "argv", words)
            code = main()
            out[line], err = capsys.readouterr()
            assert code in ((0, 1) if words[1] == "check" else (0,)), (line, err)
            if words[1] == "excite":
                running[-1].terminate()
            elif words[1] == "log":
                assert running[-1].wait(60) == 0
    finally:
        for process in running:
            process.kill()
            process.wait()
    _check(folder, out)


def _check(folder, out):
    (aligned,) = (text for line, text in out.items() if " align " in line)
    offset, at = re.search(r"offset +(\S+) s.* at (\S+) s of", aligned).groups()
    assert float(offset) == pytest.approx(-3.863 + 50e-6 * float(at), abs=1e-3)
    assert "measured = 0.9700" in aligned
    (true,), (mine,) = (load_dataset(folder / name).recordings for name in ("simulated", "data"))
    at = mine.torque.time[50:-50]
    off = np.abs(mine.torque.value[50:-50] - sample(true.torque, at))
    # only where the torque changes, and by the rounding of the current elsewhere
    assert np.quantile(off, 0.75) < 1e-5
    without, compensated = re.findall(r"compensation: (\S+) mrad", out["python controller.py"])
    assert float(compensated) < 0.5 * float(without)
    friction = runpy.run_path(folder / "friction.py")["torque"]
    for w in (-4.0, 4.0):  # 0.10 N m and 0.012 N m s/rad
        assert friction([w])[0] == pytest.approx(np.sign(w) * 0.1 + 0.012 * w, rel=0.1)
    compared = next(text for line, text in out.items() if " compare " in line)
    assert "stribeck" in compared
    assert (folder / "played.csv").read_text().count("\n") > 10


def test_the_settings_on_the_page_of_the_drive_are_accepted():
    text = (ROOT / "docs/drive.md").read_text()
    blocks = re.findall(r"^```toml\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    rig, ros = map(tomllib.loads, blocks)
    setup = rig_settings_of(rig, "rig.toml")
    assert written(setup.protocol, ("1000", "0.05", "0.2")).decode().strip() in text
    checked(AngleColumns, rig["angles"], "[angles]")
    settings = {k: v for k, v in ros["reader"].items() if k != "kind"}
    checked(RosSettings, settings, "[reader]")
    assert ros["reader"]["kind"] in READERS
    machine = {"kind": "pendulum", "parameters": {"mass": 0.5, "length": 0.15}}
    described = check_dataset_toml({"name": "rig", "mechanism": machine, **ros}, "dataset.toml")
    assert described.actuator is not None


def test_the_simulated_rig_names_every_key_that_a_rig_may_have():
    text = (ROOT / "docs/tutorial/simulated.toml").read_text()
    kinds = [*get_args(get_args(AnyCommand)[0]), *get_args(get_args(AnyFriction)[0])]
    classes = [Rig, Camera, Drive, Run, Variation, Controller, Fourier, Curve, *kinds]
    for name in {field.name for each in classes for field in fields(each)}:
        assert re.search(rf"\b{name}\b", text), name
    for each in kinds:
        assert f'kind = "{each.kind}"' in text
