"""Laws of the small array algebra: the same answers as numpy.linalg, alike on NumPy and torch."""

import numpy as np
import pytest
import torch
from numpy.random import default_rng
from numpy.testing import assert_allclose

from frictionid.arrays import inverse, namespace, solve, times

SIZES = (1, 2, 3)


def well_conditioned(rng, shape, n):
    """Non-symmetric matrices, so that a transposed formula is found out."""
    return rng.normal(size=(*shape, n, n)) + 4.0 * np.eye(n)


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize(
    ("many", "right"), [((), ()), ((3, 4), (3, 4)), ((), (5,)), ((5,), ())], ids=str
)
def test_solve_times_and_inverse_agree_with_numpy_linalg(n, many, right):
    """Also where one matrix serves many right-hand sides, and many matrices one."""
    rng = default_rng(1)
    M, b = well_conditioned(rng, many, n), rng.normal(size=(*right, n))
    solved, product = np.linalg.solve(M, b[..., None])[..., 0], (M @ b[..., None])[..., 0]
    assert_allclose(solve(M, b), solved, rtol=1e-12)
    assert_allclose(times(M, b), product, rtol=1e-12)
    assert_allclose(inverse(M), np.linalg.inv(M), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("n", SIZES)
def test_torch_gives_what_numpy_gives(n):
    rng = default_rng(5)
    M, b = well_conditioned(rng, (6,), n), rng.normal(size=(6, n))
    both = torch.from_numpy(M), torch.from_numpy(b)
    for function, arguments in ((solve, both), (times, both), (inverse, both[:1])):
        out = function(*arguments)
        assert isinstance(out, torch.Tensor)
        expected = function(*(a.numpy() for a in arguments))
        assert_allclose(out.numpy(), expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("n", SIZES)
def test_torch_differentiates_solve_and_inverse(n):
    rng = default_rng(6)
    M = torch.from_numpy(well_conditioned(rng, (2,), n)).requires_grad_()
    b = torch.from_numpy(rng.normal(size=(2, n))).requires_grad_()
    assert torch.autograd.gradcheck(solve, (M, b))
    assert torch.autograd.gradcheck(inverse, (M,))


def test_namespace_follows_the_arguments():
    assert namespace() is np
    assert namespace(1.0, 2) is np
    assert namespace(1.0, np.float64(2.0)) is np
    assert namespace(1.0, torch.zeros(2)).__name__ == "array_api_compat.torch"


def test_numpy_and_torch_do_not_mix():
    with pytest.raises(TypeError, match="[Mm]ultiple namespaces"):
        namespace(np.zeros(2), torch.zeros(2))
