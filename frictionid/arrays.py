"""Small array algebra that runs alike on NumPy and torch (through array-api-compat)."""

from collections.abc import Iterable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from frictionid.errors import InputError

# An array of NumPy. Where a tensor of torch may stand in its place, the namespace is found from the
# arguments, never chosen by the code.
Array = NDArray[Any]
Arrays = TypeVar("Arrays")  # a named tuple of arrays

MAD = 1.4826  # standard deviation over median absolute deviation, of normal noise


def namespace(*arrays: Array) -> Any:
    """Array-API namespace of the arguments: NumPy's, unless one of them is a torch tensor.

    >>> import numpy as np
    >>> float(namespace(np.zeros(2), 1.0).cos(np.zeros(1))[0])
    1.0
    """
    for a in arrays:  # to look further is a sixth of a rollout's time
        if type(a) is not np.ndarray and hasattr(a, "shape") and not isinstance(a, np.generic):
            if hasattr(a, "__array_namespace__"):
                return a.__array_namespace__()
            from array_api_compat import array_namespace  # tensors of torch, whose extra brings it

            return array_namespace(*(a for a in arrays if hasattr(a, "shape")))
    return np


def columns(xp: Any, *entries: Array) -> Array:
    """Arrays of one shape (...) side by side, (..., k): stack for a few, at a third of its time.

    >>> columns(np, np.zeros(2), np.ones(2))
    array([[0., 1.],
           [0., 1.]])
    """
    first = entries[0]
    if type(first) is not np.ndarray:
        return xp.stack(entries, axis=-1)
    out = np.empty((*first.shape, len(entries)), np.result_type(*entries))
    for i, entry in enumerate(entries):
        out[..., i] = entry
    return out


def joined(several: Iterable[Arrays]) -> Arrays:
    """Named tuples of arrays as one, each array behind that of the one before."""
    first, *others = several
    whole: Any = first
    out: Arrays = whole._make(map(np.concatenate, zip(whole, *others, strict=True)))
    return out


def picked(whole: Arrays, rows: Any) -> Arrays:
    """A named tuple of arrays with some rows of each, by their indices, a mask or a slice."""
    parts: Any = whole
    out: Arrays = parts._make(array[rows] for array in parts)
    return out


def usual_step(time: Array) -> float:
    """Usual step between samples (T,).

    >>> usual_step(np.array([0.0, 0.5, 1.0, 9.0]))
    0.5
    """
    return float(np.median(np.diff(time)))


def rms(x: Array, axis: int | tuple[int, ...] | None = None) -> Array:
    """Root mean square over some axes, or of all numbers."""
    out: Array = np.sqrt(np.mean(np.square(x), axis=axis))
    return out


def scatter(x: Array) -> Array:
    """Standard deviation (...) of normal noise about zero (K, ...), by the median of its sizes.

    >>> scatter(np.array([[-2.0], [1.0], [9.0]])).round(4)
    array([2.9652])
    """
    return np.asarray(MAD * np.median(np.abs(x), axis=0))


def huber_cost(size: Array, threshold: float) -> Array:
    """Huber's cost of residuals by their sizes e: e^2, beyond the threshold k 2 k e - k^2.

    >>> huber_cost(np.array([1.0, 2.0, 4.0]), 2.0)
    array([ 1.,  4., 12.])
    """
    return np.where(size <= threshold, size**2, 2 * threshold * size - threshold**2)


def huber_weight(size: Array, threshold: Array | float) -> Array:
    """Weights that make least squares of Huber's cost [Huber1964]: one, beyond the threshold k k/e.

    >>> huber_weight(np.array([1.0, 2.0, 4.0]), 2.0)
    array([1. , 1. , 0.5])
    """
    weight: Array = threshold / np.maximum(size, threshold)
    return weight


def evenly(count: int, most: int) -> Array:
    """Indices of at most so many of `count` things, the first and the last among them.

    >>> evenly(10, 4)
    array([0, 3, 6, 9])
    """
    return np.unique(np.linspace(0, count - 1, most).round().astype(int))


def rows_by(label: Array) -> list[Array]:
    """Rows of each label (K,), in the order of the labels, sorted once: masks are quadratic.

    >>> rows_by(np.array([7, 3, 7]))
    [array([1]), array([0, 2])]
    """
    order = np.argsort(label, kind="stable")
    first = np.unique(label[order], return_index=True)[1]
    return np.split(order, first)[1:]


def stretches(label: Array, order: Array, count: int) -> Array:
    """Number (K,) of the stretch of each row: `count` equal ones of each label (K,), in an order.

    >>> stretches(np.array([0, 0, 0, 0, 4, 4]), np.array([3.0, 1.0, 2.0, 0.0, 5.0, 6.0]), 2)
    array([1, 0, 1, 0, 2, 3])
    """
    out = np.empty(len(label), dtype=int)
    for i, rows in enumerate(rows_by(label)):
        rows = rows[np.argsort(order[rows], kind="stable")]
        out[rows] = i * count + np.arange(len(rows)) * count // len(rows)
    return out


def like(values: Any, array: Array) -> Array:
    """Values as an array of the kind and type of another one, on its device.

    >>> like([1, 2], np.zeros(1))
    array([1., 2.])
    """
    if type(array) is np.ndarray:
        return np.asarray(values, dtype=array.dtype)
    tensor: Array = namespace(array).asarray(values, dtype=array.dtype, device=array.device)
    return tensor


def numbers_like(values: Any, array: Array, where: str) -> Array:
    """What a user gave, like another array; `where` names it."""
    try:
        return like(values, array)
    except (TypeError, ValueError):
        raise InputError(f"{where} = {values!r:.60} must be numbers") from None


def plain(array: Array) -> Any:
    """Values of an array as NumPy, without the gradient and device of a torch tensor.

    >>> plain([1.0, 2.0])
    array([1., 2.])
    """
    return np.asarray(array.detach().cpu() if hasattr(array, "detach") else array)


def solve(M: Array, b: Array) -> Array:
    """Solution x of M x = b for a stack of small systems.

    Written out for one and two joints: on large stacks that is an order of magnitude faster than
    calling LAPACK once per matrix.

    Parameters
    ----------
    M : array, shape (..., n, n)
    b : array, shape (..., n)

    Returns
    -------
    array, shape (..., n)

    >>> import numpy as np
    >>> solve(np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([3.0, 4.0]))
    array([1., 1.])
    """
    xp = namespace(M, b)
    n = M.shape[-1]
    if n == 1:
        return b / M[..., 0]
    if n == 2:
        a, c, d, e = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
        x, y = b[..., 0], b[..., 1]
        det = a * e - c * d
        return columns(xp, (e * x - c * y) / det, (a * y - d * x) / det)
    return xp.linalg.solve(M, b[..., None])[..., 0]


def inverse(M: Array) -> Array:
    """Inverse of a stack of small matrices, shape (..., n, n).

    >>> import numpy as np
    >>> inverse(np.array([[2.0, 0.0], [0.0, 4.0]]))
    array([[0.5 , 0.  ],
           [0.  , 0.25]])
    """
    xp = namespace(M)
    n = M.shape[-1]
    if n == 1:
        return 1.0 / M
    if n == 2:
        a, c, d, e = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
        flat = xp.reshape(columns(xp, e, -c, -d, a), M.shape)
        # + 0.0 turns -0.0 into 0.0, so that printed matrices look the way people write them
        return flat / (a * e - c * d)[..., None, None] + 0.0
    return xp.linalg.inv(M)


def times(M: Array, b: Array) -> Array:
    """Product M b for a stack of matrices (..., n, n) and vectors (..., n).

    >>> import numpy as np
    >>> times(np.eye(2), np.array([1.0, 2.0]))
    array([1., 2.])
    """
    out = M[..., 0] * b[..., None, 0]
    for j in range(1, b.shape[-1]):  # sums over short last axes are slow
        out = out + M[..., j] * b[..., None, j]
    return out
