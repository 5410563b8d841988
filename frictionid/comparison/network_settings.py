"""Settings of networks, as suites and commands name them."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field

from frictionid.errors import InputError
from frictionid.friction.laws import LSTM, MLP, WindowMLP
from frictionid.identifiers import CompressedNetwork, Identifier, Network

Shape = Literal["tanh", "arctan"]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]
Hidden = Annotated[list[Count], Field(min_length=1)] | None
Device = Literal["cpu", "cuda"]
# told as defaults: tuning begins with what a suite leaves out, too
MLP_HIDDEN, WINDOW_MLP_HIDDEN = list(MLP.hidden), list(WindowMLP.hidden)
LSTM_HIDDEN = list(LSTM.hidden)


def mlp(
    hidden: Hidden = MLP_HIDDEN,
    odd: bool = MLP.odd,
    dissipative: bool = MLP.dissipative,
    monotone_tail: bool = MLP.monotone_tail,
    inputs: Literal["own", "all"] = "own",
    solver: Literal["levenberg_marquardt", "adam"] | None = None,
    epochs: Count = Network.epochs,
    batch: Count = Network.batch,
    rate: Positive = Network.rate,
    patience: Count = Network.patience,
    members: Count = 1,
    device: Device = "cpu",
    compile: bool = False,
    width: Positive = 0.02,
    shape: Shape = "tanh",
) -> Identifier:
    """A friction curve by a network of the velocity, on request of all joints' velocities.

    Of its own joint's alone it is fitted by Levenberg-Marquardt, unless `solver` is "adam", whose
    settings are epochs, batch, rate, patience, device and compile.
    """
    law = MLP(tuple(hidden or MLP.hidden), odd, dissipative, monotone_tail, 0, width, shape)
    if solver == "levenberg_marquardt" and inputs == "all":
        raise InputError('solver = "levenberg_marquardt" needs inputs = "own"')
    if solver == "adam" or inputs == "all":
        own = Network(law, epochs, batch, rate, patience=patience, device=device, compile=compile)
        return replace(own, members=members, inputs=inputs)
    ours = (
        ("compile = true", compile),
        (f'device = "{device}"', device != "cpu"),
        (f"epochs = {epochs}", epochs != Network.epochs),
        (f"batch = {batch}", batch != Network.batch),
        (f"rate = {rate}", rate != Network.rate),
        (f"patience = {patience}", patience != Network.patience),
    )
    if told := [name for name, given in ours if given]:
        raise InputError(f'{told[0]} needs solver = "adam": Levenberg-Marquardt does not use it')
    return CompressedNetwork(law, members=members)


def window_mlp(
    samples: Count = WindowMLP.samples,
    presliding: Annotated[float, Field(ge=0)] = WindowMLP.presliding,
    hidden: Hidden = WINDOW_MLP_HIDDEN,
    odd: bool = WindowMLP.odd,
    dissipative: bool = WindowMLP.dissipative,
    monotone_tail: bool = WindowMLP.monotone_tail,
    epochs: Count = Network.epochs,
    batch: Count = Network.batch,
    rate: Positive = Network.rate,
    patience: Count = Network.patience,
    members: Count = 1,
    device: Device = "cpu",
    compile: bool = False,
    width: Positive = 0.02,
    shape: Shape = "tanh",
) -> Identifier:
    """Friction by a network of the velocity and its newest samples.

    presliding : [rad], where positive it reads how far the joint has moved since these samples
    """
    units = tuple(hidden or WindowMLP.hidden)
    options = (odd, dissipative, monotone_tail, width, shape, presliding)
    law = WindowMLP(samples, WindowMLP.sample_time, units, *options)
    own = Network(law, epochs, batch, rate, patience=patience, device=device, compile=compile)
    return replace(own, members=members)


def lstm(
    cells: Count = LSTM.cells,
    hidden: Hidden = LSTM_HIDDEN,
    odd: bool = LSTM.odd,
    dissipative: bool = LSTM.dissipative,
    monotone_tail: bool = LSTM.monotone_tail,
    burn_in: Annotated[int, Field(ge=0)] = Network.burn_in,
    targets: Count = Network.targets,
    epochs: Count = Network.epochs,
    batch: Count = Network.batch,
    rate: Positive = Network.rate,
    patience: Count = Network.patience,
    members: Count = 1,
    device: Device = "cpu",
    compile: bool = False,
    width: Positive = 0.02,
    shape: Shape = "tanh",
    free: bool = False,
) -> Identifier:
    """Friction by a recurrent network of velocity samples."""
    units = tuple(hidden or LSTM.hidden)
    physics = (odd, dissipative, monotone_tail, width, shape)
    law = LSTM(cells, LSTM.sample_time, units, *physics, free)
    own = Network(law, epochs, batch, rate, patience=patience, device=device, compile=compile)
    return replace(own, members=members, burn_in=burn_in, targets=targets)
