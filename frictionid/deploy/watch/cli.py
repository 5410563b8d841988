"""frictionid watch: external torque and friction while a machine runs."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from time import sleep
from typing import Annotated, Any

import typer

from frictionid.cli.options import PresentOrNone, PresentPath
from frictionid.cli.progress import is_quiet


def watch(
    model: PresentPath,
    dataset: Path,
    *,
    follow: Path | None = None,
    port: str = "",
    baud: Annotated[int, typer.Option(min=1)] = 115200,
    header: str = "",
    response: float = 0.1,
    rate: float = 1.0,
    idle: Annotated[float | None, typer.Option(min=0.0)] = None,
    code: Path | None = None,
    data: PresentOrNone = None,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Say which torque acts from outside, and what friction is, while a machine runs.

    Parameters
    ----------
    dataset : Data set of the machine: its columns, and recordings without contact.
    follow : Table that is being written, or will be (CSV).
    port : Serial port that sends such a table.
    baud : Of the port.
    header : First line of the table, where the stream has none.
    response : Lag of the external torque [s].
    rate : False contacts per hour.
    idle : End after so many seconds without data [never].
    code : C file of the observer to write.
    """
    from frictionid.data.readers.dataset import load_dataset
    from frictionid.deploy.compensation import friction_in
    from frictionid.errors import InputError
    from frictionid.friction.model_files import load_model

    from .watch import watch_of, watched, write_code

    if code is None and (follow is None) == (not port):
        raise InputError("watch: name one of --follow FILE and --port NAME, or --code FILE")
    loaded = load_dataset(dataset, data, trust=trust)
    if code is None and loaded.servos:
        raise InputError(
            f"watch: {dataset}: torques by [actuator] need a whole recording: stream a column of "
            "torques, or record first and call frictionid.external_torque"
        )
    machine = watch_of(friction_in(load_model(model)), loaded, response, rate)
    if code is not None:
        for path in write_code(machine, code, [model], replace=replace):
            print(f"written to {path}")
        return
    show = _Shown(machine.mechanism.joints, json)
    ends = float("inf") if idle is None else idle
    seen = None
    for seen in watched(machine, dataset, _source(follow, port, baud), ends, header):
        show(seen)
    if seen is None:
        raise InputError("watch: no sample came: a header and two rows are the least")


def _source(follow: Path | None, port: str, baud: int) -> Callable[[], bytes]:
    from frictionid.files import regular_file

    from .stream import bytes_of_file

    if follow is not None:
        if not follow.exists() and not is_quiet():
            print(f"watch: {follow} is not there yet, waiting; Ctrl-C ends it", file=sys.stderr)
        while not follow.exists():
            sleep(0.1)
        return bytes_of_file(regular_file(follow))
    from frictionid.errors import InputError
    from frictionid.rig.log import Port, UnpluggedError

    opened = Port(port, baud)

    def read() -> bytes:
        try:
            return opened.read(0.0)
        except UnpluggedError:
            raise InputError(f"port {port} is gone: plug it in, and watch again") from None

    return read


class _Shown:
    """Prints contacts when they begin and end, and friction when there is a new estimate."""

    def __init__(self, joints: tuple[str, ...], json: bool) -> None:
        self.joints, self.json = joints, json
        self.converged = False
        self.since: dict[str, tuple[float, float]] = {}  # of joints in contact: start [s], peak
        self.worn: set[tuple[str, bool]] = set()  # joints with other friction, and ways

    def __call__(self, seen: Any) -> None:
        for sentence in seen.damaged:
            print(f"watch: {sentence}", file=sys.stderr)
        columns = seen.time, seen.torque, seen.band, *seen.worn
        for time, *each in zip(*columns, strict=True):
            rows = (row.tolist() for row in each)
            for joint, torque, band, worn, width in zip(self.joints, *rows, strict=True):
                left, wide = torque - worn, math.hypot(band, width)
                self._joint(joint, float(time), left, wide)
                if abs(torque) > band and abs(left) <= wide and abs(worn) > width:
                    self._worn(joint, float(time), torque, band)
        if seen.estimate is not None:
            self._friction(seen.estimate)

    def _worn(self, joint: str, time: float, torque: float, band: float) -> None:
        """Once of a joint that its friction has changed, as both directions of motion show."""
        if (joint, torque > 0) not in self.worn:
            self.worn.add((joint, torque > 0))
            if (joint, torque <= 0) in self.worn:
                text = f"{time:.3f} s: friction of {joint} has changed, {abs(torque):.3g} N m"
                numbers = {"time": time, "friction": joint, "torque": abs(torque), "band": band}
                self._say(f"{text} (band {band:.2g})", numbers)

    def _joint(self, joint: str, time: float, torque: float, band: float) -> None:
        """Of one sample the begin or the end of a contact."""
        touches, begin = abs(torque) > band, joint not in self.since
        if touches and begin:
            self.since[joint] = time, torque
            text = f"{time:.3f} s: contact at {joint}, {torque:+.3g} N m (band {band:.2g})"
            self._say(text, {"time": time, "contact": joint, "torque": torque, "band": band})
        elif touches:
            start, peak = self.since[joint]
            self.since[joint] = start, max(peak, torque, key=abs)
        elif not begin:
            start, peak = self.since.pop(joint)
            seconds = time - start
            text = (
                f"{time:.3f} s: its end at {joint} after {seconds:.2f} s, {peak:+.3g} N m at most"
            )
            self._say(text, {"time": time, "end": joint, "seconds": seconds, "most": peak})

    def _friction(self, e: Any) -> None:
        shares = zip(e.share.tolist(), e.band.tolist(), strict=True)
        each = ", ".join(
            f"{100 * s:.1f}" + (f" +- {100 * b:.1f} %" if b < float("inf") else " %")
            for s, b in shares
        )
        news = e.converged and not self.converged
        self.converged = e.converged
        text = f"{e.seconds:.0f} s of data: friction of the model's {each}"
        numbers = {"seconds": e.seconds, "share": e.share, "band": e.band}
        text += "; converged" * news
        self._say(text, {**numbers, "converged": e.converged})

    def _say(self, text: str, numbers: dict[str, Any]) -> None:
        from frictionid.files import json_text

        if self.json:
            text = " ".join(json_text(numbers).split())
        print(text, flush=True)
