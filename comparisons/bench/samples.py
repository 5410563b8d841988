"""The recordings that are measured on, and where things are."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset

ROOT = Path(__file__).parents[2]
RATE = 60.0  # [1/s], samples of the acrobot
sys.path += [str(ROOT / "comparisons"), str(ROOT / "comparisons" / "peers")]


@cache
def acrobot() -> Dataset:
    """data/acrobot_clean: simulated, 25 recordings of 343 samples, the mechanism known."""
    return load_dataset(ROOT / "data" / "acrobot_clean")
