"""Options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Bias = Annotated[
    bool,
    typer.Option("--bias", help="Intervals hold the bias of smoothed states, too; takes seconds."),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust", help="Run the reader or mechanism that a data set names by its module."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print all numbers as JSON.")]
Replace = Annotated[
    bool, typer.Option("--replace", help="Write over files that exist (never over what is read).")
]
Only = Annotated[
    list[str] | None, typer.Option(help="Name of a recording to take; repeatable [all].")
]
Require = Annotated[
    list[str] | None,
    typer.Option(
        "--require",
        help="Exit with 1 unless the verdict on every data set is this: recommended, "
        "simple_enough, undecided, or QUESTION=ANSWER as in verdict.json; repeatable.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", help="A setting, e.g. symmetric=false or bounds.viscous=[0,1]."),
]
Free = Annotated[
    str,
    typer.Option(
        help="Free blocks: friction,inertia,delay,gain,bias,offset,actuator,target_delay,backlash "
        "[friction, and delay where a motor's torque is sampled]."
    ),
]
KnownCalibration = Annotated[
    Path | None,
    typer.Option(
        help="Model file whose base parameters, delay, gain, bias, offset, and what it says of "
        "servos, are held; blocks named by --free have its standard errors as priors."
    ),
]
Equal = Annotated[
    list[str] | None,
    typer.Option(help="Joints with the same friction, e.g. hip_left,hip_right; repeatable."),
]
Fixed = Annotated[
    list[str] | None,
    typer.Option(help="A parameter that is not free, e.g. inertia.gravity_2; repeatable."),
]
Windows = Annotated[
    str | None, typer.Option(help="Lengths of the windows of shooting [s], e.g. 0.1,0.3.")
]
Iterations = Annotated[int | None, typer.Option(min=1, help="Iterations of shooting at most.")]
Consistent = Annotated[
    bool, typer.Option("--consistent", help="Inverse dynamics: inertias that bodies can have.")
]
