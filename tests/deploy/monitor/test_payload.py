"""Friction that grows with a payload is no change: the payload is a covariate of the monitor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fixtures.changed_data import each, subset
from fixtures.driven_pendulum import simulated
from fixtures.shared import shared
from fixtures.true_curves import plain_friction
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.deploy.monitor.changes import prepared_data, recording_changes
from frictionid.deploy.monitor.judgement import judge
from frictionid.deploy.monitor.monitor import arriving
from frictionid.deploy.monitor.monitored import totals
from frictionid.simulate import Camera, Multisine, Rig, Run, Variation, simulate

LIGHT, HEAVY = 0.5, 0.7  # kg
MACHINE = {"mass": 0.3, "length": 0.2, "inertia": 0.002}
LEVEL = {LIGHT: 0.05, HEAVY: 0.07}  # N m


def recorded(mass, count, worn, level=None, viscous=0.004):
    """Recordings of a pendulum with a payload, of which the last ones have 15 % more friction."""
    rng = np.random.default_rng(int(10 * mass))
    torque = Multisine(1.2, (0.7, 1.1, 1.6))
    starts = rng.uniform(-1, 1, (count, 1)).tolist()
    runs = (
        Run(f"r{1e3 * mass:.0f}-{i}", tuple(q), torques=(torque,)) for i, q in enumerate(starts)
    )
    varied = Variation(scatter=0.01, wear=(0.15,), worn_from=count - worn, sudden=True)
    camera, level = Camera(361, 60.0, 0.0016), level or LEVEL[mass]
    made = simulated(level, viscous, camera, runs, mass, variation=varied)
    return tuple(replace(r, parameters={"mass": mass}) for r in made.recordings)


def dataset(*recordings):
    return fid.Dataset("p", fid.mechanisms.pendulum(mass=LIGHT, length=0.3), recordings)


@shared
def heavy():
    """Eight healthy recordings with the heavy payload, five more, and five after a change."""
    return recorded(HEAVY, 18, 5)


@shared
def light():
    return recorded(LIGHT, 8, 0)


@shared
def known(light, heavy):
    return fid.baseline(dataset(*light, *heavy[:8]))


def test_the_payload_is_a_covariate_and_its_effect_comes_out_as_it_went_in(known):
    assert known.covariates == ("mass",)
    assert_array_equal(known.changes.covariates[:, 0], np.repeat([LIGHT, HEAVY], 8))
    total = totals(known.changes, known.reference.speeds)[:, 0]
    effect = total[8:].mean() - total[:8].mean()
    assert effect == pytest.approx(LEVEL[HEAVY] - LEVEL[LIGHT], rel=0.1)


def saying(recordings, said):
    """A data set of recordings that say so of their payloads."""
    return each(dataset(*recordings), lambda r: replace(r, parameters=said))


@shared
def plain(light):
    return fid.baseline(saying(light, {}), law="coulomb_viscous")


def carrying(plain, share, viscous=0.004):
    """What is found where the mass has grown by a share, which no recording says."""
    new = recorded(LIGHT * (1 + share), 5, 0, LEVEL[LIGHT], viscous)
    return fid.monitor(plain, saying(new, {}))


@pytest.mark.parametrize("share", [-0.4, -0.2, -0.1, 0.1, 0.2, 0.4])
def test_a_payload_comes_out_as_it_went_in(plain, share):
    found = carrying(plain, share)
    assert found.judgement.changed == ("the payload's inertia",)
    (said,) = found.judgement.causes
    assert float(said.split(": ")[1].split(" %")[0]) == pytest.approx(100 * share, rel=0.02)
    p = float(found.sentence.removeprefix("Friction has not changed (p = ").split(",")[0])
    assert p == pytest.approx(found.judgement.p_of_joint[0], rel=0.1) and p > 0.01


def test_without_torque_a_payload_may_be_another_time_scale():
    """A swinging pendulum on film: another frame rate changes the ratio of its terms only."""
    machine = {"kind": "pendulum", "driven": False, "parameters": MACHINE}
    runs = tuple(Run(f"{i}", (1.0 + 0.1 * i,)) for i in range(12))
    true, camera = plain_friction(0.004, 0.001), Camera(481, 60.0, 0.008)
    film = simulate(Rig("p", machine, true, camera, runs, substeps=4))
    slow = each(film, lambda r: replace(r, angle=r.angle._replace(time=1.01 * r.angle.time)))
    known = fid.baseline(subset(film, 0, 8), law="coulomb_viscous")
    (cause,) = fid.monitor(known, subset(slow, 8)).judgement.causes
    assert cause.startswith("the payload's inertia: -") and " or another time scale" in cause


def test_friction_beside_a_payload_comes_out_as_it_went_in(plain):
    """A gain that cannot be separated from the payload widens intervals."""
    found = carrying(plain, 0.1, viscous=0.008)
    assert found.answer == "changed" and "viscous +" in found.judgement.causes[-1]
    parts = found.frame.set_index("part")
    true = {"coulomb": 0.0, "viscous": 0.004 * plain.reference.speeds[0, 1], "stribeck": 0.0}
    for part, change in true.items():
        assert parts.low_95[part] <= change <= parts.high_95[part]


def test_friction_under_a_payload_is_not_called_wear_but_wear_under_it_is(known, heavy):
    healthy, worn = (fid.monitor(known, dataset(*own)) for own in (heavy[8:13], heavy[13:]))
    assert healthy.answer == "unchanged"
    assert worn.answer == "changed"
    total = worn.frame.query("part == 'total'").iloc[0]
    # against what is healthy under that payload; the regression takes a part of it
    assert 0.5 * 0.15 * LEVEL[HEAVY] < total.change < 1.2 * 0.15 * LEVEL[HEAVY]


def test_what_is_linear_in_the_payload_changes_no_judgement_and_no_evidence(known, heavy, tmp_path):
    new, _ = recording_changes(prepared_data(dataset(*heavy[13:])), known.reference, ("mass",))

    def steeper(changes):
        return changes._replace(value=changes.value + 0.3 * changes.covariates)

    other = replace(known, changes=steeper(known.changes))
    assert judge(other, steeper(new)).p == pytest.approx(judge(known, new).p, rel=1e-6)
    names = [(name, name) for name in "abcde"]
    one, two = (
        [a.log_evidence for a in arriving(tmp_path / str(i), base, names, own)]
        for i, (base, own) in enumerate(((known, new), (other, steeper(new))))
    )
    assert_allclose(one, two, rtol=1e-6)


@pytest.mark.parametrize("said", [{}, {"mass": LIGHT}], ids=["unsaid", "always the same"])
def test_a_payload_of_which_the_baseline_knows_nothing_is_refused(light, heavy, said):
    plain = fid.baseline(saying(light, said))
    assert plain.covariates == tuple(said)
    assert fid.monitor(plain, dataset(light[0])).answer == "unchanged"  # the same mass
    with pytest.raises(fid.InputError, match=r"mass = 0.7 is not the baseline's 0.5"):
        fid.monitor(plain, dataset(heavy[0]))


def test_few_recordings_with_covariates_have_finite_intervals(light, heavy):
    """Two masses and three recordings do not tell how friction depends on the mass."""
    few = fid.baseline(dataset(*light[:2], heavy[0]))
    total = fid.monitor(few, dataset(heavy[1])).frame.query("part == 'total'").iloc[0]
    assert total.high_95 - total.low_95 < 100 * LEVEL[HEAVY]
