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
NO_CUDA = pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")


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


@pytest.fixture
def refused(tmp_path, run):
    """What the command line says of a suite whose second identifier has these settings."""

    def said(settings):
        network = {"kind": "mlp", "solver": "adam", **settings}
        changes = [("identifiers", [{"kind": "none"}, network])]
        file = tiny.write_suite(tmp_path, changes)
        code, out, err = run(tmp_path, "compare", file, "--out", "out")
        assert code == 2 and not (tmp_path / "out").exists()  # nothing has been computed
        assert err.startswith("frictionid: ") and err.count("\n") == 1 and not out
        return err

    return said


def test_a_suite_without_a_compiler_computes_nothing(refused, monkeypatch):
    monkeypatch.setenv("CXX", "no-such-compiler")
    said = refused({"compile": True})
    assert re.search("identifier 'mlp'.*needs a C.. compiler.*'no-such-compiler'.*leave comp", said)


@NO_CUDA
def test_a_suite_without_a_device_computes_nothing(refused):
    said = refused({"device": "cuda"})
    assert "PyTorch sees no CUDA device here: leave the device out" in said
