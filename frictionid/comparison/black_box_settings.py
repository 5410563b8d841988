"""What suites and commands can set of models without physics."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from pydantic import Field

from frictionid.comparison.network_settings import Count, Device, Hidden, Positive
from frictionid.friction.laws import StateLSTM, StateMLP
from frictionid.identifiers import BlackBox, Identifier, Network, SparseDynamics, StateNetwork

STATE_MLP_HIDDEN, STATE_LSTM_HIDDEN = list(StateMLP.hidden), list(StateLSTM.hidden)


def sindy_dynamics(
    degree: Annotated[int, Field(ge=1)] = SparseDynamics.degree,
    turning: bool = True,
    width: Positive = SparseDynamics.width,
    thresholds: Annotated[list[Positive], Field(min_length=1)] | None = None,
    ridge: Annotated[float, Field(ge=0)] = SparseDynamics.ridge,
    sure: Annotated[float, Field(ge=0)] = SparseDynamics.n_standard_errors,
) -> Identifier:
    """Acceleration as a sparse sum of monomials of q, w and u, without any physics."""
    limits = tuple(thresholds or SparseDynamics.thresholds)
    return BlackBox(SparseDynamics(degree, turning, width, limits, ridge, sure))


def blackbox_mlp(
    hidden: Hidden = STATE_MLP_HIDDEN,
    turning: bool = StateMLP.turning,
    epochs: Count = Network.epochs,
    batch: Count = Network.batch,
    rate: Positive = Network.rate,
    patience: Count = Network.patience,
    members: Count = 1,
    device: Device = "cpu",
    compile: bool = False,
    width: Positive = StateMLP.width,
) -> Identifier:
    """Acceleration by a network of q, w and u of all joints, without any physics."""
    law = StateMLP(hidden=tuple(hidden or StateMLP.hidden), turning=turning, width=width)
    own = Network(law, epochs, batch, rate, patience=patience, device=device, compile=compile)
    return BlackBox(StateNetwork(replace(own, members=members)))


def blackbox_lstm(
    cells: Count = StateLSTM.cells,
    hidden: Hidden = STATE_LSTM_HIDDEN,
    turning: bool = StateLSTM.turning,
    burn_in: Annotated[int, Field(ge=0)] = Network.burn_in,
    targets: Count = Network.targets,
    epochs: Count = Network.epochs,
    batch: Count = Network.batch,
    rate: Positive = Network.rate,
    patience: Count = Network.patience,
    members: Count = 1,
    device: Device = "cpu",
    compile: bool = False,
    width: Positive = StateLSTM.width,
) -> Identifier:
    """Acceleration by a recurrent network of q, w and u of all joints, without any physics."""
    units = tuple(hidden or StateLSTM.hidden)
    law = StateLSTM(cells=cells, hidden=units, turning=turning, width=width)
    own = Network(law, epochs, batch, rate, patience=patience, device=device, compile=compile)
    return BlackBox(StateNetwork(replace(own, members=members, burn_in=burn_in, targets=targets)))
