"""Networks on all folds at once, beside the ordinary PyTorch loop, fold by fold.

Both learn an explicit Euler step of the same rows from the study's states [DeMeester2020]. The loop
trains one fold; ten of them take ten times as long. Each round is half of its training.
"""

from __future__ import annotations

from case import Case, NotInstalledError, Part, Side
from fits import FOLDS, OURS, Folds
from samples import acrobot

from frictionid.data.plants import plant_of
from frictionid.evaluation import Split, make_folds
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers.compressed import CompressedNetwork
from frictionid.fitting.identifiers.network import Network
from frictionid.fitting.one_step.recipe import STUDY, problem_of
from frictionid.friction import along
from frictionid.friction.laws import LSTM, MLP

EPOCHS, BATCH, ROUNDS = 100, 32, 2
HISTORY = 9 / 60  # [s]
ERROR = "held-out step [rad/s]"


def networks() -> Part:
    """Static networks by least squares and by Adam, and a recurrent one."""
    import torch_loop as loop

    loop.torch.set_num_threads(1)
    dataset = acrobot()
    problem = problem_of(dataset, plant_of(dataset), STUDY, history=HISTORY)
    made = make_folds(dataset.recordings, Split(count=FOLDS))
    folds = Folds(problem, made.training(problem.recording, problem.time))
    samples = loop.samples_of(dataset, made)
    assert len(samples.fold) == len(problem.r)

    def ours(how: str, identifier: Identifier, *imports: str) -> Side:
        def run() -> float:
            friction = identifier.fit(problem, folds.weights, 0)[0]
            return folds.held_out(problem.residual(along(friction, problem.nodes)))

        return Side(f"frictionid, {how}, all folds at once", run, (*OURS, *imports))

    def theirs(kind: type) -> Side:
        training = loop.Training(dataset, samples, 0, kind, BATCH)
        return Side(
            "PyTorch, fold by fold",
            lambda: training.epochs(EPOCHS // ROUNDS),
            ("torch",),
            1 / FOLDS / ROUNDS,
        )

    static, recurrent = theirs(loop.Static), theirs(loop.Dynamic)
    # free as the loop's, and in pieces of few samples: as many as in a batch of the loop
    free = LSTM(dissipative=False, monotone_tail=False, free=True)
    lstm = Network(free, 40, BATCH, rate=7e-3, share=0.05, patience=40, targets=8)
    squares = ours("Levenberg-Marquardt", CompressedNetwork(MLP()))
    adam = ours("Adam", Network(MLP(), epochs=20), "torch")
    dynamic = ours("Adam", lstm, "torch")
    return Part(
        (
            Case("MLP, ten folds", squares, static, ERROR, bar=40.0, once=True),
            Case("MLP stochastic, ten folds", adam, static, ERROR, bar=12.0, once=True),
            Case("LSTM, ten folds", dynamic, recurrent, ERROR, bar=10.0, once=True),
        ),
        ROUNDS,
    )


def on_gpu() -> Part:
    """A static network by Adam on a CUDA device and on the processor, with equal numbers."""
    import torch

    if not torch.cuda.is_available():
        raise NotInstalledError("a CUDA device")
    dataset = acrobot()
    problem = problem_of(dataset, plant_of(dataset), STUDY)
    made = make_folds(dataset.recordings, Split(count=FOLDS))
    folds = Folds(problem, made.training(problem.recording, problem.time))

    def side(device: str) -> Side:
        network = Network(MLP(), 20, device=device)

        def run() -> float:
            friction = network.fit(problem, folds.weights, 0)[0]
            return folds.held_out(problem.residual(along(friction, problem.nodes)))

        return Side(f"frictionid, {device}", run)

    case = Case("MLP stochastic, ten folds, GPU", side("cuda"), side("cpu"), ERROR, clock="wall")
    return Part((case,), ROUNDS)
