"""The ordinary way to train a hybrid model in PyTorch: fold by fold, the physics in each step.

One network for each joint gives its friction torque; an explicit Euler step of the mechanism gives
the next velocity [DeMeester2020]; the loss is the mean size of its error. Batches are drawn by a
permutation of tensors in memory, which is several times faster than a DataLoader.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch

from frictionid.data.integrals import averages
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.evaluation import Folds
from frictionid.fitting.one_step.recipe import STUDY, states_of

WINDOW = 9  # velocity samples that the dynamic model sees


class Samples(NamedTuple):
    """One row for each sample interval: q, w (K, window, n), u, w_next, dt (K, 1), and its fold."""

    q: Any
    w: Any
    u: Any
    w_next: Any
    dt: Any
    fold: Any


def samples_of(dataset: Dataset, folds: Folds) -> Samples:
    """Rows of all recordings after their first nine samples, as single-precision tensors."""
    parts: list[list[np.ndarray]] = [[] for _ in range(6)]
    states = states_of(dataset, STUDY.states, None)
    for i, (recording, s) in enumerate(zip(dataset.recordings, states, strict=True)):
        k = np.arange(WINDOW - 1, len(s.time) - 1)
        past = k[:, None] - np.arange(WINDOW - 1, -1, -1)
        u = averages(recording.torque, s.time)[k]
        fold = folds.held_out(np.full(len(k), i), s.time[k])
        row = (s.q[k], s.w[past], u, s.w[k + 1], np.diff(s.time)[k][:, None], fold)
        for part, values in zip(parts, row, strict=True):
            part.append(values)
    *floats, fold = (np.concatenate(part) for part in parts)
    return Samples(*(torch.tensor(x, dtype=torch.float32) for x in floats), torch.tensor(fold))


class Static(torch.nn.Module):
    """Friction of a joint from its velocity now."""

    def __init__(self, scale: float, units: int = 16):
        super().__init__()
        self.scale = scale
        self.net = torch.nn.Sequential(
            *(torch.nn.Linear(1, units), torch.nn.Tanh()),
            *(torch.nn.Linear(units, units), torch.nn.Tanh(), torch.nn.Linear(units, 1)),
        )

    def forward(self, w: Any) -> Any:
        """Torque (B, 1) [N m] of velocities (B, window)."""
        return 0.1 * self.net(w[:, -1:] / self.scale)


class Dynamic(torch.nn.Module):
    """Friction of a joint from its last velocities."""

    def __init__(self, scale: float, units: int = 8):
        super().__init__()
        self.scale = scale
        self.cells = torch.nn.LSTM(1, units, batch_first=True)
        self.out = torch.nn.Linear(units, 1)

    def forward(self, w: Any) -> Any:
        """Torque (B, 1) [N m] of velocities (B, window)."""
        return 0.1 * self.out(self.cells(w[..., None] / self.scale)[0][:, -1])


class Hybrid(torch.nn.Module):
    """Next velocities (B, n): explicit Euler, with the friction of one network for each joint."""

    def __init__(self, dataset: Dataset, networks: list[torch.nn.Module]):
        super().__init__()
        self.plant = plant_of(dataset)[0]
        self.p = torch.tensor(self.plant.p, dtype=torch.float32)
        self.networks = torch.nn.ModuleList(networks)

    def forward(self, s: Samples) -> Any:
        """Next velocities."""
        w = s.w[:, -1]
        friction = torch.cat([net(s.w[..., j]) for j, net in enumerate(self.networks)], dim=1)
        terms = self.plant.mechanism.terms(self.p, s.q, w)
        f = terms.h + (terms.B @ s.u[..., None])[..., 0] - friction
        return w + torch.linalg.solve(terms.M, f) * s.dt


class Training:
    """Training of one fold on the others, by Adam on batches in random order."""

    def __init__(self, dataset: Dataset, samples: Samples, fold: int, kind: type, batch: int = 32):
        torch.manual_seed(0)
        self.batch = batch
        self.learn, self.held = (
            Samples(*(x[which] for x in samples))
            for which in (samples.fold != fold, samples.fold == fold)
        )
        scales = self.learn.w.std(dim=(0, 1))
        self.model = Hybrid(dataset, [kind(float(scale)) for scale in scales])
        self.adam = torch.optim.Adam(self.model.parameters(), lr=1e-3)

    def epochs(self, count: int) -> float:
        """Held-out loss [rad/s] after so many more epochs."""
        for _ in range(count):
            order = torch.randperm(len(self.learn.fold))
            for begin in range(0, len(order), self.batch):
                rows = Samples(*(x[order[begin : begin + self.batch]] for x in self.learn))
                loss = (self.model(rows) - rows.w_next).norm(dim=1).mean()
                self.adam.zero_grad()
                loss.backward()
                self.adam.step()
        with torch.no_grad():
            return float((self.model(self.held) - self.held.w_next).norm(dim=1).mean())
