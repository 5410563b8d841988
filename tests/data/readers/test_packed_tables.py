"""Small files that unpack to large ones are refused before they fill the memory."""

import gzip
import io
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from fixtures.refusals import assert_refused
from numpy.testing import assert_array_equal

from frictionid import files
from frictionid.data.readers.csv_table import number
from frictionid.data.readers.table import read_table
from frictionid.errors import InputError, printable

HEAD = b"time,q\n0.0,1.0\n"
BOMBS = {  # how a file begins, what is repeated and how often, and what is said of it
    "nothing": (b"", b"\0", 300_000_000, "unpack to over"),
    "blank lines": (HEAD, b"\n", 300_000_000, "unpack to over"),
    "wide header": (b"", b"a,", 10_000_000, "its first line is longer"),
    "wide row": (HEAD, b",", 30_000_000, "cells where the first line has 2|is no CSV"),
    "long cell": (HEAD, b"1", 30_000_000, "is no CSV text|which is no number"),
}
READ_ALL = """
import resource
import sys
from frictionid.data.readers.table import read_table
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for name in sys.argv[1:]:
    try:
        read_table(open(name, "rb").read(), "a.csv.gz", ["q"])
    except ValueError as error:
        print(error)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_packed_bombs_are_refused_with_little_memory(tmp_path):
    for name, (first, repeated, count, _) in BOMBS.items():
        members = gzip.compress(first) + 100 * gzip.compress(repeated * (count // 100))
        (tmp_path / name).write_bytes(members)
    ran = subprocess.run(
        [sys.executable, "-c", READ_ALL, *BOMBS],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    said, kilobytes = ran.stdout.splitlines()[::2], ran.stdout.splitlines()[1::2]
    assert len(said) == len(kilobytes) == len(BOMBS)
    for line, grown, (*_, words) in zip(said, kilobytes, BOMBS.values(), strict=True):
        assert pytest.approx(0, abs=1e6) == int(grown)  # 1 GB
        assert any(word in line for word in words.split("|")), line


def test_ordinary_packed_tables_are_read_however_well_they_pack():
    rows = np.column_stack([np.arange(50_000) * 0.001, np.ones(50_000)])
    text = pd.DataFrame(rows, columns=["time", "q"]).to_csv(index=False).encode()
    found = read_table(gzip.compress(text), "a.csv.gz", ["time", "q"])
    assert_array_equal(found.columns["q"], 1.0)
    parts = gzip.compress(text[:1000]) + gzip.compress(text[1000:])
    assert_array_equal(
        read_table(parts, "a.csv.gz", ["time"]).columns["time"], found.columns["time"]
    )


def test_parquet_of_too_many_rows_is_refused_before_it_is_unpacked(monkeypatch):
    stream = io.BytesIO()
    pd.DataFrame({"q": np.zeros(1000)}).to_parquet(stream)
    monkeypatch.setattr(files, "CELLS", 999)
    with assert_refused("1000 rows of 1 columns are more than 999 numbers: cut"):
        read_table(stream.getvalue(), "a.parquet", ["q"])


@pytest.mark.parametrize("text", ["1_000", "\u0661\u0662", "1e3_0", "\uff11", "1,5,0", "0x10"])
def test_only_plain_digits_are_numbers(text):
    with pytest.raises(ValueError, match=r".*"):
        number(text)
    with assert_refused("row 2: column 'q' holds .* which is no number"):
        read_table(f'q;a\n"{text}";1\n'.encode(), "a.csv", ["q"])


def test_messages_are_short_and_steer_no_terminal():
    header = ",".join(f"name{i}" for i in range(10_000))
    with assert_refused("has no column 'q'; it has 'name0', .* and 9980 more") as wide:
        read_table(f"{header}\n".encode(), "a.csv", ["q"])
    assert len(str(wide.value)) < 1300
    assert len(str(InputError("x" * 400_000))) < 1300
    assert str(InputError("\x1b[31mred\x1b]0;title\x07 \udcff")) == printable(
        "\x1b[31mred\x1b]0;title\x07 \udcff"
    )
    assert str(InputError("\x1b[31mred")) == "\\x1b[31mred"
