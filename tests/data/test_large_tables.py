"""Large tables: memory for the numbers that they hold, and none for cells that are refused."""

import gzip
import tracemalloc

import numpy as np
import pytest

from frictionid.data.readers.table import numeric_table, read_table
from frictionid.errors import InputError

ROWS = b"0.125,-1.5,run\n" * 20_000


def _peak(read):
    tracemalloc.start()
    try:
        found = read()
    except InputError as error:
        found = str(error)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found, peak


def test_all_columns_of_numbers_take_the_memory_of_numbers():
    text = b"time,q,mode\n" + ROWS
    table, peak = _peak(lambda: numeric_table(text, "a.csv"))
    assert list(table.columns) == ["time", "q"] and (table.columns["q"] == -1.5).all()
    assert peak < 6 * len(text)  # once 25


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
def test_a_wrong_cell_is_refused_before_the_rest_is_read(name):
    text = b"time,q,mode\n0,x,run\n" + ROWS
    packed = gzip.compress(text) if name.endswith("gz") else text
    said, peak = _peak(lambda: read_table(packed, name, ["time", "q"]))
    assert "row 2: column 'q' holds 'x'" in said
    assert peak < 8 * len(text)  # all cells: 25


def test_a_word_anywhere_leaves_its_column_out():
    table = numeric_table(b"t,q,u\n0,1,2\n1,x,3\n2,5,\n", "a.csv")
    assert list(table.columns) == ["t", "u"]
    np.testing.assert_array_equal(table.columns["u"], [2, 3, np.nan])
