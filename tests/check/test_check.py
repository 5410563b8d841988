"""The parts of `check` on cases whose answer is known: estimates, delay, facts, advice, screen."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.changed_data import changed, measured
from fixtures.driven_pendulum import simulated
from fixtures.one_joint_sets import one_recording
from fixtures.paths import DATA
from fixtures.refusals import assert_refused
from fixtures.sines import sines
from fixtures.true_curves import plain_friction
from fixtures.verdicts import identifiable, kinds, question
from numpy.random import default_rng

from frictionid.check import LEVELS, Finding, check
from frictionid.check.facts import joints_of
from frictionid.check.hypothesis_tests import delay_of
from frictionid.check.motion import adapted, motions_of, unit_balances, unit_rows
from frictionid.check.regression import regress
from frictionid.check.verdict import judge
from frictionid.comparison.fit_model import fit_model
from frictionid.data.integrals import integrals_of
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal, clock_of
from frictionid.evaluation import Protocol, prepare
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction.laws import CoulombViscous
from frictionid.report.diagnostics import as_json, write_pictures
from frictionid.simulate import Camera, Drive, Multisine, Rig, Run, Steps, simulate

TRUE = {"coulomb_1": 0.25, "viscous_1": 0.02}
LENGTH = 0.4


@pytest.fixture(scope="module")
def swings():
    """Forty noise-free recordings of one pendulum with Coulomb and viscous friction only."""
    rng = default_rng(2)
    runs = [
        Run(
            f"r{i}",
            (float(rng.uniform(-1.5, 1.5)),),
            (),
            (Multisine(float(rng.uniform(0.8, 1.6)), tuple(rng.uniform(0.4, 1.6, 3))),),
        )
        for i in range(40)
    ]
    return simulated(0.25, 0.02, Camera(361), runs, length=LENGTH, substeps=6)


def drawn(dataset, rng, count=5, noise=1e-3):
    """Some of the recordings with measurement noise."""
    chosen = rng.choice(len(dataset.recordings), count, False)
    noisy = (measured(dataset.recordings[i], noise, rng) for i in chosen)
    return replace(dataset, recordings=tuple(noisy))


def logged(dataset):
    return integrals_of([r.torque for r in dataset.recordings])


def estimated(dataset):
    plant = plant_of(dataset)
    rows = unit_rows(plant.mechanism, motions_of(dataset.recordings))
    torque = rows.means(logged(dataset))
    return regress(rows, torque, plant.mechanism, plant.p), rows, torque, plant


def truth_of(plant):
    """Base parameters and friction by their names."""
    return dict(zip(plant.mechanism.base_names, plant.p[0], strict=True)) | TRUE


def test_least_squares_return_the_truth_within_their_errors(swings):
    """30 data sets, seed 3: 17 of 20 intervals of two errors hold the truth, all narrow."""
    rng = default_rng(3)
    inside, shares = [], []
    for _ in range(30):
        estimate, _, _, plant = estimated(drawn(swings, rng))
        for name, true in truth_of(plant).items():
            value, error = estimate.at(name)
            inside.append(abs(value - true) < 2 * error)
            shares.append(error / true)
    assert np.mean(inside) > 0.85
    assert np.median(shares) < 0.05


def test_reversals_in_a_sharp_motion_count_and_keep_the_truth(swings):
    """500 Hz and 1e-5 rad of noise: windows with reversals count; 60 Hz and 1 mrad: they do not."""
    runs = (Run(f"{i}", (1.0,), (), (Multisine(1.2, (0.5, 0.9, 1.4 + i)),)) for i in range(3))
    camera, drive = Camera(2001, 500.0, 1e-5), Drive(500.0)
    fine = simulated(0.25, 0.02, camera, runs, length=LENGTH, substeps=1, drive=drive)
    plant = plant_of(fine)
    motions = motions_of(fine.recordings)
    rows = adapted(unit_balances(plant.mechanism, motions), motions)
    assert (rows.moving[:, 0] & (np.abs(rows.friction[:, 0, 0]) < 0.5)).any()
    torque = rows.means(logged(fine))
    estimate = regress(rows, torque, plant.mechanism, plant.p)
    for name, true in truth_of(plant).items():
        assert estimate.at(name)[0] == pytest.approx(true, rel=0.01), name
    coarse = motions_of(drawn(swings, default_rng(0)).recordings)
    rows = adapted(unit_balances(plant.mechanism, coarse), coarse)
    for ours, usual in zip(rows, unit_rows(plant.mechanism, coarse), strict=True):
        np.testing.assert_array_equal(ours, usual)


def test_the_interval_of_the_delay_holds_the_delay(swings):
    """30 data sets, seed 4, delays of 0 to 30 ms: the 95 % interval holds nearly all of them."""
    rng = default_rng(4)
    held, widths = [], []
    for _ in range(30):
        true = float(rng.uniform(0.0, 0.03))
        dataset = changed(drawn(swings, rng), "torque", lambda u: u, -true)
        plant = plant_of(dataset)
        rows = unit_rows(plant.mechanism, motions_of(dataset.recordings))
        low, high = delay_of(rows, logged(dataset), plant.p).interval
        held.append(low < true < high)
        widths.append(high - low)
    assert np.mean(held) >= 0.85
    assert np.median(widths) < 0.004


def test_without_torque_only_ratios_are_estimated_and_one_value_is_kept():
    runs = (Run("a", (1.8,)), Run("b", (-1.2,)), Run("c", (2.2,)))
    decays = simulated(0.05, 0.01, Camera(361, 60.0, 2e-4), runs, length=LENGTH)
    estimate, _, _, plant = estimated(decays)
    kept = [name for name in plant.mechanism.base_names if np.isinf(estimate.at(name)[1])]
    assert len(kept) == 1
    i = plant.mechanism.base_names.index(kept[0])
    assert estimate.value[i] == plant.p[0, i]


def test_parameters_that_look_the_same_are_an_unidentifiable_direction():
    """Small swings of one frequency: inertia and gravity are one number."""
    t = np.arange(600) / 60
    q = 0.05 * np.sin(2 * np.pi * 0.5 * t)
    w = 2 * np.pi * 0.5
    u = (5.0 - 0.08 * w**2) * q + 0.02 * np.sign(np.cos(w * t))
    u = u + default_rng(0).normal(0, 0.02, 600)
    estimate, *_ = estimated(one_recording(t, q, u, 0.5, 0.4))
    directions = [{name for name, _ in d} for d in estimate.unidentifiable]
    assert any("inertia" in names for names in directions)


def test_a_weight_and_an_offset_of_the_force_look_alike(tmp_path):
    """Of a vertical axis with a rotor of any inertia: neither is known, the friction is."""
    lift = tmp_path / "lift.urdf"
    lift.write_text(
        '<robot name="lift"><link name="base"/><link name="cage"><inertial><mass value="5.3"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        '<joint name="axis" type="prismatic"><parent link="base"/><child link="cage"/>'
        '<axis xyz="0 0 1"/></joint></robot>'
    )
    t = np.arange(0.0, 12.0, 0.004)
    q, w, a = (x[:, 0] for x in sines(t, ((0.1, 2.1), (0.05, 5.3))))
    u = 5.0 * (a + 9.81) + 6.0 * np.sign(w) + 8.0 * w + 4.0 + default_rng(0).normal(0, 0.1, len(t))
    one = Recording("a", Signal(t, q[:, None]), Signal(t, u[:, None]))
    machine = {"urdf": str(lift)}
    estimate, *_ = estimated(Dataset("lift", machine, (one,)))
    true = {"mass_cage": 5.0, "offset_1": 4.0, "coulomb_1": 6.0, "viscous_1": 8.0}
    for name, value in true.items():
        found, error = estimate.at(name)
        assert abs(found - value) < 2 * error
        assert (error > 0.1 * value) == (name in ("mass_cage", "offset_1"))


def test_facts_count_what_was_planted():
    rng = default_rng(6)
    keep = np.sort(rng.choice(np.arange(1, 999), 960, False))
    t = np.concatenate([[0.0], keep * 0.01, [10.0]])
    q = np.round((np.sin(3 * t) + rng.normal(0, 5e-4, len(t))) / 0.002) * 0.002
    u = np.cos(t) + rng.normal(0, 0.05, len(t))
    (recording,) = one_recording(t, q, u).recordings
    clock, motions = clock_of([recording.angle.time]), motions_of([recording])
    fact = joints_of([recording], motions)[0]
    assert clock.dropped == 1001 - len(t)
    assert clock.rate == pytest.approx(100.0)
    assert fact.angle_step == pytest.approx(0.002)
    assert fact.torque_noise == pytest.approx(0.05, rel=0.1)
    assert fact.angle_noise == pytest.approx(np.hypot(5e-4, 0.002 / np.sqrt(12)), rel=0.3)
    assert fact.reversals == 10
    assert fact.fast == pytest.approx(3.0, rel=0.05)


def test_a_torque_that_never_changes_is_frozen_unless_it_fits(swings):
    noisy = drawn(swings, default_rng(9), count=1)
    frozen = changed(noisy, "torque", lambda u: np.full_like(u, 0.4))
    assert "frozen_torque" in kinds(check(frozen))
    runs = (Run("a", (1.5,), (), (Steps(0.4, 60.0),)), Run("b", (-1.8,), (), (Steps(0.4, 60.0),)))
    held = simulated(0.05, 0.02, Camera(361, 60.0, 1e-3), runs, length=LENGTH, substeps=6)
    assert "frozen_torque" not in kinds(check(held))


def test_slow_recordings_without_decay_ask_for_both():
    rng = default_rng(7)
    t = np.arange(900) / 60
    q = 0.3 * np.sin(2 * t) + rng.normal(0, 1e-4, len(t))
    u = 0.5 * np.sin(2 * t) + 0.1 * np.sign(np.cos(2 * t))
    words = " / ".join(check(one_recording(t, q, u, 0.5, 0.4)).next)
    assert "joint 1 never exceeds 0.6 rad/s: add a swing" in words
    assert "no free decay: add one of 20 s" in words


def test_the_clean_acrobot_is_good_and_the_other_one_is_late_with_a_rotor():
    """Without torque a hanging joint has no load that friction could fail to hold."""
    good = check(load_dataset(DATA / "acrobot_clean"))
    rest = [q for q in good.questions if q.question.startswith("gravity at rest")]
    assert good.level == "good" and [q.passed for q in rest] == [None, None]
    assert all("no load that friction could not hold" in q.words for q in rest)
    verdict = check(load_dataset(DATA / "acrobot_sim"))
    by_kind = {finding.kind: finding for finding in verdict.findings}
    assert sorted(by_kind) == ["delay", "rotor"] and verdict.level == "doubtful"
    low, high = verdict.delay.interval
    assert low < 0.018 < high and high - low < 0.002
    assert by_kind["rotor"].numbers["size"] == pytest.approx(2e-6, rel=0.05)


def test_the_command_prints_a_screen_and_exits_by_the_level(run, tmp_path):
    code, out, _ = run(tmp_path, "check", DATA / "acrobot_sim")
    lines = out.splitlines()
    assert code == 1
    assert lines[0].startswith("acrobot_sim: doubtful")
    late = re.search(r"acts (\d+\.\d) ms after it is logged", "\n".join(lines))
    assert late is not None and abs(float(late[1]) - 18.0) < 1.0
    assert len(lines) < 50 and max(map(len, lines)) <= 120


def test_the_command_prints_everything_as_json_and_draws(run, tmp_path):
    code, out, _ = run(tmp_path, "check", DATA / "acrobot_clean", "--json", "--out", "p")
    verdict = json.loads(out)
    assert code == 0 and verdict["level"] == "good" and len(verdict["joints"]) == 2
    assert verdict["estimate"]["names"][0] == "inertia_11"
    made = sorted(path.name for path in (tmp_path / "p").iterdir())
    assert made == ["coverage.png", "motion.png", "residual.png"]


@pytest.mark.parametrize(
    ("samples", "speed"), [(2, 3.0), (3, 0.0), (12, 0.0), (12, 3.0), (600, 0.0)]
)
def test_recordings_too_short_or_still_are_unusable_and_no_more(samples, speed, tmp_path):
    t = np.arange(samples) / 60
    verdict = check(one_recording(t, np.sin(speed * t), np.cos(7 * t)))
    json.loads(as_json(verdict))
    assert len(write_pictures(verdict, tmp_path)) == 3
    assert verdict.level == "unusable"
    assert verdict.findings[0].kind == "missing_excitation"


def test_recordings_of_another_machine_are_not_called_good():
    """The torque has nothing to do with this motion: no convention explains it."""
    t = np.arange(900) / 60
    assert check(one_recording(t, 0.5 * np.sin(3 * t), 5 * np.cos(t))).level != "good"


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [("pendulum", {"mass": 0.5, "length": 0.3, "g": 0.0}), ("linear_axis", {"mass": 2.0})],
)
def test_without_gravity_no_free_decay_is_asked_for(kind, parameters):
    """Nor is the gravity moment missed that is zero by what is given."""
    runs = [Run(f"{i}", (0.0,), (), (Multisine(1.0, (0.3 + 0.1 * i, 0.7, 1.3)),)) for i in range(3)]
    table = {"kind": kind, "parameters": parameters}
    curve = plain_friction(0.1, 0.05)
    camera = Camera(300, 100.0, 1e-3)
    verdict = check(simulate(Rig("level", table, curve, camera, tuple(runs), substeps=4)))
    assert verdict.level == "good"
    assert not any("decay" in words or "gravity" in words for words in verdict.next)
    assert not any(e.kind == "zero" for e in verdict.model_errors)
    bodies = identifiable(verdict, "inertia combinations")
    assert bodies.possible


def test_a_torque_at_a_joint_without_motor_is_named_and_no_fit_takes_it():
    acrobot = load_dataset(DATA / "acrobot_mass")
    wrong = changed(acrobot, "torque", lambda u: u + [0.2, 0.0])
    finding = kinds(check(wrong))["torque_without_motor"]
    assert finding.text.startswith("torque 1 is up to 0.2 N m")
    assert finding.level == "unusable"
    for refuses in (
        lambda: fit_model(wrong, LeastSquares(CoulombViscous())),
        lambda: prepare(wrong, Protocol()),
    ):
        with assert_refused("but joint 1 of acrobot has no motor; leave its col"):
            refuses()


def test_energy_of_a_joint_at_rest_is_not_tested():
    """Without torque it is noise there: it cannot be seen to fall, and rises by all it has."""
    rng = default_rng(3)
    t = np.arange(600) / 60
    moves = t > 5
    q = np.where(moves, 0.8 * np.sin(4 * (t - 5)) ** 3, 0.0) + 1e-3 * rng.standard_normal(600)
    u = np.where(t > 4.5, 0.1 + np.sin(4 * (t - 5)) ** 2, 0.0)
    verdict = check(one_recording(t, q, u))
    energy = question(verdict, "energy falls without input")
    assert energy.passed is None and "exceeds its noise" in energy.words


def test_a_verdict_is_as_bad_as_its_worst_finding():
    """Whatever their order; findings that are only worth knowing leave the data good."""
    data = tiny.dataset(recordings=tiny.recordings()[:4])
    motions = motions_of(data.recordings)
    own = judge(data, motions)
    assert {finding.level for finding in own.findings} <= {"good"} and own.level == "good"
    made = [Finding(f"made {level}", level, f"made up to be {level}") for level in LEVELS]
    for some in (made[:1], made[:2], made[1::-1], made, made[::-1], made[1:], made[2:]):
        verdict = judge(data, motions, some)
        assert verdict.level == max((f.level for f in some), key=LEVELS.index)
        ranks = [LEVELS.index(finding.level) for finding in verdict.findings]
        assert ranks == sorted(ranks, reverse=True)


@pytest.mark.parametrize("noise", [1e-3, 3e-3])
def test_a_free_decay_is_one_beside_the_noise_of_a_torque_sensor(clean, noise):
    """Of a share of the largest torque; what is driven is none."""
    rng, decays = default_rng(3), check(clean).passive
    size = noise * max(np.abs(r.torque.value).max() for r in clean.recordings)
    noisy = changed(clean, "torque", lambda u: u + size * rng.standard_normal(u.shape))
    assert decays > 2.0
    assert check(noisy).passive == pytest.approx(decays, rel=0.1)
