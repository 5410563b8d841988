"""From markers to angles and back, whatever the scale, the place and the number of turns."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.readers.formats.markers import hold_pivot, link_angles, mirror


def seen(angles, lengths):
    """Markers (T, n + 1, 2) in pixels of a chain with joint angles (T, n)."""
    absolute = np.cumsum(angles, axis=1)
    link = np.stack([np.sin(absolute), np.cos(absolute)], axis=-1) * np.asarray(lengths)[:, None]
    start = np.broadcast_to([300.0, 200.0], (len(angles), 1, 2))
    return np.concatenate([start, start + np.cumsum(link, axis=1)], axis=1)


def swinging(rng, joints):
    """Smooth joint angles (300, n) that go round several times."""
    time = np.linspace(0.0, 1.0, 300)[:, None]
    start = rng.uniform(-3.0, 3.0, joints)
    return start + rng.standard_normal(joints) * 6 * np.pi * time + 0.3 * np.sin(9 * time)


@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_angles_come_back_from_their_markers(seed, joints):
    rng = default_rng(seed)
    angles = swinging(rng, joints)
    found = link_angles(seen(angles, rng.uniform(20.0, 600.0, joints)))
    assert (np.abs(found[0]) <= np.pi).all()
    turns = (found - angles) / (2 * np.pi)
    assert_allclose(turns, np.round(turns[:1]) * np.ones_like(turns), atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_angles_depend_on_no_scale_place_or_shaking_camera_and_a_mirror_flips_them(seed):
    rng = default_rng(seed)
    markers = seen(swinging(rng, 3), [600.0, 460.0, 50.0])
    shaken = markers + rng.normal(scale=3.0, size=(len(markers), 1, 2))
    found = link_angles(markers)
    assert_allclose(link_angles(0.2 * shaken), found, atol=1e-9)
    assert_allclose(link_angles(mirror(markers)), -found, atol=1e-9)


def test_down_is_zero_and_right_in_the_picture_is_positive():
    right = np.array([[[0.0, 0.0], [1.0, 1.0]]])
    assert_allclose(link_angles(right), np.pi / 4)
    assert_allclose(link_angles(mirror(right)), -np.pi / 4)
    assert_allclose(link_angles(-mirror(right)), 3 * np.pi / 4)


def test_a_held_pivot_moves_no_more_and_leaves_the_others_alone():
    rng = default_rng(7)
    markers = seen(swinging(rng, 2), [600.0, 460.0])
    markers[:, 0] += rng.normal(scale=2.0, size=(len(markers), 2))
    held = hold_pivot(markers)
    assert np.all(held[:, 0] == np.median(markers[:, 0], axis=0))
    assert_array_equal(held[:, 1:], markers[:, 1:])
