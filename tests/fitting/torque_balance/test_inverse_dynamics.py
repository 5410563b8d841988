"""Inverse dynamics: truth in, truth out; slopes, folds and refusals."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.changed_data import changed, one_changed
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.sines import sines

import frictionid as fid
from frictionid.arrays import times
from frictionid.comparison.cross_validate import Benchmark, run
from frictionid.comparison.fit_model import fit_model
from frictionid.comparison.suite import identifier_named
from frictionid.comparison.suite_recipes import RecipeEntry, recipe_of
from frictionid.data.plants import Calibration, plant_of
from frictionid.data.state_estimators import RTS, States
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.fitting.identifiers import Frictionless, LeastSquares
from frictionid.fitting.parameter_block import (
    Estimate,
    free_blocks,
    values_of,
    with_values,
)
from frictionid.fitting.parameters import (
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
    heaviest_rotors,
)
from frictionid.fitting.torque_balance import InverseDynamics, TorqueSettings, torque_balance
from frictionid.fitting.torque_balance.solve import TorqueProblem
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, MotorLoad, Stribeck
from frictionid.mechanics import double_pendulum, urdf
from frictionid.simulate import Camera, Curve, Drive, Multisine, Rig, Run, simulate, write_dataset
from frictionid.simulate import Stribeck as TrueStribeck
from frictionid.simulate.rig import true_system

NOMINAL = {"m1": 0.6, "m2": 0.5, "l1": 0.25, "r1": 0.12, "r2": 0.13, "I1": 0.013, "I2": 0.012}
TRUE = {**NOMINAL, "m1": 0.72, "m2": 0.42, "I1": 0.0156, "I2": 0.0098}
LEVEL, PEAK = (0.12, 0.05), (0.05, 0.02)
CURVE = Curve(LEVEL, LEVEL, (0.05, 0.02), PEAK, PEAK, stribeck_velocity=(0.6, 0.9))
COULOMB = LeastSquares(CoulombViscous())
BOTH = (FrictionBlock(), InertiaBlock(), DelayBlock(), BiasBlock())
FREE = InverseDynamics(blocks=BOTH[:2])


def rig(noise, recordings=4, samples=1000):
    """A driven double pendulum at 250 Hz, inertias some 20 % off the nominal ones."""
    runs = tuple(
        Run(
            f"{k}",
            (0.3 * k - 0.8, 0.2 * k),
            torques=(
                Multisine(1.1, (0.31 + 0.05 * k, 0.83, 1.37)),
                Multisine(0.45, (0.41, 0.93 + 0.07 * k, 1.51)),
            ),
        )
        for k in range(recordings)
    )
    return Rig(
        "two_joints",
        {"kind": "double_pendulum", "parameters": NOMINAL},
        TrueStribeck(CURVE),
        Camera(rate=250.0, samples=samples, angle_noise=noise),
        runs,
        true_parameters={k: TRUE[k] for k in ("m1", "m2", "I1", "I2")},
        drive=Drive(rate=250.0, delay=0.003),
        substeps=2,
    )


@pytest.fixture(scope="module")
def clean():
    return simulate(rig(1e-5), 3)


def curve_error(friction):
    """Relative error (2,) of the curves between 0.05 and 6 rad/s."""
    w = np.linspace(0.05, 6.0, 200)
    w = np.concatenate([-w, w])
    true = np.stack([CURVE.torque(np.stack([w, w], -1), np.sign(w)[:, None])])[0]
    off = friction.curve(w) - true
    return np.sqrt((off**2).mean(axis=0) / (true**2).mean(axis=0))


def test_truth_in_truth_out(clean):
    """Friction, base parameters and delay of a truth with real stiction and other inertias."""
    method = InverseDynamics(blocks=BOTH)
    friction = fit_model(clean, LeastSquares(Stribeck()), method)
    assert (curve_error(friction) < 0.02).all()
    true = true_system(rig(0.0)).p
    assert friction.calibration.base == pytest.approx(true, rel=0.01)
    assert float(friction.calibration.delay) == pytest.approx(0.003, abs=2e-4)
    refined = friction.provenance.refined
    assert refined.settled
    assert "angle_noise" not in refined.document()
    assert (refined.torque_noise < 0.05).all()  # of torques of some N m
    assert [dropped.block for dropped in refined.dropped] == ["bias"]


def test_noise_and_ripple_leave_the_friction(clean):
    """Encoder noise of 0.1 mrad, and torque ripple faster than the windows."""
    draw = np.random.default_rng(4)
    ripple = 0.3 * np.sin(2 * np.pi * 61.0 * clean.recordings[0].torque.time)[:, None]
    rough = changed(clean, "angle", lambda q: q + 1e-4 * draw.normal(size=q.shape))
    rough = changed(rough, "torque", lambda u: u + ripple)
    friction = fit_model(rough, LeastSquares(Stribeck()), InverseDynamics())
    assert (curve_error(friction) < 0.03).all()
    nominal = fit_model(rough, LeastSquares(Stribeck()))  # which holds the inertias
    assert (curve_error(friction) < curve_error(nominal)).all()


def test_the_balance_holds_along_exact_motion():
    """Y p + Tf = u, against accelerations of the equations of motion, to fourth order."""
    mechanism = double_pendulum(**NOMINAL)
    data = simulate(rig(0.0, recordings=1, samples=40), 3)
    p = plant_of(data).p[0]
    off = []
    motion = ((1.0, 2.0),), ((0.5, 3.0),)
    for dt in (0.02, 0.01):
        t = np.arange(0.0, 0.8, dt)
        balance = torque_balance(data, [States(t, *sines(t, *motion)[:2])], 0.16, 1e-4)
        fine = np.linspace(balance.start, balance.stop, 801)
        at, speed, a = (x.reshape(801, -1, 2) for x in sines(fine.ravel(), *motion))
        M, h = mechanism.dynamics(p, at, speed)
        u = times(M, a) - h
        weights = np.full(801, 1.0)
        weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
        mean = np.einsum("s,ski->ki", weights / weights.sum(), u)
        off.append(np.abs(np.einsum("kib,b->ki", balance.regressor, p) - mean).max())
    assert off[1] < 1e-5
    assert off[0] / off[1] > 10  # fourth order: 16


@pytest.mark.parametrize(("recordings", "count"), [(4, 0.0), (3, 2e-5)])
def test_joints_that_move_in_turn_show_their_friction(tmp_path, recordings, count):
    """Nothing scatters between recordings that show one joint each: stretches of them do.

    What holds a joint at rest is any torque up to its friction, and says nothing.
    """
    single = wrist.mechanism(tmp_path, gravity=[0.0, 0.0, -9.81])
    frames = wrist.frames_joint_by_joint(single, 10.0, 8.0, count=count)
    frames["again"] = frames["joint 1"]
    data = wrist.dataset(single, dict(list(frames.items())[:recordings]))
    friction = fid.fit(data, "coulomb_viscous").frame.query("block == 'friction'")
    true = np.stack([wrist.COULOMB[:3], wrist.VISCOUS[:3]], axis=1).ravel()
    assert friction["identified"].all()
    assert (np.abs(friction["value"] - true) < 3 * friction["error"]).all()
    assert (friction["error"] < 0.1 * true).all()


def test_slopes_are_those_of_the_residual(clean):
    mechanism = plant_of(clean).mechanism
    states = RTS()([r.angle for r in clean.recordings])
    balance = torque_balance(clean, states, 0.05, 0.004)
    theta = np.array([[0.1, 0.06, 0.7, 0.03], [0.06, 0.02, 1.2, 0.01]])
    calibration = replace(
        Calibration.ideal(2, mechanism.base({})),
        delay=np.asarray(0.0031),
        gain=np.array([1.1, 0.9]),
    )
    estimate = Estimate(Friction(Stribeck(width=1e-7), theta), calibration, mechanism)
    blocks = free_blocks((*BOTH, GainBlock()), estimate)
    problem = TorqueProblem(balance, blocks, estimate, TorqueSettings())
    slopes, values = problem.slopes(estimate), values_of(estimate, blocks)
    for k, parameter in enumerate(problem.parameters):
        step = np.zeros(len(values))
        step[k] = 1e-5 * max(1.0, abs(values[k])) if parameter.block != "delay" else 1e-6
        up, down = (
            problem.unexplained(with_values(estimate, blocks, values + s * step)) for s in (1, -1)
        )
        difference = (up - down) / (2 * step[k])
        size = np.abs(difference).max()
        close = np.abs(slopes[..., k] - difference) < 1e-4 * size
        assert close.mean() > 0.9999, parameter.name


@pytest.mark.parametrize("seed", [0, 3])
def test_noise_of_the_torque_leaves_the_delay(seed):
    """Of a slow motion, whose torque changes less from sample to sample than by its noise."""
    usual, late = rig(1e-4, recordings=2, samples=6000), Drive(rate=500.0, delay=0.006)
    runs = tuple(
        replace(run, torques=tuple(replace(u, frequencies=(0.09, 0.27, 0.43)) for u in run.torques))
        for run in usual.recordings
    )
    slow = replace(usual, recordings=runs, camera=replace(usual.camera, rate=500.0), drive=late)
    draw = np.random.default_rng(100 + seed)
    noisy = changed(
        simulate(slow, seed),
        "torque",
        lambda u: u + 0.08 * u.std(axis=0) * draw.normal(size=u.shape),
    )
    friction = fit_model(noisy, LeastSquares(Stribeck()), InverseDynamics(blocks=BOTH))
    assert float(friction.calibration.delay) == pytest.approx(0.006, abs=1e-3)


def test_torque_scales_friction_and_inertia(clean):
    """Twice the torque is twice the machine: only the scale of the torque is left to see."""
    twice = changed(clean, "torque", lambda u: 2.0 * u)
    one, two = (fit_model(data, COULOMB, FREE) for data in (clean, twice))
    assert two.theta == pytest.approx(2.0 * one.theta, rel=1e-3)
    assert two.calibration.base == pytest.approx(2.0 * one.calibration.base, rel=1e-3)


def test_a_held_inertia_leaves_the_one_step_fit(clean):
    """With friction alone free, both routes to it agree: rows as torques or as velocities."""
    exact = replace(clean, mechanism=clean.mechanism.with_values(TRUE))
    alone = InverseDynamics(blocks=(FrictionBlock(), DelayBlock()))
    friction = fit_model(exact, LeastSquares(Stribeck()), alone)
    assert (curve_error(friction) < 0.02).all()
    assert friction.calibration.base == pytest.approx(plant_of(exact).p[0])


def test_folds_do_not_see_what_they_hold_out():
    data = simulate(rig(1e-5, recordings=2, samples=400), 3)
    moved = 0.5 * data.recordings[0].angle.value + 0.1
    other = one_changed(data, "angle", 0, slice(None), slice(None), moved)
    theta = []
    for one in (data, other):
        folds = make_folds(one.recordings, Split(count=2))
        benchmark = Benchmark(one, folds, Protocol(horizons=(0.25,)))
        result = run(benchmark, COULOMB, FREE)
        theta.append(result.friction.theta[folds.labels[0][0]])
    assert theta[0] == pytest.approx(theta[1], rel=1e-9)


@pytest.mark.parametrize(
    ("method", "says"),
    [
        (InverseDynamics(blocks=(FrictionBlock(), OffsetBlock())), "by shooting"),
        (InverseDynamics(blocks=(FrictionBlock(), FrictionBlock())), "twice"),
        (InverseDynamics(blocks=(FrictionBlock(), InertiaBlock(), GainBlock())), "a free gain"),
        (InverseDynamics(settings=TorqueSettings(window=100.0)), "shorten the window"),
    ],
)
def test_what_it_cannot_show_is_refused(clean, method, says):
    with assert_refused(says):
        fit_model(clean, COULOMB, method)


def test_a_loss_of_the_motor_s_torque_needs_known_inertias(clean):
    loss = LeastSquares(MotorLoad())
    with assert_refused("explains any torque by itself"):
        fit_model(clean, loss, InverseDynamics())
    friction = fit_model(clean, loss, InverseDynamics(blocks=(FrictionBlock(),)))
    assert np.isfinite(friction.theta).all()


def test_networks_are_refused(clean):
    with assert_refused("networks"):
        fit_model(clean, identifier_named("mlp", {}), InverseDynamics())


def test_a_joint_without_motor_shows_no_inertia(clean):
    undriven = double_pendulum((False, True)).with_values(TRUE)
    passive = changed(clean, "torque", lambda u: u * [0.0, 1.0])
    with assert_refused("joint 1 has no motor"):
        fit_model(replace(passive, mechanism=undriven), COULOMB, InverseDynamics())


def test_a_given_friction_stays(clean):
    fitted = fit_model(clean, Frictionless(), InverseDynamics(blocks=(InertiaBlock(),)))
    assert fitted.theta.size == 0


def test_settings_are_checked():
    with assert_refused("window: it should be greater than 0"):
        TorqueSettings(window=0.0)


def test_a_suite_names_it():
    entry = RecipeEntry(name="torques", by="inverse_dynamics", free=["friction"], window=0.1)
    method = recipe_of(entry)
    assert isinstance(method, InverseDynamics)
    assert (method.name, method.settings.window) == ("torques", 0.1)
    assert [b.name for b in method.blocks] == ["friction"]
    with assert_refused('windows needs by = "shooting"'):
        recipe_of(RecipeEntry(name="torques", by="inverse_dynamics", windows=[0.1]))
    with assert_refused('window needs by = "inverse_dynamics"'):
        recipe_of(RecipeEntry(name="mine", by="shooting", window=0.1))


def test_the_command_line_fits_by_it(tmp_path, run):
    write_dataset(simulate(rig(1e-5, recordings=2, samples=400), 3), tmp_path / "data")
    given = ("fit", "data", "--identifier", "coulomb_viscous", "--out", "model.json")
    call = partial(run, tmp_path, *given)
    code, out, _ = call("--by", "inverse_dynamics")
    assert (code, "inertia_11" in out) == (0, True)
    outcome = call("--replace", "--by", "inverse", "--free", "friction")
    assert_one_line(outcome, "did you mean 'inverse_dynamics'")


def test_rotors_end_where_they_would_hold_a_joint_fast(tmp_path):
    """Far above what they are, in proportion to the arm's inertia; other parameters are free."""
    arm = wrist.mechanism(tmp_path)
    most = dict(zip(arm.base_names, heaviest_rotors(arm), strict=True))
    rotors = {name: most[name] for name in wrist.PARAMETERS if name in most}
    assert rotors and all(10 * wrist.PARAMETERS[n] < v < 1e3 for n, v in rotors.items())
    assert all(np.isinf(v) for n, v in most.items() if n not in rotors)
    arm = arm.with_values({"rotor_three": 2 * wrist.PARAMETERS["rotor_three"]})
    heavier = dict(zip(arm.base_names, heaviest_rotors(arm), strict=True))
    assert all(heavier[n] >= v for n, v in rotors.items())


def test_the_rotor_of_a_bare_flange_is_found(tmp_path):
    """It outweighs the links behind it a thousand times, as in wrists whose file has no rotors."""
    arm, _, links = wrist.URDF.replace('"6"', '"60"').partition('<link name="b">')
    flange = links.replace('"0.02"', '"1e-5"').replace('"3"', '"0.02"').replace('"2"', '"0.01"')
    (tmp_path / "flange.urdf").write_text(f'{arm}<link name="b">{flange}', encoding="utf-8")
    arm = urdf(tmp_path / "flange.urdf")
    data = wrist.dataset(arm, wrist.frame(arm.with_values({"rotor_two": 0.3})))
    base = fid.fit(data, "coulomb_viscous").calibration.base
    assert base[arm.base_names.index("rotor_two")] == pytest.approx(0.3, rel=0.05)


def test_a_rotor_that_only_the_file_has_is_found_to_be_none(tmp_path):
    """It outweighs the wrist forty times: M is far below a twentieth of that of the file."""
    truth = wrist.mechanism(tmp_path).with_values({"rotor_three": 0.0})
    data = wrist.dataset(truth.with_values({"rotor_three": 3.0}), wrist.frame(truth))
    fit = fid.fit(data, "coulomb_viscous")
    assert fit.calibration.base == pytest.approx(truth.nominal_base, abs=0.004)
