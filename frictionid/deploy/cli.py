"""frictionid export, compensate, baseline, monitor, pool and watch: what a friction is for."""

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from time import sleep
from typing import Annotated, Any, Literal

import typer

import frictionid as fid
from frictionid.cli.command import (
    DatasetPath,
    ModelPaths,
    PresentOrNone,
    PresentPath,
    check_files,
    heard,
    is_quiet,
    present,
    show,
)
from frictionid.errors import InputError

from .export import FORMATS


def export(
    model: PresentPath,
    *,
    to: Annotated[str, typer.Option(help=f"Format: {', '.join(FORMATS)}; see docs/export.md.")],
    out: Path,
    dataset: Path | None = None,
    into: Path | None = None,
    name: str = "friction",
    precision: Literal["double", "float"] = "double",
    joints: str = "",
    temperature: float | None = None,
    randomise: int = 0,
    seed: int = 0,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Write a fitted friction in the format of a simulator, a controller or a drive.

    Parameters
    ----------
    out : File to write; others stand beside it.
    dataset : Data set that names the joints and shows what is lost.
    into : File of a mechanism whose joints are given friction.
    name : Prefix of names in code.
    precision : Numbers in code: double, or float.
    joints : Names of the joints in the file, in the model's order: hip,knee.
    temperature : Of friction that depends on it [degC].
    randomise : Also write so many samples of the parameters, and ranges.
    seed : Of the samples.
    """
    from .export.exported import ExportSettings

    named = tuple(name.strip() for name in joints.split(",") if name.strip())
    chosen = ExportSettings(name, precision, present(into), named, randomise, seed)
    data = None if dataset is None else fid.load_dataset(dataset, trust=trust)
    with heard(f"exporting ({model.name})"):
        done = fid.export(
            model, to, out, data=data, temperature=temperature, settings=chosen, replace=replace
        )
    numbers = {name: getattr(done, name) for name in ("lost", "notes", "cost", "round_trip")}
    show("\n".join((*done.lost, *done.notes)), numbers, done.paths, json=json)


def compensate(
    model: PresentPath,
    *,
    out: Path,
    to: str = "csv",
    gain: float = 0.9,
    smooth: float = 0.05,
    limit: float | None = None,
    speed: list[float] | None = None,
    json: bool = False,
    replace: bool = False,
) -> None:
    """Write the torque that cancels friction along a reference, over the reference's velocity.

    Parameters
    ----------
    out : File to write.
    to : csv (a table over velocity), or a format of export: c, st ...
    gain : Share that is compensated, at most 1.
    smooth : Reference speed [rad/s] over which the torque changes sides.
    limit : Largest torque [N m].
    speed : Greatest measured speed [rad/s], the table's last; once, or for each joint.
    """
    from frictionid.files import csv_text, write_text
    from frictionid.friction.model_files import load_model
    from frictionid.outputs import check_outputs

    from .compensation import table_error
    from .export.exported import exported
    from .export.nearest import TABLE_USE, lost_in_table

    friction = load_model(model)
    settings = fid.Compensation(gain=gain, smooth=smooth, torque_limit=limit)
    speeds = tuple(speed or friction.provenance.speeds)
    speeds = speeds * friction.n if len(speeds) == 1 else speeds
    friction = friction.noted({"speeds": speeds}) if speeds else friction
    torque = fid.compensating(friction, settings)
    if to != "csv":
        done = fid.export(torque, to, out, settings={"name": "compensation"}, replace=replace)
        written, lost, notes, *_ = done
    else:
        if not speeds:
            raise InputError(f"{model}: the measured speeds are not known; give --speed")
        check_outputs([out], [model], replace=replace)
        table = fid.compensation_table(friction, settings, speeds)
        write_text(out, csv_text(table))
        lost, notes = lost_in_table(exported(torque), table_error(torque, table)), (TABLE_USE,)
        written = (out,)
    show("\n".join((*lost, *notes)), {"lost": lost, "notes": notes}, written, json=json)


STATUS = {"unchanged": 0, "other": 0, "changed": 1, "cannot_tell": 3}


def monitor(
    new: list[Path],
    *,
    baseline: PresentPath,
    rate: float = 0.01,
    state: Path | None = None,
    out: Path | None = None,
    only: list[str] | None = None,
    data: PresentOrNone = None,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Say whether friction, or something else, has changed, and by how much, at a stated rate.

    Exit status: 0 friction has not changed, 1 it has, 3 the recordings cannot tell.

    Parameters
    ----------
    new : Data sets with new recordings.
    baseline : Baseline of healthy recordings.
    rate : Rate of false alarms.
    state : File that keeps arrived recordings and the evidence.
    out : Folder of a page to write.
    """
    from .monitor.monitored import write_monitoring

    sets = [fid.load_dataset(path, data, trust=trust) for path in new]
    monitored = fid.monitor(baseline, sets, rate=rate, state=state, only=only or ())
    page = None if out is None else write_monitoring(out, monitored, replace=replace)
    show(monitored, monitored.document, [page], json=json)
    raise typer.Exit(STATUS[monitored.answer])


def baseline(
    dataset: DatasetPath,
    *,
    out: Path,
    law: str = "stribeck",
    model: PresentOrNone = None,
    only: list[str] | None = None,
    data: PresentOrNone = None,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Record the friction of a healthy machine, for `frictionid monitor`.

    Parameters
    ----------
    out : Baseline to write (JSON).
    law : Identifier of the friction that changes are measured against.
    model : Model file in place of that fit.
    """
    check_files([out], [model], dataset, data, replace=replace)
    loaded = fid.load_dataset(dataset, data, trust=trust)
    with heard(f"baseline ({loaded.name})"):
        healthy = fid.baseline(loaded, out, law=law, model=model, only=only or ())
    shares = dict(zip(healthy.joints, healthy.scatter.tolist(), strict=True))
    lines = [f"{len(healthy.names)} healthy recordings of {', '.join(healthy.joints)}"]
    for joint, share in shares.items():
        size = f"by {100.0 * share:.3g} %" if share else "by less than is seen"
        lines.append(f"friction of {joint} scatters {size} between them")
    numbers = {"recordings": healthy.names, "scatter": shares}
    show("\n".join(lines), numbers, [out], json=json)


def pool(
    models: ModelPaths,
    *,
    out: Path,
    ranges: Path | None = None,
    equal: list[str] | None = None,
    over: str | None = None,
    at: float | None = None,
    json: bool = False,
    replace: bool = False,
) -> None:
    """Pool fitted models of several specimens: means, spread, and ranges of another specimen.

    Parameters
    ----------
    out : Model file to write: the means, and the ranges.
    ranges : Ranges of another specimen to write (JSON), with units.
    over : A covariate with its value for each model, e.g. temperature=20,30,40: parameters as lines
        over it.
    at : Value of the covariate to write; the middle.
    """
    from frictionid.files import write_json
    from frictionid.friction.model_files import model_paths
    from frictionid.outputs import check_outputs

    read = [path for model in models for path in model_paths(model)]
    groups = [[name.strip() for name in group.split(",")] for group in equal or []]
    check_outputs([*model_paths(out), ranges], read, replace=replace)
    if over is not None:
        if groups or ranges is not None:
            raise InputError("pool: --over goes with neither --equal nor --ranges: leave them out")
        _over(models, over, at, out, json=json)
        return
    if at is not None:
        raise InputError("pool: --at needs --over, which names the covariate")
    pooled = fid.pool(models, equal=groups)
    pooled.save(out)
    if ranges is not None:
        write_json(ranges, {"format": "frictionid ranges 1", "ranges": pooled.ranges()})
    show(pooled, pooled.several._asdict(), (out, ranges), json=json)


def _over(models: list[Path], over: str, at: float | None, out: Path, *, json: bool) -> None:
    """Print the parameters over a covariate, and write the friction at one value of it."""
    from frictionid.friction.model_files import save_model

    name, _, numbers = over.partition("=")
    try:
        values = [float(value) for value in numbers.split(",")]
    except ValueError:
        raise InputError(f"--over {over}: write it as temperature=20,30,40") from None
    lines = fid.over_covariate({str(model): model for model in models}, name, values)
    value = sum(lines.span) / 2 if at is None else at
    save_model(lines.at(value), out)
    print(lines.frame.to_json(orient="records") if json else lines)
    if not json:
        print(f"written to {out}: friction at {name} = {value:g}")


# --- Watch ----------------------------------------------------------------------------------------


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
    from frictionid.friction.model_files import load_model

    from .compensation import friction_in
    from .watch import watch_of, watched, write_code

    if code is None and (follow is None) == (not port):
        raise InputError("watch: name one of --follow FILE and --port NAME, or --code FILE")
    loaded = fid.load_dataset(dataset, data, trust=trust)
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
    ends = float("inf") if idle is None else idle
    seen = watched(machine, dataset, _source(follow, port, baud), ends, header)
    _show_stream(seen, machine.mechanism.joints, json=json)


def _source(follow: Path | None, port: str, baud: int) -> Callable[[], bytes]:
    from frictionid.files import regular_file

    from .watch import bytes_of_file

    if follow is not None:
        if not follow.exists() and not is_quiet():
            print(f"watch: {follow} is not there yet, waiting; Ctrl-C ends it", file=sys.stderr)
        while not follow.exists():
            sleep(0.1)
        return bytes_of_file(regular_file(follow))
    from frictionid.rig.log import Port, UnpluggedError

    opened = Port(port, baud)

    def read() -> bytes:
        try:
            return opened.read(0.0)
        except UnpluggedError:
            raise InputError(f"port {port} is gone: plug it in, and watch again") from None

    return read


def _show_stream(several: Iterable[Any], joints: Sequence[str], *, json: bool) -> None:
    """Print contacts when they begin and end, and friction when there is a new estimate."""
    from frictionid.files import json_text

    since: dict[str, tuple[float, float]] = {}  # of joints in contact: start [s], peak
    worn: set[tuple[str, bool]] = set()  # joints with other friction, and ways
    seen, converged = None, False
    for seen in several:
        for sentence in seen.damaged:
            print(f"watch: {sentence}", file=sys.stderr)
        said = list(_contacts(seen, joints, since, worn))
        if (e := seen.estimate) is not None:
            numbers = {"seconds": e.seconds, "share": e.share, "band": e.band}
            news = "; converged" * (e.converged and not converged)
            said.append((_friction(e) + news, {**numbers, "converged": e.converged}))
            converged = e.converged
        for text, numbers in said:
            print(" ".join(json_text(numbers).split()) if json else text, flush=True)
    if seen is None:
        raise InputError("watch: no sample came: a header and two rows are the least")


def _contacts(
    seen: Any, joints: Sequence[str], since: dict[str, Any], worn: set[tuple[str, bool]]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Begins and ends of contacts, which `since` has while they last, as text and in numbers.

    And changes of friction, once both ways of a joint show one, which are `worn` then.
    """
    columns = seen.torque, seen.band, *seen.worn
    for time, *each in zip(seen.time.tolist(), *columns, strict=True):
        rows = (row.tolist() for row in each)
        for joint, torque, band, change, width in zip(joints, *rows, strict=True):
            left, wide = torque - change, math.hypot(band, width)
            touches, begins = abs(left) > wide, joint not in since
            if touches and begins:
                since[joint] = time, left
                text = f"{time:.3f} s: contact at {joint}, {left:+.3g} N m (band {wide:.2g})"
                yield text, {"time": time, "contact": joint, "torque": left, "band": wide}
            elif touches:
                start, peak = since[joint]
                since[joint] = start, max(peak, left, key=abs)
            elif not begins:
                start, peak = since.pop(joint)
                seconds, most = time - start, f"{peak:+.3g} N m at most"
                text = f"{time:.3f} s: its end at {joint} after {seconds:.2f} s, {most}"
                yield text, {"time": time, "end": joint, "seconds": seconds, "most": peak}
            way = joint, torque > 0
            if not touches and abs(torque) > band and abs(change) > width and way not in worn:
                worn.add(way)
                if (joint, torque <= 0) in worn:
                    size = f"{abs(torque):.3g} N m (band {band:.2g})"
                    numbers = {"time": time, "friction": joint, "torque": abs(torque)}
                    yield f"{time:.3f} s: friction of {joint} has changed, {size}", numbers


def _friction(e: Any) -> str:
    """An estimate in words."""
    each = ", ".join(
        f"{100 * s:.1f}" + (f" +- {100 * b:.1f} %" if b < float("inf") else " %")
        for s, b in zip(e.share.tolist(), e.band.tolist(), strict=True)
    )
    return f"{e.seconds:.0f} s of data: friction of the model's {each}"
