"""frictionid export and frictionid compensate: a friction for simulators, controllers, drives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from frictionid.cli.options import Json, ModelPath, Replace, Trust, present


def export(
    model: ModelPath,
    to: Annotated[
        str,
        typer.Option(
            help="Format, of code: c, st, python, casadi, onnx, torchscript, latex, yaml; of "
            "engines: mujoco, urdf, bam, isaac. See docs/export.md."
        ),
    ],
    out: Annotated[Path, typer.Option(help="File to write; others stand beside it.")],
    dataset: Annotated[
        Path | None,
        typer.Option(help="Data set that names the joints and shows what is lost."),
    ] = None,
    into: Annotated[
        Path | None, typer.Option(help="File of a mechanism whose joints are given friction.")
    ] = None,
    name: Annotated[str, typer.Option(help="Prefix of names in code.")] = "friction",
    precision: Annotated[
        Literal["double", "float"], typer.Option(help="Numbers in code: double, or float.")
    ] = "double",
    joints: Annotated[
        str, typer.Option(help="Names of the joints in the file, in the model's order: hip,knee.")
    ] = "",
    temperature: Annotated[
        float | None, typer.Option(help="Of friction that depends on it [degC].")
    ] = None,
    randomise: Annotated[
        int, typer.Option(min=0, help="Also write so many samples of the parameters, and ranges.")
    ] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the samples.")] = 0,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Write a fitted friction in the format of a simulator, a controller or a drive."""
    from frictionid.data.readers.dataset import load_dataset
    from frictionid.deploy.api.export import export as write
    from frictionid.deploy.export.formats import ExportSettings
    from frictionid.files import json_text

    named = tuple(name.strip() for name in joints.split(",") if name.strip())
    chosen = ExportSettings(name, precision, present(into), named, randomise, seed)
    data = None if dataset is None else load_dataset(dataset, trust=trust)
    done = write(
        model, to, out, data=data, temperature=temperature, settings=chosen, replace=replace
    )
    if json:
        cost = None if done.cost is None else done.cost._asdict()
        document = {"lost": done.lost, "notes": done.notes, "cost": cost, "written": done.paths}
        print(json_text(document), end="")
        return
    for sentence in (*done.lost, *done.notes):
        print(sentence)
    for path in done.paths:
        print(f"written to {path}")


def compensate(
    model: ModelPath,
    out: Annotated[Path, typer.Option(help="File to write.")],
    to: Annotated[
        str, typer.Option(help="csv (a table over velocity), or a format of export: c, st ...")
    ] = "csv",
    gain: Annotated[float, typer.Option(help="Share that is compensated, at most 1.")] = 0.9,
    smooth: Annotated[
        float, typer.Option(help="Reference speed [rad/s] over which the torque changes sides.")
    ] = 0.05,
    limit: Annotated[float | None, typer.Option(help="Largest torque [N m].")] = None,
    speed: Annotated[
        list[float] | None,
        typer.Option(
            help="Greatest measured speed [rad/s], the table's last; once, or for each joint."
        ),
    ] = None,
    json: Json = False,
    replace: Replace = False,
) -> None:
    """Write the torque that cancels friction along a reference, over the reference's velocity."""
    from dataclasses import replace as renewed

    from frictionid.comparison.registry import friction_of
    from frictionid.deploy.api.export import export
    from frictionid.deploy.export.formats import ExportSettings
    from frictionid.deploy.use.compensation import Compensation, compensating, compensation_table
    from frictionid.errors import InputError
    from frictionid.evaluation import known_speeds
    from frictionid.files import json_text, write_bytes
    from frictionid.outputs import check_outputs

    friction = friction_of(model)
    settings = Compensation(gain=gain, smooth=smooth, torque_limit=limit)
    known = tuple(speed or known_speeds(friction))
    known = known * friction.n if len(known) == 1 else known
    source = {**friction.provenance, **({"speeds": known} if known else {})}
    friction = renewed(friction, provenance=source)
    if to != "csv":
        own = compensating(friction, settings)
        names = ExportSettings(name="compensation")
        written = export(own, to, out, settings=names, replace=replace).paths
    else:
        if not known:
            raise InputError(f"{model}: the measured speeds are not known; give --speed")
        check_outputs([out], [model], replace=replace)
        table = compensation_table(friction, settings, known)
        write_bytes(out, table.to_csv(index=False, float_format="%.9g").encode())
        written = (out,)
    if json:
        print(json_text({"written": written}), end="")
        return
    for path in written:
        print(f"written to {path}")
