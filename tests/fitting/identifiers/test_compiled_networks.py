"""`compile` and `device` of networks: the same numbers, or one line before anything is computed."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from fixtures import tiny_pendulums as tiny
from numpy.testing import assert_allclose

from frictionid.errors import InputError
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.networks.network import Network
from frictionid.fitting.networks.training import compiled, compiler
from frictionid.friction import along
from frictionid.friction.laws import MLP

TINY = Network(MLP((2,)), epochs=2, batch=64)


@pytest.mark.skipif(not compiler(), reason="no C++ compiler, which PyTorch needs, is found")
def test_a_compiled_network_learns_the_same():
    from torch._inductor import config as inductor  # takes seconds

    problem = synthetic_problem(1)
    weights = synthetic_weights(problem)
    eager = along(TINY.fit(problem, weights, 0), problem.nodes)
    # code for no particular processor, without optimisation: most of the time is the compiler's
    plain = {"cpp.simdlen": 1, "aot_inductor.debug_compile": True, "compile_threads": 1}
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
