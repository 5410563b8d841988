"""Exported files as MuJoCo Warp runs them, beside MuJoCo: the same controls for a second.

    python comparisons/on_warp.py

Largest distance of the positions and that after a second. MuJoCo Warp (`pip install mujoco-warp`)
computes in single precision, on a CPU where there is no GPU. Beside cards are the double pendulum
C.1 with LuGre friction, whose bristles MJX has not, and with torques that act late.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
from script import call

import frictionid as fid
from frictionid.data.plants import Calibration

try:
    import mujoco_warp
except ImportError:
    raise SystemExit("on_warp: mujoco-warp is missing: pip install mujoco-warp") from None

CARDS = ("dfki_c1", "emps", "simple_pendulum", "xl330_m1")
LUGRE = {
    "coulomb": 0.2,
    "peak": 0.05,
    "stribeck_velocity": 0.3,
    "viscous": 0.01,
    "presliding": 0.02,
    "damping": 0.0,
    "damping_velocity": 0.1,
}
CONTROLS = {"emps": 60.0}  # amplitude [N], of others 0.6 N m or rad
DELAY = np.array(0.0034)  # [s]


def files(folder: Path) -> Iterator[tuple[str, Path]]:
    """Names and paths of exported files."""
    for name in CARDS:
        fid.export(f"machine:{name}", "mujoco", folder / f"{name}.xml")
        yield name, folder / f"{name}.xml"
    theta = np.array([[LUGRE[name] for name in fid.LuGre().names]] * 2)
    late = replace(Calibration.ideal(2), delay=DELAY)
    friction = replace(fid.Friction(fid.LuGre(), theta), calibration=late)
    data = Path(__file__).parent.parent / "data" / "dfki_c1"
    fid.export(friction, "mujoco", folder / "lugre.xml", data=data)
    yield "C.1, LuGre, 3.4 ms late", folder / "lugre.xml"


def apart(path: Path, amplitude: float) -> tuple[float, float]:
    """Largest distance of positions [rad or m] within a second, and that at its end."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    there, here = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data)
    distances = []
    for k in range(round(1.0 / model.opt.timestep)):
        phase = 2 * np.pi * 1.3 * k * model.opt.timestep + np.arange(model.nu)
        data.ctrl[:] = amplitude * np.sin(phase)
        here.ctrl.assign(data.ctrl[None].astype(np.float32))
        mujoco.mj_step(model, data)
        mujoco_warp.step(there, here)
        distances.append(np.abs(here.qpos.numpy()[0] - data.qpos).max())
    return float(max(distances)), float(distances[-1])


def main() -> None:
    """Print the table."""
    print("| file | largest distance | after 1 s |\n| --- | ---: | ---: |")
    with TemporaryDirectory() as folder:
        for name, path in files(Path(folder)):
            most, last = apart(path, CONTROLS.get(name, 0.6))
            print(f"| {name} | {most:.1e} | {last:.1e} |", flush=True)


if __name__ == "__main__":
    call(main)
