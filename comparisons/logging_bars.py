"""What logging must show: ten minutes at 1 kHz with faults, and kill -9 at 50 moments in real time.

    python comparisons/logging_bars.py

The first part plays 600 000 lines as fast as they are read; the second runs in real time, and
compares what is in the file with what was sent a second before the logger was killed.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from fixtures.drive_ports import flood, logger, setup, until

from frictionid.rig.logfile import read_log
from frictionid.rig.rig_settings import parsed, written
from frictionid.rig.virtual_drive import Terminal

LINES, DAMAGED, UNPLUGGED = 600_000, 0.01, 3
KILLED, RATE = 50, 1000


def ten_minutes(folder: Path) -> None:
    """Every undamaged line exactly once, in order."""
    made, start = setup(), time.monotonic()
    child = os.fork()
    if not child:
        flood(folder, LINES, DAMAGED, UNPLUGGED)
        os._exit(0)
    until((folder / "port").exists)
    log = logger(folder / "port", folder / "log.csv", made)
    while not os.waitpid(child, os.WNOHANG)[0]:
        log.pump(0.02)
    log.pump(0.0)
    log.close()
    sent, *_ = parsed(made.protocol, b"", (folder / "sent.txt").read_bytes())
    columns = read_log(folder / "log.csv").columns
    logged = np.stack([columns[n] for n in ("time", "command", "current")], axis=1)
    wanted = np.array(sent, dtype=float) / [1e6, 1.0, 1.0]
    same = logged.shape == wanted.shape and bool((logged == wanted).all())
    print(
        f"{len(wanted)} undamaged lines of {LINES} sent, {log.counts.rejected} damaged, "
        f"{log.counts.unplugged} disconnections: "
        f"{'each logged once, in order' if same else f'{len(logged)} logged: NOT THE SAME'} "
        f"({time.monotonic() - start:.0f} s)"
    )


def killed(folder: Path, seed: int) -> tuple[int, int]:
    """Lines sent a second and more before the kill that are missing, and all that are missing."""
    generator, made = np.random.default_rng(seed), setup()
    form, out = made.protocol, folder / f"{seed}.csv"
    terminal = Terminal(folder / f"port{seed}")
    child = os.fork()
    if not child:
        log = logger(terminal.link, out, made)
        while True:
            log.pump(1.0)
    until(lambda: bool(terminal.received(0.1)))
    start, end, sent = time.monotonic(), float(generator.uniform(1.2, 3.0)), 0
    moments = []
    while (now := time.monotonic() - start) < end:
        due = int(now * RATE)
        content = b"".join(written(form, (str(1000 * k), "0.1", "0.2")) for k in range(sent, due))
        while content:
            content = content[terminal.send(content, 1.0) :]
        moments += [now] * (due - sent)
        sent = due
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    terminal.unplug()
    times = read_log(out).columns["time"]
    assert np.array_equal(times, np.round(1e-3 * np.arange(len(times)), 6))
    old = int(np.searchsorted(moments, end - 1.0))
    return max(old - len(times), 0), sent - len(times)


def main() -> None:
    """Both parts."""
    with tempfile.TemporaryDirectory() as folder:
        ten_minutes(Path(folder))
    with tempfile.TemporaryDirectory() as folder:
        lost = [killed(Path(folder), seed) for seed in range(KILLED)]
    print(
        f"{KILLED} loggers killed in real time: every file loads, in order; "
        f"{sum(old for old, _ in lost)} lines older than a second missing, of the last second at "
        f"most {max(new for _, new in lost)}"
    )


if __name__ == "__main__":
    main()
