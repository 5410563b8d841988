"""The camera's view: settings that no picture can have are refused."""

import pytest

from frictionid.errors import InputError
from frictionid.rig.camera.scene import View


@pytest.mark.parametrize("pivot", [(9e39, 100.0), (100.0, -1e5), (float("inf"), 0.0)])
def test_a_pivot_far_outside_of_the_picture_is_refused(pivot):
    with pytest.raises(InputError, match="pivot"):
        View(pivot=pivot)


def test_a_pivot_beside_the_picture_is_one():
    assert View(pivot=(-300.0, 1000.0)).pivot == (-300.0, 1000.0)
