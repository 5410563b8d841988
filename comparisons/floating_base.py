"""Friction of three joints on a base that moves, by what is known of its motion.

    python comparisons/floating_base.py

A trunk with a leg and an arm in MuJoCo: 8 s on a swaying tether and 1 s of flight at 1 kHz. Printed
are the largest errors of Coulomb levels and of viscous coefficients [%], and, of inverse dynamics
in flight, errors of base parameters with the six rows of the base over those without.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fixtures import floating_legs as legs

import frictionid as fid

METHODS = {
    "one_step": {},
    "inverse_dynamics": {},
    "shooting": {"free": ["friction", "delay"], "sample_time": 0.004},
}
TURNED = [*legs.TURN[:2], legs.TURN[2] + np.radians(5.0)]
BASES = {
    "IMU": legs.BASE,
    "pose": legs.POSE,
    "IMU, its place taken as the origin": {**legs.BASE, "sensor_position": [0.0, 0.0, 0.0]},
    "IMU, yaw 5 degrees off": {**legs.BASE, "sensor_rotation": TURNED},
    "orientation": {"orientation": legs.POSE["orientation"], "position": "fixed"},
    "held": None,
}


def errors(data: fid.Dataset, method: str) -> tuple[float, float]:
    """Largest errors [%] of Coulomb levels, and of viscous coefficients."""
    fit = fid.fit(data, "coulomb_viscous", method=method, **METHODS[method])
    ratio = fit.friction.theta / np.stack([legs.COULOMB, legs.VISCOUS], axis=1)
    coulomb, viscous = 100.0 * np.abs(ratio - 1.0).max(axis=0)
    return float(coulomb), float(viscous)


def wrench_ratio(folder: Path, seed: int) -> float:
    """Median over free base parameters of their errors with rows of the base over those without."""
    mechanism = legs.mechanism(folder, floating=True)
    frames = {f"flight {k}": legs.run(1.5, seed + k, tether=False) for k in range(3)}
    off = []
    for base in (legs.BASE, {**legs.BASE, "wrench": "none"}):
        data = fid.Dataset.from_frames(frames, mechanism, **legs.COLUMNS, base=base)
        fit = fid.fit(data, "coulomb_viscous", method="inverse_dynamics")
        off.append(np.abs(fit.friction.calibration.base - mechanism.nominal_base))
    free = np.all(off, axis=0)  # others are held at the nominal values, which are the true ones
    return float(np.median(off[1][free] / off[0][free]))


def main() -> None:
    """Print both tables."""
    warnings.simplefilter("ignore")
    folder = Path(tempfile.mkdtemp())
    runs = {f"tether {k}": legs.run(4.0, k) for k in range(2)}
    runs["flight"] = legs.run(1.0, 2, tether=False)
    for name, base in BASES.items():
        options = {"base": "trunk"} if base is None else {"floating": True}
        mechanism = legs.mechanism(folder, **options)
        data = fid.Dataset.from_frames(runs, mechanism, **legs.COLUMNS, base=base)
        each = [errors(data, method) for method in METHODS]
        cells = " | ".join(f"{coulomb:.2g}, {viscous:.2g}" for coulomb, viscous in each)
        print(f"| {name} | {cells} | {fid.check(data).level} |")
    print("rows of the base:", [round(wrench_ratio(folder, seed), 2) for seed in (10, 20)])


if __name__ == "__main__":
    main()
