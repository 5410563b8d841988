"""A small data set as files: what the tests of the data door read and damage."""

import copy
import csv
import io

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from frictionid.readers.dataset import load_dataset

COLUMNS = ("time", "q1", "q2", "w1", "w2", "u1", "u2", "temp")
DESCRIPTION = {
    "name": "rig",
    "mechanism": {"kind": "acrobot", "inertias": "printed", "parameters": {"m4": 0.084}},
    "columns": {"time": "time", "angle": ["q1", "q2"], "torque": ["", "u2"]},
    "recordings": {"patterns": ["*.csv"]},
}


def motion(samples=9, seed=0):
    """Columns of an uneven recording, in SI units."""
    random = np.random.default_rng(seed)
    values = random.normal(size=(samples, len(COLUMNS)))
    values[:, 0] = np.cumsum(random.uniform(0.01, 0.02, samples))
    return dict(zip(COLUMNS, values.T, strict=True))


def csv_bytes(columns):
    """CSV text of columns; None is an empty cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue().encode()


def parquet_bytes(columns):
    buffer = io.BytesIO()
    pq.write_table(pa.table(columns), buffer)
    return buffer.getvalue()


def described(**changes):
    """The description with changes: "columns.torque" becomes columns__torque, None deletes."""
    document = copy.deepcopy(DESCRIPTION)
    for path, value in changes.items():
        *parents, key = path.split("__")
        table = document
        for parent in parents:
            table = table.setdefault(parent, {})
        if value is None:
            del table[key]
        else:
            table[key] = value
    return document


def write(folder, document=None, **tables):
    """Write a data set; the tables' names have _ for the dots of their endings."""
    text = document if isinstance(document, bytes) else tomli_w.dumps(document or DESCRIPTION)
    (folder / "dataset.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    for name, content in (tables or {"a_csv": csv_bytes(motion())}).items():
        (folder / name.replace("_", ".")).write_bytes(content)
    return folder


def load(folder, document=None, **tables):
    return load_dataset(write(folder, document, **tables))
