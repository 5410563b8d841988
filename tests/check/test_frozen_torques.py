"""Frozen torques: each is judged by friction fitted to all other windows, at little cost."""

from __future__ import annotations

import time

import numpy as np

from frictionid.check.motion import Measured, Motion, unit_rows
from frictionid.check.sensors import FITS, LARGE, WIDTH, WORSE, frozen_torques
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import States

HELD = 25  # samples
MACHINE = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 0.5}}


def _measured(samples: int, frozen: slice = slice(200, 300)) -> Measured:
    """A swinging pendulum whose torque is held over 0.25 s, with exact states; one is frozen."""
    time = np.arange(samples) * 0.01
    q, w, a = np.sin(3 * time), 3 * np.cos(3 * time), -9 * np.sin(3 * time)
    needed = 0.25 * a + 0.5 * 9.81 * np.sin(q) + 0.1 * np.sign(w)
    held = np.repeat(needed[::HELD], HELD)[:samples]
    held[frozen] = held[frozen.start]
    one = np.ones(1)
    motion = Motion(States(time, q[:, None], w[:, None]), 1e-4 * one, 1e-3 * one, 1e-3 * one)
    recording = Recording("r", Signal(time, q[:, None]), Signal(time, held[:, None], "previous"))
    return Measured.of_dataset(Dataset("held", MACHINE, (recording,)), [motion])


def _is_contradicted(measured: Measured, start: float, stop: float) -> bool:
    """The definition: friction by least squares over all windows apart, and what it leaves."""
    rows = unit_rows(measured.mechanism, measured.motions, width=WIDTH)
    torque = rows.means(measured.torque)[:, 0]
    target, moving = torque - rows.required(measured.nominal)[:, 0], rows.moving[:, 0]
    inside = moving & (rows.start >= start) & (rows.stop <= stop)
    apart = moving & ((rows.stop <= start) | (rows.start >= stop))
    shapes = rows.friction[:, 0]
    left = target - shapes @ np.linalg.lstsq(shapes[apart], target[apart], rcond=1e-9)[0]
    worst, elsewhere, level = (np.sqrt(np.mean(x**2)) for x in (left[inside], left[apart], torque))
    return bool(worst > max(WORSE * elsewhere, LARGE * level) and elsewhere < FITS * level)


def test_frozen_torques_are_those_that_friction_of_all_other_windows_contradicts():
    found = []
    for length in range(2 * HELD, 10 * HELD, HELD):
        frozen = slice(10 * HELD + 2 * length, 10 * HELD + 3 * length)
        measured = _measured(2000, frozen)
        long = [f for f in frozen_torques(measured) if f.length > 0.25]
        wanted = _is_contradicted(measured, frozen.start * 0.01, frozen.stop * 0.01 - 0.01)
        assert bool(long) == wanted, length
        found.append(wanted)
    assert 0 < sum(found) < len(found)


def _seconds(measured: Measured) -> float:
    begin = time.process_time()
    frozen_torques(measured)
    return time.process_time() - begin


def test_still_torques_cost_no_more_each_in_a_longer_recording():
    short, long = _measured(10_000), _measured(80_000)
    once = min(_seconds(short) for _ in range(3))
    assert min(_seconds(long) for _ in range(2)) < 24 * once  # linear: 8; one fit for each: 64
