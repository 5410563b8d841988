"""Cards of identified machines: each is a model, with its mechanism, and says where it is from."""

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.files import shipped_names

NAMES = shipped_names("machines")


@pytest.mark.parametrize("name", NAMES)
def test_a_card_is_a_model_with_all_that_it_should_say(name):
    card = fid.machine(name)
    assert card.friction.n == len(card.joints)
    for text in (card.title, card.verdict, card.licence, card.origin, card.citation):
        assert text
    if card.held_out is None:
        assert card.published and not card.recordings
    else:
        assert 0 < card.held_out.error < card.held_out.without
        assert f"{card.held_out.error:.3g}" in repr(card)
        assert card.recordings and card.seconds > 0
    same = fid.load_model(f"machine:{name}").friction
    assert_array_equal(same.theta, card.friction.theta)
    assert name in repr(card)
    if not card.published:
        friction = card.fit.frame[card.fit.frame.block == "friction"]
        assert np.isfinite(friction[friction.identified]["low_95"]).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_card_has_the_inertia_that_was_identified(name):
    card = fid.machine(name)
    calibration = card.friction.calibration
    if card.mechanism is not None and calibration is not None and calibration.base is not None:
        base = card.mechanism.base(card.mechanism.nominal())
        assert_allclose(base, calibration.base, rtol=1e-6, atol=1e-9)


def test_the_list_has_a_line_for_each():
    frame = fid.machines()
    assert list(frame.index) == NAMES and frame.published.sum() >= 2


def test_unknown_machines_are_refused_with_the_nearest():
    with assert_refused("machine:xl330_m7: no such machine; did you mean xl330_m"):
        fid.machine("xl330_m7")
