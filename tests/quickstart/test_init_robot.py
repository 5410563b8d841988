"""frictionid init with a URDF or MJCF: joints, columns, units and sides are what was meant."""

import re
import tomllib

import numpy as np
import pandas as pd
import pytest
from fixtures import bags
from fixtures import driven_wrist as wrist
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.comparison.suite import load_suite, tasks_of
from frictionid.comparison.suite_recipes import usual_method
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.table import Table
from frictionid.mechanics import mjcf, urdf
from frictionid.quickstart.plan import plan_for
from frictionid.quickstart.robot_columns import robot_columns, robot_file, tokens

LIMITS = '<limit lower="-2" upper="2" velocity="3" effort="60"/></joint>'
GEARS = np.diag([50.0, 60.0, -40.0])
LEGGED = """
<mujoco><compiler angle="radian"/><asset><mesh file="trunk.obj"/></asset>
<worldbody><body name="trunk"><freejoint/><inertial pos="0 0 0" mass="5" diaginertia=".1 .1 .1"/>
<geom type="mesh" mesh="trunk" contype="0" conaffinity="0"/>
<body name="thigh" pos="0 0 -.1"><inertial pos="0 0 -.1" mass="1" diaginertia=".01 .01 .01"/>
<joint name="hip_joint" axis="0 1 0" range="-2 2" armature="0.01"/>
<body name="calf" pos="0 0 -.2"><inertial pos="0 0 -.1" mass=".3" diaginertia=".002 .002 .002"/>
<joint name="knee_joint" axis="0 1 0" range="-2.7 2.7" armature="0.01"/></body></body></body>
</worldbody><actuator><motor joint="hip_joint" ctrlrange="-20 20"/>
<motor joint="knee_joint" ctrlrange="-40 40"/></actuator></mujoco>
"""


@shared
def arm(shared_path):
    """Folder with a URDF as xacro writes it, a mesh, and the arm of it."""
    text = wrist.URDF.replace("</joint>", LIMITS).replace(
        '<robot name="wrist">', '<robot name="wrist" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    )
    (shared_path / "meshes").mkdir()
    (shared_path / "meshes/link.stl").write_bytes(b"solid")
    (shared_path / "wrist.urdf").write_text(text)
    return urdf(shared_path / "wrist.urdf").with_values(
        {"rotor_one": 0.4, "rotor_two": 0.3, "rotor_three": 0.05}
    )


@shared
def exact(arm):
    """Angles and torques of the joints: those of motors with unit gears, without their zero."""
    frame = wrist.frame(arm, 8.0)
    return frame["t"].to_numpy(), *wrist.of_joints(frame)


@pytest.fixture
def call(arm, exact, tmp_path, run):
    """Call init in a folder with a table of these columns, and read what it wrote."""
    rotors = (("one", 0.4), ("two", 0.3), ("three", 0.05))
    (tmp_path / "legged.xml").write_text(LEGGED)

    def init(columns, *arguments, robot=arm.options["urdf"], known=rotors):
        known = () if robot == "legged.xml" else known
        frame = pd.DataFrame({"t": exact[0], **columns})
        (tmp_path / "log").mkdir(exist_ok=True)
        frame.to_csv(tmp_path / "log/run.csv", index=False)
        for name in ("dataset.toml", "suite.toml"):
            (tmp_path / "log" / name).unlink(missing_ok=True)
        sets = [x for name, value in known for x in ("--set", f"rotor_{name}={value}")]
        code, out, err = run(tmp_path, "init log --mechanism", robot, *arguments, *sets)
        assert (code, err) == (0, f"reading {robot} and the tables, which takes seconds ...\n")
        return tomllib.loads((tmp_path / "log/dataset.toml").read_text()), out

    init.folder = tmp_path / "log"
    return init


JOINTS, LEGS = ("one", "two", "three"), ("hip", "knee")


def named(parts, joints=JOINTS):
    """Columns of values (T, n) by the names of the joints, of each pattern of a name."""
    pairs = [(pattern, values, j) for pattern, values in parts.items() for j in range(len(joints))]
    return {pattern.format(joints[j]): values[:, j] for pattern, values, j in pairs}


@pytest.fixture
def joints(exact):
    """Columns of the angles and torques of the joints."""
    return named({"q_{}": exact[1], "tau_{}": exact[2]})


@pytest.fixture
def robot_folder(tmp_path):
    """A folder with the file of the arm."""
    (tmp_path / "wrist.urdf").write_text(wrist.URDF)
    return tmp_path


def same(folder, exact):
    (recording,) = load_dataset(folder).recordings
    assert_allclose(recording.angle.value, exact[1], atol=1e-6)
    assert_allclose(recording.torque.value, exact[2], atol=1e-6)


def test_columns_of_sensors_come_before_filtered_ones_and_commands(call, exact):
    _, q, u = exact
    others = {f"{name}{j}": u[:, 0] for name in ("pos_filt", "tau_con", "tau_fric") for j in "123"}
    names = [f"{name}_meas{j}" for name in ("pos", "tau") for j in "123"]
    sensors = dict(zip(names, np.concatenate([q, u], axis=1).T, strict=True))
    columns = call(others | sensors)[0]["columns"]
    assert [*columns["angle"], *columns["torque"]] == names
    same(call.folder, exact)


def test_degrees_and_counts_of_joints_are_known_by_the_limits_of_the_file(call, exact):
    time, q, u = exact
    w = np.degrees(np.gradient(q, time, axis=0))
    table = named({"pos_{}": np.degrees(q), "vel_{}": w, "effort_{}": u})
    document, out = call(dict(reversed(table.items())))
    assert document["mechanism"]["joints"] == ["one", "two", "three"]
    assert document["units"]["angle"] == "deg" and "motor" not in document
    assert document["columns"]["velocity"] == ["vel_one", "vel_two", "vel_three"]
    assert "limits of the file" in out and "one: -2 to 2, 3, 60" in out
    same(call.folder, exact)
    call(named({"pos_{}": np.rint(2048 + 2048 / np.pi * q), "effort_{}": u}))
    assert_allclose(load_dataset(call.folder).recordings[0].angle.value, q, atol=8e-4)


def test_the_only_robot_of_a_folder_is_taken_and_meshes_are_not_looked_at(call, exact, joints, arm):
    folder = str(arm.options["urdf"]).removesuffix("/wrist.urdf")
    document, _ = call(joints, robot=folder)
    assert document["mechanism"]["urdf"].endswith("wrist.urdf")
    same(call.folder, exact)


def test_motors_have_gears_and_zeros_and_what_is_missing_is_said(call, exact):
    _, q, u = exact
    turned, torques = (q - wrist.ZERO) @ GEARS, u @ np.linalg.inv(GEARS)
    motors = named({"motor_angle_{}": turned, "motor_torque_{}": torques}, range(1, 4))
    document, out = call(motors)
    assert document["motor"]["gear"] == 1.0 and "missing: gear ratios (--gear" in out
    assert "next: write the gear into dataset.toml, then frictionid check" in out
    assert call(named({"motor_pos_{}_deg": q, "tau_{}": u}))[0]["units"]["angle"] == "deg"
    # with the gears, the motion itself says where the angles have their zero
    for gears in ("50,60,-40", "50,60,40"):
        document, _ = call(motors, "--gear", gears)
        assert_allclose(document["motor"]["offset"], wrist.ZERO, atol=1e-6)
        same(call.folder, exact)
    document, out = call(named({"q_{}": q - wrist.ZERO, "tau_{}": u}))
    assert_allclose(document["motor"]["offset"], wrist.ZERO, atol=1e-6)
    assert "gear" not in document["motor"] and "MISSING" not in out
    same(call.folder, exact)


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_a_bag_of_joint_states_is_a_table(exact, robot_folder, run, plugin):
    time, q, u = exact
    order, names = [2, 0, 1], ["three", "one", "two"]  # as some driver sends them
    late = np.round(1e9 * time).astype(int).tolist()
    sent = [
        (t, bags.message(bags.START + t, names, a[order], [], b[order]))
        for t, a, b in zip(late, q, u, strict=True)
    ]
    file = bags.write(robot_folder / "bag", sent, plugin)
    code, out, _ = run(robot_folder, f"init bag/{file.name} --mechanism wrist.urdf")
    assert code == 0 and 'kind = "ros"' in out
    dataset = load_dataset(robot_folder / "bag")
    assert dataset.mechanism.joints == JOINTS
    assert_allclose(dataset.recordings[0].angle.value, q, atol=1e-12)
    assert_allclose(dataset.recordings[0].torque.value, u, atol=1e-12)


def test_columns_may_count_from_zero_and_observers_measure_nothing(exact, tmp_path):
    for names in (JOINTS, ("joint_1", "joint_2", "joint_3")):
        text = wrist.URDF
        for name, other in zip(JOINTS, names, strict=True):
            text = text.replace(f'joint name="{name}"', f'joint name="{other}"')
        (tmp_path / "wrist.urdf").write_text(text)
        columns = named(dict.fromkeys(("ext_tau_{}", "q_{}", "tau_{}"), exact[1]), range(3))
        table = Table("a.csv", np.arange(len(exact[1])), columns)
        chosen = robot_columns(robot_file(tmp_path).robot, table)
        assert tuple(j.name for j in chosen.joints) == names
        assert chosen.angle == ("q_0", "q_1", "q_2")
        assert chosen.torque == ("tau_0", "tau_1", "tau_2")


def test_a_joint_that_hardly_moves_is_locked_where_it_stands(arm, robot_folder, run):
    (robot_folder / "log").mkdir()
    frames = wrist.frames_joint_by_joint(arm, 4.0, 8.0)
    for name in ("joint 1", "joint 2"):
        q, u = wrist.of_joints(frames[name])
        columns = {"t": frames[name]["t"], **named({"q_{}": q, "tau_{}": u})}
        pd.DataFrame(columns).to_csv(robot_folder / f"log/{name}.csv", index=False)
    code, out, _ = run(robot_folder, "init log --mechanism wrist.urdf")
    assert code == 0 and "three: hardly any motion in these tables" in out
    assert load_dataset(robot_folder / "log").mechanism.joints == ("one", "two")


def test_constants_and_gears_are_taken_by_the_masses_where_these_show(call, exact, run):
    _, q, u = exact
    factors = np.array([3.0, -2.0, 5.0])
    currents = named({"q_{}": q, "current_{} [A]": u / factors})
    document, out = call(currents)
    assert document["motor"]["kt"] == 1.0 and "missing: torque constants" in out
    assert "right if these are, one " in out and "joints=" not in out
    assert "--kt=kt_one,kt_two,kt_three --gear=gear_one,gear_two,gear_three" in out
    assert_allclose(document["motor"]["gear"], factors, rtol=0.05)
    assert_allclose(call(currents, "--gear=2")[0]["motor"]["kt"], factors / 2, rtol=0.05)
    document, out = call(named({"q_{}": q, "motor_torque_{} [N m]": u / factors}))
    assert document["motor"]["torque"] == "motor" and "taken as the masses of the file" in out
    assert_allclose(document["motor"]["gear"], factors, rtol=0.05)
    document, _ = call(currents, known=())  # a rotor that nobody gave is not taken for gear
    assert_allclose(document["motor"]["gear"], factors[:2], rtol=0.03)
    noise = np.random.default_rng(0).standard_normal(len(q))
    table, rotors = {**currents, "current_three [A]": noise}, (("one", 0.4), ("two", 0.3))
    document, out = call(table, "--kt=0.5,0.25,0.125", known=rotors)
    assert document["motor"]["kt"] == [0.5, 0.25] and "missing: gear ratios (--gear" in out
    assert_allclose(document["motor"]["gear"], factors[:2] / [0.5, 0.25], rtol=0.1)
    assert {*document["mechanism"]["locked"]} == {"three"}
    again = re.search("with constants: frictionid (.*)", out)[1]
    assert run(call.folder.parent, again.replace("gear_one,gear_two", "6,-8"))[0] == 0
    written = tomllib.loads((call.folder / "dataset.toml").read_text())
    assert written == document | {"motor": {"kt": [0.5, 0.25], "gear": [6.0, -8.0]}}
    assert "in current_three [A] no load shows" in " ".join(out.replace("#", "").split())
    document, out = call(named({"q_{}": q, "current_{} [A]": u / 3.0}), "--kt=0.05", "--gear=60")
    assert document["motor"] == {"kt": 0.05, "gear": 60.0} and "missing: torque" not in out
    same(call.folder, exact)


def test_gears_are_those_of_the_files_transmissions(call, exact, tmp_path):
    (tmp_path / "geared.urdf").write_text(wrist.geared((3, -2, 5)))
    currents = named({"q_{}": exact[1], "current_{}": exact[2] / [3.0, -2.0, 5.0]})
    document, out = call(currents, "--kt=1", robot="geared.urdf")
    assert document["motor"]["gear"] == [3.0, -2.0, 5.0] and "missing" not in out


def test_several_signs_are_corrected_one_after_the_other(call, exact):
    _, q, u = exact
    turned = {"q_{}": q, "current_{} [A]": u * [1.0, -1.0, -1.0]}
    assert "corrected: " in call(named(turned), "--kt=1", "--gear=1")[1]
    same(call.folder, exact)


def test_velocities_behind_a_filter_are_left_out(call, exact):
    time, q, u = exact
    late = np.gradient(q, time, axis=0)
    for k in range(1, len(late)):
        late[k] = late[k - 1] + 0.05 * (late[k] - late[k - 1])  # 0.1 s
    document, out = call(named({"q_{}": q, "vel_{}": late, "tau_{}": u}))
    assert "velocity" not in document["columns"] and "velocities are left out" in out


def test_joints_without_a_torque_are_locked_where_they_are(call, exact):
    _, q, u = exact
    u = u * [1.0, 1.0, 1e-4]
    for angles in ({"q_{}": q}, {"q_{}": np.degrees(q)}):
        document, out = call(named({**angles, "tau_{}": u}), known=(("one", 0.4),))
        assert document["mechanism"]["joints"] == ["one", "two"]
        assert document["mechanism"]["locked"]["three"] == pytest.approx(q[:, 2].mean(), abs=1e-3)
        assert "tau_three stay near zero" in out


def test_a_free_root_is_held_and_targets_stand_for_torques(call, exact, tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    _, q, _ = exact
    columns = named({"q_{}": q, "goal_{}": q}, LEGS)
    monkeypatch.chdir(tmp_path)
    document, out = call(columns, "--gains=20,1.5", robot="legged.xml")
    assert document["mechanism"]["base"] == "trunk" and "it is held" in out
    actuator = document["actuator"]
    assert actuator["target"] == ["goal_hip", "goal_knee"] and actuator["limit"] == [20.0, 40.0]
    assert (actuator["P"], actuator["D"]) == (20.0, 1.5) and "missing" not in out
    assert load_dataset(call.folder).mechanism.joints == ("hip_joint", "knee_joint")
    assert mjcf(tmp_path / "legged.xml", base="trunk").defaults["rotor_hip_joint"] == 0.01


def test_gains_are_those_of_the_files_position_actuators(call, exact, tmp_path):
    pytest.importorskip("mujoco")
    _, q, _ = exact
    actuators = re.search(r"<actuator>.*</actuator>", LEGGED, re.DOTALL)[0]
    servos = (
        '<actuator><position joint="hip_joint" kp="20" kv="1.5"/><general joint="knee_joint" '
        'gainprm="30" biastype="affine" biasprm="0 -30 -1.5"/></actuator>'
    )
    (tmp_path / "legged.xml").write_text(LEGGED.replace(actuators, servos))
    columns = named({"q_{}": q, "goal_{}": q}, LEGS)
    for given, P, D in (((), [20.0, 30.0], 1.5), (("--gains=7,1",), 7.0, 1.0)):
        document, out = call(columns, *given, robot="legged.xml")
        assert (document["actuator"]["P"], document["actuator"]["D"]) == (P, D)
        assert "missing: gains" not in out
        servo = load_dataset(call.folder).recordings[0].servo
        assert_array_equal(servo.gain, P)


@pytest.mark.parametrize(
    "column, joints, method",
    [("tau", 3, "inverse_dynamics"), ("tau", 2, "shooting"), ("goal", 2, "shooting")],
)
def test_the_first_suite_has_the_method_of_fit_and_the_laws_of_quick(
    call, exact, arm, column, joints, method
):
    _, q, u = exact
    robot, names = (arm.options["urdf"], JOINTS) if joints == 3 else ("legged.xml", LEGS)
    columns = {"q_{}": q, f"{column}_{{}}": u if column == "tau" else q}
    call(named(columns, names), robot=robot, known=())
    tasks = tasks_of(load_suite(call.folder / "suite.toml"), call.folder / "suite.toml")
    plan = plan_for(data := load_dataset(call.folder))
    assert {task.recipe.name for task in tasks} == {method}
    assert {usual_method(data, task.identifier) for task in tasks} == {method}
    assert [task.name for task in tasks] == [law.label for law in (*plan.laws, *plan.further)]


def test_a_free_root_with_an_imu_floats(call, exact):
    time, q, u = exact
    still = np.zeros(len(time))
    gyro = {f"imu_gyro_{axis} [deg/s]": 40.0 * np.cos(time) for axis in "xyz"}
    acc = {f"imu_acc_{axis}": still + (axis == "z") for axis in "xyz"}
    columns = named({"q_{}": q, "tau_{}": u}, LEGS)
    document, out = call({**gyro, **acc, **columns}, robot="legged.xml")
    assert document["mechanism"]["floating"] is True and document["mechanism"]["base"] == "trunk"
    assert document["base"]["angular_velocity"] == list(gyro)
    assert document["base"]["specific_force"] == list(acc)
    assert document["base"]["units"] == {"angular_velocity": "deg/s", "specific_force": "g"}
    assert "missing: where the IMU is" in out
    (recording,) = load_dataset(call.folder).recordings
    motion = recording.base_motion.value[100:-100].mean(axis=0)
    assert_allclose(motion[6:], [0.0, 0.0, 9.80665], atol=1e-3)
    document, out = call({**gyro, **columns}, robot="legged.xml")
    assert "base" not in document and "it is held; where it moves, an IMU must say how" in out


def test_a_joint_without_inertia_is_named_and_a_rotor_stands_in(call, joints, tmp_path):
    bare = re.sub('<link name="c">.*?</link>', '<link name="c"/>', wrist.URDF)
    (tmp_path / "bare.urdf").write_text(bare)
    with assert_refused(r"no inertia .* that of three .*give rotor_three \[kg m"):
        urdf(tmp_path / "bare.urdf").nominal()
    document, out = call(joints, robot=str(tmp_path / "bare.urdf"), known=())
    assert document["mechanism"]["parameters"]["rotor_three"] > 0 and "MISSING, a guess" in out
    load_dataset(call.folder).mechanism.nominal()


def test_what_was_written_can_be_checked_and_fitted(call, joints, run):
    call(joints)
    fit = "fit log --identifier coulomb_viscous --by inverse_dynamics --out model.json"
    commands = ("check log", fit, "evaluate model.json log --horizons 0.1")
    (checked, *others) = (run(call.folder.parent, command) for command in commands)
    assert [code for code, *_ in (checked, *others)] == [0, 0, 0], others
    words = r"\n 1, one .*next: one never exceeds 1.1 rad/s: add driven motion"
    assert re.search(words, checked[1], re.S)


def test_columns_are_matched_by_what_names_share():
    assert tokens("current_arm_3") == tokens("arm_3_joint") == {"arm", "3"}
    assert tokens("FR_calf_joint") == tokens("q_FR_calf") == {"fr", "calf"}


@pytest.mark.parametrize(
    "names", [("{}_rad", "{}_Nm"), ("{}", "tau_{}"), ("q_{}", "{} [Nm]"), ("{}.deg", "i_{}")]
)
def test_columns_may_be_called_as_the_joints(names, robot_folder):
    joints = ("three", "one", "two")
    columns = {"time": np.arange(3.0)}
    for k, name in enumerate(names):
        columns |= {name.format(joint): k + np.arange(3.0) for joint in joints}
    matched = robot_columns(robot_file(robot_folder).robot, Table("a.csv", np.arange(3), columns))
    assert [j.name for j in matched.joints] == ["one", "two", "three"]
    for columns, name in zip((matched.angle, matched.torque), names, strict=True):
        assert columns == tuple(name.format(j) for j in ("one", "two", "three"))


def test_columns_that_are_left_over_are_torques_where_each_joint_has_one(call, exact):
    angles, torques = named({"q_{}": exact[1]}), named({"m_{}": exact[2]})
    document, out = call(angles | torques)
    assert document["columns"]["torque"] == [*torques] and "a guess, as no other column" in out
    for others in (torques | {"b": exact[1][:, 0]}, named({"qdd_{}": exact[2]})):
        document, out = call(angles | others)
        assert document["mechanism"]["driven"] is False and "missing: torques or currents" in out
        assert "corrected" not in out  # by how joints fall that nothing drives


def test_a_folder_of_several_robots_asks_for_one(tmp_path):
    for name in ("a.urdf", "b.urdf", "c.txt"):
        (tmp_path / name).write_text(wrist.URDF if name.endswith("urdf") else "x")
    with assert_refused("holds 2 robots .*name one file"):
        robot_file(tmp_path)
    with assert_refused("no URDF .* and no MJCF"):
        robot_file(tmp_path / "c.txt")


def test_columns_that_fit_no_joint_are_one_line(robot_folder):
    table = Table("a.csv", np.arange(3), {"t": np.arange(3.0), "q9": np.arange(3.0)})
    with assert_refused(r"q9 look like angles.* joints one, two, three: name"):
        robot_columns(robot_file(robot_folder).robot, table)
    with assert_refused("--angle: a.csv has no column of numbers 'q8'"):
        robot_columns(robot_file(robot_folder).robot, table, named={"angle": ["q8"]})
