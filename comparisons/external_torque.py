"""External torque on a simulated arm of seven joints: errors, false contacts, delay of detection.

Masses and rotors are 3 % off the model, encoders have noise of 0.5 % of each joint's motion, and
the arm's friction is set-valued with a Stribeck peak. The observer with the fit's friction stands
beside the same one without friction, and with Coulomb and viscous friction of an ordinary fit that
trusts the model. A push is what is missing in the logged torque. Run from the clone:
python comparisons/external_torque.py [--minutes N]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import frictionid as fid
from frictionid.data.recordings import Dataset, Recording
from frictionid.simulate import Rig, simulate

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fixtures.seven_joints import MASS, ROTORS, arm_rig, urdf_text

SECONDS, RATE, OFF, NOISE = 30.0, 200.0, 0.03, 0.005
PUSH = np.array([12.0, 12.0, 8.0, 8.0, 4.0, 4.0, 2.0])  # N m, for half a second
FALSE = 20.0  # an hour


def rig(folder: Path, seed: int, count: int) -> Rig:
    """Recordings of an arm that is heavier and lighter than its model by 3 %."""
    draw = np.random.default_rng(0)
    made = arm_rig(folder, seed, count, SECONDS)
    masses = [float(m) for m in MASS * (1.0 + OFF * draw.choice([-1.0, 1.0], 7))]
    (folder / "true.urdf").write_text(urdf_text(masses), encoding="utf-8")
    rotors = {k: v * (1.0 + OFF * float(draw.choice([-1.0, 1.0]))) for k, v in ROTORS.items()}
    camera = replace(made.camera, rate=RATE, samples=int(SECONDS * RATE), resolution=0.0)
    return replace(
        made,
        camera=camera,
        drive=replace(made.drive, rate=RATE, delay=0.0),
        true_parameters=rotors,
        true_mechanism={"urdf": str(folder / "true.urdf")},
    )


def noisy(data: Dataset, seed: int, size: np.ndarray) -> Dataset:
    """The recordings with noise (7,) of the angles [rad]."""
    rng = np.random.default_rng(seed)

    def measured(r: Recording) -> Recording:
        noise = size * rng.normal(size=r.angle.value.shape)
        return replace(r, angle=r.angle._replace(value=r.angle.value + noise))

    return replace(data, recordings=tuple(map(measured, data.recordings)))


def recorded(folder: Path, counts: tuple[int, ...]) -> list[Dataset]:
    """Data sets of so many recordings, with one encoder's noise."""
    clean = [simulate(rig(folder, seed, n)) for seed, n in enumerate(counts, 1)]
    size = NOISE * np.concatenate([r.angle.value for r in clean[0].recordings]).std(axis=0)
    return [noisy(data, seed, size) for seed, data in enumerate(clean)]


def pushed(recording: Recording) -> tuple[Recording, np.ndarray]:
    """The log without pushes on one joint after the other, and what these were (K, 7)."""
    value, clock = recording.torque.value.copy(), recording.torque.time
    push = np.zeros_like(value)
    for j in range(7):
        begin = clock[0] + 3.0 + 3.5 * j
        push[(clock >= begin) & (clock < begin + 0.5), j] = PUSH[j]
    return replace(recording, torque=recording.torque._replace(value=value - push)), push


def print_errors(
    name: str, fit: fid.Fit, quiet: Dataset, contact: Dataset, push: np.ndarray
) -> None:
    """Print errors on pushes and without, and how late pushes are found."""
    begin = time.process_time()
    said = fid.external_torque(fit, contact, quiet=quiet, rate=FALSE)
    seconds = time.process_time() - begin
    torque, band, clock = said.torque[0], said.band[0], said.time[0]
    settled = np.isfinite(torque[:, 0])
    error = np.sqrt(((torque - push[1:]) ** 2)[settled].mean(axis=0))
    late = []
    for j in range(7):
        first = clock[np.argmax(push[1:, j] > 0)]
        over = clock[(clock >= first) & (clock < first + 0.6) & (np.abs(torque[:, j]) > band[:, j])]
        late.append(float(over[0] - first) if len(over) else np.nan)
    samples = sum(len(r.angle.time) for d in (quiet, contact) for r in d.recordings)
    print(f"{name}: RMS error {error.round(2).tolist()} N m, quiet band ", end="")
    print(f"{(said.band_of.factor * said.band_of.noise).round(2).tolist()} N m,")
    print(
        f"    found after {np.round(late, 3).tolist()} s, {1e3 * seconds / samples:.3f} ms a sample"
    )


def main() -> None:
    """Print all figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="without contact, held out")
    minutes = parser.parse_args().minutes
    count = max(2, round(60.0 * minutes / SECONDS))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        fitted, quiet, held = recorded(folder, (3, count, count))
        recording, push = pushed(held.recordings[0])
        contact = replace(held, recordings=(recording,))
        fits = {
            "this fit": fid.fit(fitted, "stribeck"),
            "Coulomb and viscous, model trusted": fid.fit(
                fitted, "coulomb_viscous", method="one_step"
            ),
            "no friction": fid.fit(fitted, "none", method="one_step"),
        }
        for name, fit in fits.items():
            print_errors(name, fit, quiet, contact, push)
        said = fid.external_torque(fits["this fit"], held, quiet=quiet, rate=FALSE)
        hours = sum(float(np.ptp(t)) for t in said.time) / 3600.0
        print(f"{len(said.contacts)} false contacts in {hours:.3g} h, {FALSE:g} an hour asked for")


if __name__ == "__main__":
    main()
