"""What is no TOML is refused, and so are fields of dataclasses that are not of their types."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from pydantic import Field

from frictionid.comparison.suite import load_suite
from frictionid.config import Count, NotNegative, Positive, check_settings
from frictionid.data.readers.dataset import load_dataset


@dataclass(frozen=True)
class Settings:
    law: Any = None
    sizes: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.5,)
    epochs: Count = 3
    ridge: NotNegative = 0.0
    device: Literal["cpu", "cuda"] = "cpu"
    robust: Positive | None = None

    def __post_init__(self):
        check_settings(self)


def test_settings_of_the_declared_types_are_kept_and_lists_become_tuples():
    own = Settings(law=object, sizes=[0.1, 2], ridge=np.float64(1.0), robust=3.0)
    assert own.sizes == (0.1, 2) and own.robust == 3.0
    assert Settings(epochs=1) == Settings(epochs=1)


MISTAKES = r"""
sizes = []          => sizes:
sizes = [0.1, -2.0] => sizes\[1\]: it should be greater than 0, not -2.0
sizes = 3.0         => sizes: it should be a valid
epochs = 0          => epochs: it should be greater than or equal to 1, not 0
epochs = 2.0        => epochs: it should be a valid integer, not 2.0
epochs = true       => epochs: it should be a valid integer, not True
ridge = inf         => ridge: it should be a finite number
device = "gpu"      => device: it should be 'cpu' or 'cuda', not 'gpu'
robust = 0.0        => robust: it should be greater than 0
"""


@mistakes(MISTAKES)
def test_a_value_that_does_not_fit_is_refused_in_one_line(wrong, words):
    with assert_refused(words):
        Settings(**changes(wrong))


@pytest.mark.parametrize("load", [load_dataset, load_suite])
@pytest.mark.parametrize(
    "text",
    [b"name = ", b"\xff\xfe", b"a = " + b"[" * 9999, b"a = " + b"9" * 9999, b'name = "a"\n' * 2],
    ids=lambda text: repr(text[:12]),
)
def test_what_is_no_toml_is_refused(tmp_path, load, text):
    file = tmp_path / "own.toml"
    file.write_bytes(text)
    with assert_refused(r"own\.toml is no TOML"):
        load(file)
