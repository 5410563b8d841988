"""Traps of real arms: each is named where it is, and nowhere else."""

import re

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.changed_data import changed
from fixtures.dataset_files import shipped_with
from fixtures.paths import DATA
from fixtures.shared import shared
from fixtures.verdicts import identifiable, kinds, question

from frictionid.check import check
from frictionid.check.model_errors import ALL, model_errors
from frictionid.check.motion import Measured, adapted, motions_of
from frictionid.check.partial_regression import partial_regression
from frictionid.data.readers.dataset import load_dataset


@shared
def arm(tmp_path_factory):
    return wrist.mechanism(tmp_path_factory.mktemp("wrist"))


@shared
def table(arm):
    return wrist.frame(arm, 10.0)


def judged(arm, table, *gears, **options):
    return check(wrist.dataset(arm, table, *gears, **options))


def test_an_arm_without_traps_is_good_and_friction_of_its_coupled_motor_is_found(arm, table):
    verdict = judged(arm, table)
    assert (verdict.level, kinds(verdict)) == ("good", {})
    signs = question(verdict, "signs, frames, units")
    assert signs.passed
    for place, (coulomb, viscous) in enumerate(zip(wrist.COULOMB, wrist.VISCOUS, strict=True)):
        name = (*"123", "turner")[place]
        for key, true in (("coulomb", coulomb), ("viscous", viscous)):
            value, error = verdict.estimate.at(f"{key}_{name}")
            assert abs(value - true) < max(3 * error, 0.03 * true), (key, name)
    part = identifiable(verdict, "friction of turner")
    assert part.possible


def test_joints_that_move_in_turn_and_rest_most_of_the_time(tmp_path):
    """Each moves for 5 s of 195."""
    single = wrist.uncoupled(tmp_path)
    verdict = judged(single, wrist.frames_joint_by_joint(single))
    assert verdict.level == "good"
    assert all(0.95 < fact.at_rest < 0.99 for fact in verdict.joints)
    for j in range(3):
        for key, true, most in (
            ("coulomb", wrist.COULOMB[j], 0.1),
            ("viscous", wrist.VISCOUS[j], 0.2),
        ):
            value, error = verdict.estimate.at(f"{key}_{j + 1}")
            assert abs(value - true) < 3 * error and error < most * true, (key, j)


def test_a_joint_that_bears_no_load_hides_no_other_at_rest(tmp_path):
    upright = wrist.mechanism(tmp_path, gravity=[0.0, -9.81, 0.0])
    verdict = judged(upright, wrist.frames_joint_by_joint(upright))
    rest = answers(verdict, "gravity at rest").values()
    assert ["hardly rests" in answer.words for answer in rest] == [True, False, False]
    signs = answers(verdict, "sign of torque")
    assert list(signs) == [f"sign of torque {j}" for j in (1, 2, 3)]
    assert (
        "unexplained, whatever the friction"
        in answers(verdict, "signs")["signs, frames, units"].words
    )


def test_friction_of_a_coupled_motor_that_is_not_declared_stays_unexplained(arm, table, tmp_path):
    """The balances of the joints that it turns show it."""
    without = wrist.uncoupled(tmp_path)
    own, usual = (judged(a, table).estimate.spread for a in (without, arm))
    assert own[0] < 1.5 * usual[0]
    assert (own[1:] > 3.0 * usual[1:]).all()


def test_torques_of_the_load_in_place_of_the_motors(tmp_path):
    single = wrist.uncoupled(tmp_path)
    table = wrist.frame(single, 10.0)
    table[wrist.COLUMNS[1]] *= -1.0
    first = judged(single, table).findings[0]
    assert first.kind == "flipped_torque" and "all torques have the wrong sign" in first.text


@pytest.mark.parametrize(
    ("what", "pair"),
    [("angles", (0, 1)), ("angles", (1, 2)), ("torques", (0, 1)), ("joints", (0, 2))],
)
def test_columns_of_two_joints_that_are_swapped(arm, table, pair, what):
    order = np.arange(3)
    order[list(pair)] = order[list(reversed(pair))]
    data = wrist.dataset(arm, table)
    for signal in {"joints": ("angle", "torque")}.get(what, (what[:-1],)):
        data = changed(data, signal, lambda x: x[:, order])
    first = check(data).findings[0]
    assert first.kind == f"pair_of_{what}"
    assert first.text.startswith(f"{what} {pair[0] + 1} and {pair[1] + 1} are swapped:")


@pytest.mark.parametrize(("joint", "size"), [(0, 1e3), (1, 100.0), (2, 1e3), (2, 1e-3)])
def test_the_torque_of_one_joint_in_another_unit(arm, table, joint, size):
    factor = np.where(np.arange(3) == joint, size, 1.0)
    verdict = check(changed(wrist.dataset(arm, table), "torque", lambda u: u * factor))
    unit = {1e3: "in mN m, not N m", 100.0: "in N cm, not N m", 1e-3: "in N m, not mN m"}[size]
    assert verdict.findings[0].text.startswith(f"torque {joint + 1} is {unit}:")
    assert verdict.level == "unusable"


@pytest.mark.parametrize("motor", [0, 1, 2])
def test_the_sign_of_a_gear(arm, table, motor):
    """Of the motor that turns with two joints, too, and of one whose zero is not the joint's."""
    wrong = wrist.GEARS * np.where(np.arange(3) == motor, -1.0, 1.0)[:, None]
    verdict = judged(arm, table, wrong)
    first = verdict.findings[0]
    assert first.kind.startswith("flipped") and verdict.level != "good"
    assert f"the gear of motor {motor + 1} has the wrong sign" in first.text


@pytest.mark.parametrize("motor", [0, 1])
def test_the_ratio_of_a_gear(arm, table, motor):
    """Of torques alone; it changes the angles of none."""
    wrong = np.where(np.arange(3) == motor, 1.6, 1.0)
    straight, (angle, torque) = table.copy(), wrist.of_joints(table)
    straight[wrist.COLUMNS[0]], straight[wrist.COLUMNS[1]] = angle, torque * wrong
    data = wrist.dataset(arm, straight, np.eye(3), np.zeros(3))
    finding = kinds(check(data))["gain"]
    assert finding.text.startswith(f"gain of torque {motor + 1} is 0.6")


def with_velocity(table):
    motors = table[["w1", "w2", "w3"]].to_numpy() @ wrist.GEARS.T
    return table.assign(**{f"w{j + 1}": motors[:, j] for j in range(3)})


def test_a_velocity_that_a_filter_makes_late(arm, table):
    """Of one joint; a good one is not named, and one in the wrong unit is no late one."""
    good = with_velocity(table)
    names = ["w1", "w2", "w3"]
    assert kinds(judged(arm, good, velocity=names)) == {}
    late, value = good.copy(), good["w1"].to_numpy().copy()
    for k in range(1, len(value)):
        value[k] += 0.95 * (value[k - 1] - value[k])  # 0.1 s
    late["w1"] = value
    found = kinds(judged(arm, late, velocity=names))
    assert list(found) == ["late_velocity"] and found["late_velocity"].joint == 1
    assert 0.05 < found["late_velocity"].numbers["delay"] < 0.1
    turned = good.assign(w2=-good["w2"])
    found = kinds(judged(arm, turned, velocity=names))
    assert "wrong_velocity" in found and "late_velocity" not in found


def test_a_current_that_is_zero_but_for_some_readings(arm, table):
    """No verdict on anything else follows from it; a motor that is off for seconds is not dead."""
    draw = np.random.default_rng(1)
    silent = np.where(draw.random(len(table)) < 0.1, 0.002 * draw.integers(-3, 4, len(table)), 0.0)
    found = kinds(judged(arm, table.assign(u1=silent)))
    assert list(found) == ["dead_torque"] and found["dead_torque"].joint == 1
    off = np.where(table["t"] < 6.0, 0.0, table["u1"])
    assert "dead_torque" not in kinds(judged(arm, table.assign(u1=off)))


def test_stamps_that_jitter_where_positions_do_not(arm, table):
    """Stamps that tell when the positions were read are no trap, however uneven."""
    off = 0.0007 * np.random.default_rng(2).standard_normal(len(table)).clip(-2, 2)
    finding = kinds(judged(arm, table.assign(t=table["t"] + off)))["jittering_stamps"]
    assert finding.level == "good" and "times 0.005 s" in finding.remedy
    assert finding.numbers["scatter"] < 0.7
    uneven = table.copy()
    for name in table.columns[1:]:
        uneven[name] = np.interp(table["t"] + off, table["t"], table[name])
    uneven["t"] = table["t"] + off
    assert "jittering_stamps" not in kinds(judged(arm, uneven))


SHORT = ("stop = 67.9", "stop = 35.0")


def test_what_is_said_of_an_arm_with_a_wrist(real_data):
    """Friction of its coupled motor beside the published one; no trap but its repeated rows."""
    verdict = check(load_dataset(DATA / "tx40", real_data / "staubli_tx40"))
    assert set(kinds(verdict)) == {"nominal_mechanism", "repeated_rows"}
    assert kinds(verdict)["repeated_rows"].level == "good"
    for name, published in {"coulomb_motor_6": 1.96, "viscous_motor_6": 0.616}.items():
        assert verdict.estimate.at(name)[0] == pytest.approx(published, rel=0.1)
    assert all(q.passed is not False for q in verdict.questions)


def test_the_negative_gear_of_a_real_wrist(real_data, tmp_path):
    folder = shipped_with(tmp_path, "tx40", ("-48", "48"))
    first = check(load_dataset(folder, real_data / "staubli_tx40")).findings[0]
    assert "the gear of motor 4 has the wrong sign" in first.text


@pytest.mark.parametrize(
    ("pair", "kind", "words"),
    [
        (SHORT, "jittering_stamps", "take row number times 0.01 s"),
        (("-100, -100]", "100, -100]"), "flipped_torque", "torque 3 has the wrong sign"),
        (("-100, -100]", "-160, -100]"), "gain", "gain of torque 3 is 0.5"),
        (
            (
                "[units]",
                'velocity = ["filtered_velocity_arm_1", "filtered_velocity_arm_2",'
                ' "filtered_velocity_arm_3", "filtered_velocity_arm_4"]\n\n[units]',
            ),
            "late_velocity",
            "velocity of arm_1_joint, arm_2_joint, arm_3_joint, arm_4_joint is 0.19 s behind",
        ),
    ],
)
def test_traps_of_an_arm_on_a_lift(real_data, tmp_path, pair, kind, words):
    pairs = {pair, SHORT}
    verdict = check(load_dataset(shipped_with(tmp_path, "tiago", *pairs), real_data / "tiago_arm"))
    assert words in f"{kinds(verdict)[kind].text} {kinds(verdict)[kind].remedy}"
    usual = {"jittering_stamps", "unknown_cause", "nominal_mechanism"}
    assert set(kinds(verdict)) <= usual | {kind}
    # 10 to 20 ms by others, and 0 by fits: the interval of 19 ms before to 2 ms after holds both
    assert "ms before" in identifiable(verdict, "torque delay").reason


def test_currents_that_are_zero(real_data, tmp_path):
    """Joints 5 to 7 of a real arm, and none of the others."""
    pairs = [
        (f'"{before}_4{behind}"]', ", ".join(f'"{before}_{j}{behind}"' for j in joints) + "]")
        for before, behind, joints in (
            ("arm", "_joint", (4, 6)),
            ("position_arm", "", (4, 6)),
            ("current_arm", "", (4, 6)),
        )
    ]
    constants = (
        ("0.087, 0.087]", "0.087, 0.087, 0.0613]"),
        ("-100, -100]", "-100, -100, -336]"),
        ("stop = 67.9", "stop = 29.0"),
    )
    folder = shipped_with(tmp_path, "tiago", *pairs, *constants)
    verdict = check(load_dataset(folder, real_data / "tiago_arm"))
    assert [f.joint for f in verdict.findings if f.kind == "dead_torque"] == [5]
    assert verdict.findings[0].text.startswith("torque 5 is zero in 8")


def answers(verdict, about):
    return {q.question: q for q in verdict.questions if about in q.question}


@pytest.mark.parametrize("turns", [(-90, 0), (0, 180), (-90, 90), (90, 90)])
def test_zeros_that_are_off_by_quarter_turns_are_no_wrong_gears(arm, table, turns):
    """As given by motors whose zeros are not those of the file: all rivals are tested together."""
    wrong = wrist.ZERO - np.radians([*turns, 0])
    first = judged(arm, table, offset=wrong).findings[0]
    assert first.kind == "shifted_angle"
    off = [f"{turn:+d} degrees to angle {j}" for j, turn in enumerate(turns, start=1) if turn]
    assert f"add {', '.join(off)}: " in first.text
    assert "equivalently" not in first.text


def test_the_zero_of_a_vertical_first_axis_does_not_show(tmp_path):
    upright = wrist.mechanism(tmp_path, gravity=[0.0, -9.81, 0.0])
    verdict = judged(upright, wrist.frame(upright, 10.0))
    words = sorted(e.words for e in verdict.model_errors if e.kind == "zero")
    assert words == ["the zero of angle 2", "the zero of angle 3"]
    assert verdict.level == "good"


def test_rotors_that_are_not_given_are_no_misfit_of_the_mechanism(arm, table):
    """They are asked for, and nothing else is suspected for their sake: no gain, sign or delay."""
    bare = arm.with_values(dict.fromkeys(wrist.PARAMETERS, 0.0))
    verdict = judged(bare, table)
    assert set(kinds(verdict)) == {"missing_rotors"} and verdict.level == "good"
    asked = dict(re.findall(r"(rotor_\w+) = ([\d.]+)", verdict.findings[0].text))
    for name in ("rotor_one", "rotor_two"):
        assert float(asked[name]) == pytest.approx(wrist.PARAMETERS[name], rel=0.15)
    assert all(q.passed for q in answers(verdict, "sign of torque").values())
    delay = identifiable(verdict, "torque delay")
    assert re.search(r"before to .* after|cannot tell", delay.reason)


def test_rotors_that_are_not_given_are_those_at_the_delay_of_the_torque(arm, table):
    bare = arm.with_values(dict.fromkeys(wrist.PARAMETERS, 0.0))
    time, early = table["t"], table.copy()
    for name in wrist.COLUMNS[1]:
        early[name] = np.interp(time - 0.02, time, table[name])
    delay, rotors = judged(bare, early).findings
    assert delay.numbers["delay"] == pytest.approx(-0.02, abs=5e-4)
    asked = re.findall(r"rotor_\w+ = ([\d.]+)", rotors.text)
    np.testing.assert_allclose([*map(float, asked)], [*wrist.PARAMETERS.values()], rtol=0.03)


def test_torques_that_explain_nothing_have_no_gain(arm, table):
    """A gain of nothing is not known, however small its error."""
    other = table.copy()
    other[wrist.COLUMNS[1]] = 1e3 * np.sin(np.outer(table["t"], [31.0, 37.0, 41.0]))
    verdict = judged(arm, other)
    gain = identifiable(verdict, "torque gain")
    assert not gain.possible and "0.000 +- 0.000" not in gain.reason
    for answer in answers(verdict, "sign of torque").values():
        assert answer.passed is None and answer.words.startswith("cannot tell")


def test_a_gain_of_all_torques_is_no_cause_where_free_masses_leave_far_less(arm, table):
    """As of an arm whose rotors and payload are missing together."""
    half = table.copy()
    half[wrist.COLUMNS[1]] *= 0.5
    data = wrist.dataset(arm, half)
    assert "gain of all torques is 2.0" in check(data).findings[0].text
    measured = Measured.of_dataset(data, motions_of(data.recordings))
    rows = adapted(measured.balances, measured.motions)
    torque = rows.means(measured.torque)
    fit = partial_regression(rows, torque, measured.nominal)
    for free in (1.0, 0.0):
        words = {e.words for e in model_errors(measured, rows, torque, fit, free)}
        assert (ALL in words) == (free == 1.0)
