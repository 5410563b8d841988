"""NumPy's archives are tables: arrays are columns, and so are those of matrices."""

import io

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from numpy.testing import assert_array_equal

from frictionid.data.readers.table import numeric_table, read_table

T = np.arange(40)
LOG = {"t": T, "q": np.stack([T / 2, -T], axis=1), "names": np.array(["a", "b"]), "mass": [1.0]}


def archive(save=np.savez, **arrays):
    stream = io.BytesIO()
    save(stream, **arrays)
    return stream.getvalue()


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_and_columns_of_matrices_are_columns(save):
    content = archive(save, **LOG)
    table = numeric_table(content, "a.npz")
    assert list(table.columns) == ["t", "q[0]", "q[1]"]
    found = read_table(content, "a.npz", ["q[1]", "t"]).columns
    assert_array_equal(found["q[1]"], -T)
    assert_array_equal(found["t"], table.columns["t"])


WRONG = {
    "no archive": (b"PK", ["t"], "is no whole NumPy archive"),
    "an object": (archive(t=np.array([{}], dtype=object)), ["t"], "is no whole NumPy archive"),
    "no column": (archive(**LOG), ["q"], r"no column 'q'; it has 't', 'q\[0\]'"),
    "two lengths": (archive(**LOG), ["t", "mass"], r"differ in length \('t' 40, 'mass' 1\)"),
    "too large": (archive(np.savez_compressed, t=np.zeros(10_000_000)), ["t"], "unpacks to 80 MB"),
}


@pytest.mark.parametrize("content, columns, words", WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_said_in_a_line(content, columns, words):
    with assert_refused(words):
        read_table(content, "a.npz", columns)
