"""How well `frictionid align` brings two clocks together: simulated acrobots, many seeds.

    python comparisons/clocks.py --seconds 30 --seeds 200
    python comparisons/clocks.py --seconds 120 --seeds 200

Offset 137 ms and drift 50 ppm are put in. Printed for each seed: error and half-width of the 95 %
interval of the offset in the middle and at the begin of the motion, and of the drift; at the end
how often the intervals hold. Angles at 60 Hz with 1.6 mrad of noise, 250 torques a second.
"""

from __future__ import annotations

import time

import numpy as np
from script import call

from frictionid.data.recordings import Recording
from frictionid.errors import InputError
from frictionid.mechanics import acrobot
from frictionid.rig.align.clock import align
from frictionid.simulate import (
    Camera,
    Curve,
    Drive,
    Multisine,
    Noise,
    Rig,
    Run,
    Steps,
    Stribeck,
    simulate,
)

OFFSET, DRIFT = 0.137, 50e-6
FRICTION = Stribeck(
    Curve(
        (0.165, 0.055),
        (0.165, 0.05),
        viscous=(0.004, 0.0008),
        peak_positive=(0.0, 0.028),
        peak_negative=(0.0, 0.036),
        stribeck_velocity=(1.0, 2.0),
    )
)


def run(seed: int) -> Run:
    """A recording: steps, noise or sines in turn."""
    g = np.random.default_rng(seed)
    torque = (
        Steps(0.16, float(g.uniform(0.25, 0.5))),
        Noise(0.2, (0.3, 2.0)),
        Multisine(0.3, tuple(g.uniform(0.4, 1.6, 4))),
    )[seed % 3]
    return Run(f"s{seed}", tuple(g.uniform(-1.5, 1.5, 2)), (), (torque,))


def recorded(seeds: range, seconds: float) -> list[Recording]:
    """Simulated recordings of some seeds, side by side."""
    camera = Camera(round(60 * seconds) + 1, 60.0, 0.0016)
    runs = tuple(map(run, seeds))
    rig = Rig("clocks", {"kind": "acrobot"}, FRICTION, camera, runs, drive=Drive(250.0), substeps=8)
    return list(simulate(rig).recordings)


def tried(recording: Recording) -> list[float] | str:
    """Errors and half-widths: offset in the middle and at the begin [ms], drift [ppm]."""
    torque = recording.torque
    torque = torque._replace(time=(torque.time - OFFSET) / (1 + DRIFT))
    try:
        found = align(acrobot(), recording.angle, torque)
    except InputError as error:
        return str(error)
    out = []
    for at in (found.clock.at, found.span[0]):
        out.append(1e3 * (found.clock.offset_at(at) - OFFSET - DRIFT * at))
        out.append(1e3 * found.t_quantile * found.error_at(at))
    drift = found.clock.drift - DRIFT
    return [*out, 1e6 * drift, 1e6 * found.t_quantile * found.drift_error]


def main(*, seconds: float = 30.0, seeds: int = 200, first: int = 0, together: int = 25) -> None:
    """Try all seeds and print what came of it.

    Parameters
    ----------
    together : Simulated side by side.
    """
    found, refused, start = [], 0, time.process_time()
    drawn = range(first, first + seeds)
    for begin in range(0, len(drawn), together):
        some = drawn[begin : begin + together]
        for seed, recording in zip(some, recorded(some, seconds), strict=True):
            one = tried(recording)
            if isinstance(one, str):
                refused += 1
                print(f"{seed:4d}  refused: {one}", flush=True)
                continue
            found.append(one)
            print(f"{seed:4d}  " + "  ".join(f"{v:9.3f}" for v in one), flush=True)
    table = np.array(found)
    for k, (name, bar) in enumerate(
        (("offset in the middle [ms]", 1.0), ("offset at the begin [ms]", 1.0), ("drift [ppm]", 15))
    ):
        error, half = np.abs(table[:, 2 * k]), table[:, 2 * k + 1]
        print(
            f"{name}: {100 * np.mean(error <= half):.0f} % inside the interval; error median "
            f"{np.median(error):.3f}, 95 % {np.quantile(error, 0.95):.3f}, most {error.max():.3f}; "
            f"{100 * np.mean(error <= bar):.0f} % within {bar:g}; half-width median "
            f"{np.median(half):.3f}"
        )
    print(f"{len(found)} seeds, {refused} refused, {time.process_time() - start:.0f} s")


if __name__ == "__main__":
    call(main)
