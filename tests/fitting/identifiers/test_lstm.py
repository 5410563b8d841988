"""The identifier `lstm`, cells that read velocity samples; compiled costs, slow machines."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from fixtures import tiny_pendulums as tiny
from fixtures.exact_problems import cost, everything, explained_by, fit_to_all
from fixtures.learned_laws import assert_slopes_in_memory, costs_of_rows, drawn
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.errors import InputError
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.identifiers.compressed import CompressedNetwork
from frictionid.fitting.identifiers.network import Network
from frictionid.fitting.identifiers.network_data import (
    CompiledCells,
    FoldStack,
    SequenceTrainingSet,
    cells,
)
from frictionid.fitting.identifiers.network_training import compiled, compiler
from frictionid.fitting.one_step.residual import mask_stiction
from frictionid.friction import Friction, along, at_rest, memory_along
from frictionid.friction.laws import LSTM, MLP, FilmLag, Stribeck, WindowMLP, check_law

FREE = LSTM(3, hidden=(4,), dissipative=False, monotone_tail=False, free=True)
SMALL = Network(LSTM(3, hidden=(4,)), epochs=3, batch=40, targets=12)


@pytest.mark.parametrize("law", [LSTM(2, hidden=(2,)), LSTM(2, hidden=(2,), odd=True), FREE])
def test_it_keeps_to_the_contract_of_laws(law):
    check_law(law)


def test_a_free_network_makes_friction_of_the_samples_alone():
    theta, x = drawn(FREE), at_rest(np.full(2, 2.0))
    memory = FREE.advance(theta, x, FREE.start(theta, x), np.full((1,), FREE.sample_time))
    before, after = (FREE.torque(theta, at_rest(np.full(2, w)), memory) for w in (2.0, -0.1))
    assert_array_equal(before, after)  # of any sign, and held until the next sample
    assert (FREE.limit(theta, x, memory) == 0).all()
    later = FREE.advance(theta, at_rest(np.full(2, -0.1)), memory, np.full((1,), 0.02))
    assert (np.abs(FREE.torque(theta, x, later) - before) > 1e-6).all()


@pytest.mark.parametrize("law", [LSTM(3, hidden=(4, 2)), LSTM(2, hidden=(3,), odd=True), FREE])
def test_slopes_in_the_memory_are_those_of_differences(law):
    rng = np.random.default_rng(2)
    theta = drawn(law)[0]
    x = at_rest(3.0 * rng.normal(size=(6, 2)))
    memory = tuple(z + 0.3 * rng.normal(size=z.shape) for z in law.start(theta, x))
    slopes = law.memory_slopes(theta, x, memory)
    assert_slopes_in_memory(law, theta, x, memory, slopes, 1e-6, atol=1e-8, rtol=1e-7)


def test_it_may_drive_a_joint_where_it_need_not_dissipate():
    nodes, law = synthetic_problem(2).nodes, LSTM(3, hidden=(4,), dissipative=False)
    theta = drawn(law)
    theta[..., -1] -= 2.0
    assert (along(Friction(law, theta), nodes) * nodes.inputs.w < 0).any()


def test_it_remembers_and_forgets():
    law = LSTM(4, hidden=(4,))
    theta, x = drawn(law), at_rest(np.full(2, 2.0))
    fast = x.each(lambda v: 3.0 * v)
    dt = np.full((1,), law.sample_time)
    memory = [law.start(theta, x)]
    for first in (x, fast):
        state = memory[0]
        for _ in range(10):
            state = law.advance(theta, first, state, dt)
        memory.append(state)
    slow, other = (law.torque(theta, x, m) for m in memory[1:])
    assert (np.abs(slow - other) > 1e-5).any()
    for _ in range(400):
        memory = [law.advance(theta, x, m, dt) for m in memory]
    assert_allclose(law.torque(theta, x, memory[1]), law.torque(theta, x, memory[2]))


def test_numpy_and_torch_agree():
    law = LSTM(3, hidden=(4,), odd=True)
    theta, w = drawn(law), np.random.default_rng(1).normal(0.0, 3.0, (5, 2))
    states = []
    for kind in (np.asarray, torch.tensor):
        numbers = kind(theta[:, None])
        memory = law.start(numbers, at_rest(kind(w)))
        for step in range(4):
            x = at_rest(kind(w * (1 + step)))
            memory = law.advance(numbers, x, memory, kind(np.full((1,), 0.02)))
        states.append(np.asarray(law.torque(numbers, x, memory)))
    assert_allclose(*states, rtol=1e-12)


@pytest.mark.parametrize("burn_in", [0, 3])
def test_compiled_loops_are_those_of_tensors(burn_in):
    rng = torch.Generator().manual_seed(0)

    def drawn(*shape):
        return torch.randn(*shape, dtype=torch.float64, generator=rng)

    read, slope = 5.0 * drawn(2, 4, 7, 3, 2), drawn(2, 4, 7 - burn_in, 3, 5)
    weights = drawn(2, 3, 2 + 5 + 1, 20).requires_grad_()  # two folds, three joints, five cells
    plain, fast = (f(weights, read, burn_in) for f in (cells, CompiledCells.apply))
    torch.testing.assert_close(fast, plain, rtol=1e-9, atol=1e-9)
    a, b = (torch.autograd.grad((x * slope).sum(), weights)[0] for x in (fast, plain))
    torch.testing.assert_close(a, b, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("law", [LSTM(3, hidden=(4,)), WindowMLP(2, hidden=(3,))], ids=str)
def test_folds_with_problems_of_their_own_are_as_alone(law):
    problem = synthetic_problem(2)
    weights = synthetic_weights(problem)
    each = [replace(problem, r=(1.0 + 0.1 * f) * problem.r) for f in range(len(weights))]
    settings = Network(law, epochs=3, batch=32)
    together = settings.fit_each(each, weights, 1)
    assert len(together.provenance.learning["training"]) == len(weights)
    for f, alone in enumerate(each):
        theta = settings.fit(alone, weights[f : f + 1], 1).theta
        assert_allclose(together.theta[f : f + 1], theta, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(
    "law", [LSTM(3, hidden=(4,)), LSTM(3, hidden=(4,), odd=True), FREE], ids=["", "odd", "free"]
)
def test_cost_of_the_pieces_is_that_of_the_rows(law):
    problem = synthetic_problem(2)
    # the pieces read the first sample some times before the second: rows by which that is forgotten
    late = np.concatenate([np.arange(40) >= 25] * 3)
    weights, theta = synthetic_weights(problem) * late, drawn(law)
    a, b = law.gate_sizes
    theta[..., 3 + a * b + law.cells : 3 + a * b + 2 * law.cells] -= 2.0
    stack = FoldStack(law, [problem] * len(theta), theta, "cpu")
    pieces = SequenceTrainingSet(stack, weights, 40, 8)
    items = stack.tensor(np.tile(np.arange(pieces.items), (3, 1)))
    found = pieces.cost(stack.tensor(theta), items) * pieces.items * pieces.rows_per_item
    memories = memory_along(Friction(law, theta), problem.nodes)
    assert len(memories[0]) == 2 * law.cells * (1 + law.odd)
    exact = costs_of_rows(problem, weights, law, theta)
    assert_allclose(found, exact, rtol=1e-4)


def test_pieces_are_no_longer_than_recordings_and_batches_no_larger_than_all_rows():
    problem = synthetic_problem(1)
    longest = len(problem.r)
    one, two = (
        fit_to_all(replace(SMALL, epochs=1, targets=t, batch=b), problem)
        for t, b in ((longest, 256), (10**7, 10**12))
    )
    assert_allclose(one.theta, two.theta, rtol=1e-6, atol=1e-9)
    rows = Network(MLP((4,)), epochs=1, batch=10**12)
    assert np.isfinite(fit_to_all(rows, problem).theta).all()
    with assert_refused("burn_in = 100000 samples .* longest recording"):
        fit_to_all(replace(SMALL, burn_in=100000), problem)


@pytest.mark.parametrize(
    "learner",
    [
        Network(LSTM(4, hidden=(8,)), epochs=300, batch=120, rate=2e-2, patience=300, targets=20),
        Network(WindowMLP(8), epochs=300, batch=60, patience=300),
    ],
    ids=["lstm", "window_mlp"],
)
def test_memory_finds_what_a_static_law_cannot(learner):
    theta = np.array([[0.05, 0.12, 1.5, 0.01, 0.1]])
    problem = explained_by(FilmLag(), theta, 5e-4)
    weights = everything(problem)
    static = LeastSquares(Stribeck()).fit(problem, weights, 0)
    found = learner.fit(problem, weights, 0)
    assert found.law.sample_time == pytest.approx(0.02)
    assert cost(problem, weights, found) < 0.5 * cost(problem, weights, static)


# --- Compiled costs, devices ----------------------------------------------------------------------

TINY = Network(MLP((2,)), epochs=2, batch=64)


@pytest.mark.skipif(not compiler(), reason="no C++ compiler, which PyTorch needs, is found")
def test_a_compiled_network_learns_the_same():
    from torch._inductor import config as inductor  # takes seconds

    problem = synthetic_problem(1)
    weights = synthetic_weights(problem)
    eager = along(TINY.fit(problem, weights, 0), problem.nodes)
    # code for no particular processor, without optimisation: most of the time is the compiler's
    plain = {"cpp.vec_isa_ok": False, "aot_inductor.debug_compile": True, "compile_threads": 1}
    with inductor.patch({**plain, "cpp_cache_precompile_headers": False}):
        quick = along(replace(TINY, compile=True).fit(problem, weights, 0), problem.nodes)
    assert_allclose(quick, eager, rtol=0, atol=1e-9 * np.abs(eager).max())


def test_what_cannot_be_compiled_is_refused_in_one_line(monkeypatch):
    def broken(*_):
        raise RuntimeError("InvalidCxxCompiler: No working C++ compiler\nand much more")

    monkeypatch.setattr(torch, "compile", lambda _: broken)
    with pytest.raises(InputError, match=r"compile = true.*No working.*leave compile out"):
        compiled(torch.sin)(torch.ones(1))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            {"compile": True},
            "identifier 'mlp'.*needs a C.. compiler.*'no-such-compiler'.*leave comp",
        ),
        pytest.param(
            {"device": "cuda"},
            "PyTorch sees no CUDA device here: leave the device out",
            marks=pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device"),
        ),
    ],
    ids=["compiler", "device"],
)
def test_a_suite_without_what_it_asks_for_computes_nothing(
    settings, words, tmp_path, run, monkeypatch
):
    monkeypatch.setenv("CXX", "no-such-compiler")
    network = {"kind": "mlp", "solver": "adam", **settings}
    file = tiny.write_suite(tmp_path, [("identifiers", [{"kind": "none"}, network])])
    code, out, err = run(tmp_path, "compare", file, "--out", "out")
    assert (code, out, err.count("\n")) == (2, "", 1) and not (tmp_path / "out").exists()
    assert re.search(f"^frictionid: .*{words}", err)


# --- Slow machines --------------------------------------------------------------------------------

SLOW = 0.01  # times as fast
IDENTIFIERS = {
    "least squares": (LeastSquares, Stribeck(), {}),
    "compressed squares": (CompressedNetwork, MLP((3,)), {"nodes": 6}),
    "static network": (Network, MLP((3,)), {"epochs": 2}),
    "recurrent network": (Network, LSTM(2, hidden=(2,)), {"epochs": 2}),
}


@pytest.mark.parametrize(("kind", "law", "settings"), IDENTIFIERS.values(), ids=IDENTIFIERS)
def test_a_slow_slide_is_fitted_whatever_the_width(kind, law, settings):
    problem = synthetic_problem(1)
    inputs = problem.nodes.inputs
    slow = problem.nodes._replace(inputs=inputs._replace(w=SLOW * inputs.w))
    masked = mask_stiction(replace(problem, nodes=slow, slowest=SLOW * problem.slowest), 0.2 * SLOW)
    fits = [
        kind(law.with_width(width), **settings).fit(masked, np.ones((1, len(masked.r))), 0)
        for width in (0.02, 0.001)
    ]
    assert_array_equal(fits[0].theta, fits[1].theta)
