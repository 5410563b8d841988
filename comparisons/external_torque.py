"""External torque on a simulated arm of seven joints: errors, false contacts, delay of detection.

Masses and rotors are 3 % off the model, encoders have noise of 0.5 % of each joint's motion, and
the arm's friction is set-valued with a Stribeck peak. The observer with the fit's friction stands
beside the same one without friction, and with Coulomb and viscous friction of an ordinary fit that
trusts the model. A push is what is missing in the logged torque. False contacts are counted over
hours that gave the band nothing, by the fit's values alone: its covariance widens the band by less
than a per cent here, and takes most of the time. Run from the clone:
python comparisons/external_torque.py [--hours N]
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from script import call

import frictionid as fid
from frictionid.data.recordings import Dataset, Recording
from frictionid.deploy.external_torque import band_of
from frictionid.friction.provenance import Provenance
from frictionid.simulate import Rig, simulate

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fixtures.seven_joints import MASS, ROTORS, arm_rig, urdf_text

SECONDS, RATE, OFF, NOISE = 30.0, 200.0, 0.03, 0.005
PUSH = np.array([12.0, 12.0, 8.0, 8.0, 4.0, 4.0, 2.0])  # N m, for half a second
FALSE = 20.0, 1.0  # an hour
QUIET, BATCH, DRAWS = 60, 150, 4  # recordings, and draws of the encoders' noise on each motion


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
        substeps=1,
    )


def noisy(data: Dataset, seed: int, size: np.ndarray) -> Dataset:
    """The recordings with noise (7,) of the angles [rad]."""
    rng = np.random.default_rng(seed)

    def measured(r: Recording) -> Recording:
        noise = size * rng.normal(size=r.angle.value.shape)
        return replace(r, angle=r.angle._replace(value=r.angle.value + noise))

    return replace(data, recordings=tuple(map(measured, data.recordings)))


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
    said = fid.external_torque(fit, contact, quiet=quiet, rate=FALSE[0])
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
    print(f"{name}: RMS error {error.round(2).tolist()} N m, band ", end="")
    print(f"{np.median(band[settled], axis=0).round(2).tolist()} N m,")
    print(
        f"    found after {np.round(late, 3).tolist()} s, {1e3 * seconds / samples:.3f} ms a sample"
    )


def print_false_contacts(
    folder: Path, fit: fid.Fit, quiet: Dataset, size: np.ndarray, hours: float
) -> None:
    """Print false contacts at each rate over hours of motion that nothing else has seen."""
    values = replace(fit.friction, provenance=Provenance())
    factors = [band_of([(values, quiet)], 0.1, rate).factor for rate in FALSE]
    seen, counts, seed = 0.0, np.zeros(len(FALSE), dtype=int), 3
    while seen < hours:
        clean = simulate(rig(folder, seed, BATCH))
        for draw in range(DRAWS):
            held = noisy(clean, 10 * seed + draw, size)
            said = fid.external_torque(values, held, quiet=quiet, rate=FALSE[0])
            seen += sum(float(np.ptp(t)) for t in said.time) / 3600.0
            for i, factor in enumerate(factors):
                bands = tuple(band * factor / factors[0] for band in said.band)
                counts[i] += len(replace(said, band=bands).contacts)
        seed += 1
        for rate, count in zip(FALSE, counts.tolist(), strict=True):
            print(f"{count} false contacts in {seen:.3g} h, {rate:g} an hour asked for", flush=True)


def main(*, hours: float = 1.0) -> None:
    """Print all figures.

    Parameters
    ----------
    hours : Without contact, held out.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        clean = [simulate(rig(folder, seed, n)) for seed, n in ((1, 3), (2, QUIET + 1))]
        size = NOISE * np.concatenate([r.angle.value for r in clean[0].recordings]).std(axis=0)
        fitted, other = (noisy(data, seed, size) for seed, data in enumerate(clean, 1))
        quiet = replace(other, recordings=other.recordings[1:])
        recording, push = pushed(other.recordings[0])
        contact = replace(other, recordings=(recording,))
        fits = {
            "this fit": fid.fit(fitted, "stribeck"),
            "Coulomb and viscous, model trusted": fid.fit(
                fitted, "coulomb_viscous", method="one_step"
            ),
            "no friction": fid.fit(fitted, "none", method="one_step"),
        }
        for name, fit in fits.items():
            print_errors(name, fit, replace(quiet, recordings=quiet.recordings[:16]), contact, push)
        print_false_contacts(folder, fits["this fit"], quiet, size, hours)


if __name__ == "__main__":
    call(main)
