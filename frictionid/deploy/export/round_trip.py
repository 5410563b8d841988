"""Written files run by their engine, beside our own predictions of the recorded motion."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal, holds, sample
from frictionid.evaluation.initial_states import InitialStates
from frictionid.evaluation.predicted_motion import memory_at
from frictionid.mechanics.rigid_body.robot_files import without_shapes
from frictionid.progress import report_step

from .exported import ExportedFriction
from .nearest import Replay, changed, gains_of, reaching, replayed

_MOST = 48  # predictions


def in_mujoco(
    model: ExportedFriction, xml: str, passive: Any = None, most: int = _MOST
) -> Replay | None:
    """An MJCF replayed from the states that a filter estimates, under what was logged.

    Actuators get the logged targets of servos, else the logged torques; gain, bias and delay are
    the file's. None without data, without MuJoCo, and where no recording is of the file's servo.

    passive : makes a callback of an engine's model, see `callback`; most : predictions
    """
    try:
        import mujoco
    except ImportError:
        return None
    data = model.prepared
    if data is None or model.data is None or model.data.mechanism.floating:
        return None
    initial = _alike(model, reaching(data.initial_states), most)
    if not len(initial.q):
        return None
    spec = without_shapes(mujoco.MjSpec.from_string(xml))
    held, at_once = run_by_engine(spec.compile(), model, initial, passive), None
    if any(a.nsample for a in spec.actuators):
        for a in spec.actuators:
            a.delay, a.nsample = 0.0, 0
        others = run_by_engine(spec.compile(), model, initial, passive)
        at_once = replayed(model, initial, others).mean_apart
    run = replayed(model, initial, held)
    return run._replace(engine=f"MuJoCo {mujoco.__version__}", at_once=at_once)


def sentence(replay: Replay, horizon: float) -> str:
    """The comparison in words.

    >>> sentence(Replay(0.072, 0.073, 0.0002, 0.0009, "rad", 48, engine="MuJoCo 4.0.0"), 1.0)
    'run as it is in MuJoCo 4.0.0, it is 0.0009 rad from our predictions after 1 s (mean of 48; \
median 0.0002), and errs by 0.073 where ours err by 0.072'
    """
    said = (
        f"run as it is in {replay.engine}, it is {replay.mean_apart:.2g} {replay.unit} from our "
        f"predictions after {horizon:g} s (mean of {replay.predictions}; median "
        f"{replay.apart:.2g}), and errs by {replay.held:.3g} where ours err by {replay.model:.3g}"
    )
    if replay.at_once is not None:
        said += (
            f"; without delay, as in MJX 3.17, it is {replay.at_once:.2g} {replay.unit} from ours"
        )
    return said


def _alike(model: ExportedFriction, initial: InitialStates, count: int) -> InitialStates:
    """Starts whose machine is that of the file: servos connected, with the first one's gains.

    Payloads are the mechanism's.
    """
    assert model.data is not None
    first, rows = model.data.recordings[0], []
    for s, r in enumerate(initial.recording):
        recording = model.data.recordings[r]
        clock = _clock(initial, s)
        alike = gains_of(recording) == gains_of(first) and not changed(model, recording)
        if recording.servo is not None:
            alike &= bool(recording.servo.connected(clock).all())
        rows += [s] if alike else []
    most = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), count)).astype(int))
    return initial.take(np.array(rows, dtype=int)[most] if rows else np.array([], dtype=int))


def _clock(initial: InitialStates, s: int) -> Array:
    """Times [s] of a prediction's samples, by the recording's clock."""
    assert initial.time is not None
    steps = initial.dt[: initial.last[-1, s], s]
    return initial.time[s] + np.concatenate([[0.0], np.cumsum(steps)])


def run_by_engine(
    engine: Any, model: ExportedFriction, initial: InitialStates, passive: Any
) -> Array:
    """Angles (S, n) at the horizon, by the engine's steps, shortened to end there."""
    import mujoco

    assert model.data is not None and model.prepared is not None
    true = model.prepared.dataset.recordings  # as the calibration corrects them
    joints = [engine.joint(name) for name in model.joints[: initial.q.shape[1]]]
    places, dofs = ([int(getattr(j, x)[0]) for j in joints] for x in ("qposadr", "dofadr"))
    place = {joint.id: k for k, joint in enumerate(joints)}
    commanded = np.flatnonzero(engine.actuator_ctrlnum == 1)
    pairs = [
        (int(a), place[j]) for a in commanded if (j := int(engine.actuator_trnid[a, 0])) in place
    ]
    if model.drive is None:  # servos of the file do not take the logged torques
        servos = [a for a, _ in pairs if engine.actuator_biasprm[a, 1:3].any()]
        engine.actuator_gainprm[servos] = engine.actuator_biasprm[servos] = 0.0
        pairs = [pair for pair in pairs if pair[0] not in servos]
    bare = {j: dofs[j] for j in model.driven.values()} if model.drive is None else {}
    bare = {j: dof for j, dof in bare.items() if j not in dict(pairs).values()}
    memory = memory_at(model.friction[None][np.zeros(len(initial.q), dtype=int)], initial)
    # actuators that are nothing but bristles
    bristles = np.flatnonzero((engine.actuator_ctrlnum == 0) & (engine.actuator_actadr >= 0))
    bent = [(int(a), place[int(engine.actuator_trnid[a, 0])]) for a in bristles]
    step, out, state = float(engine.opt.timestep), np.empty_like(initial.q), mujoco.MjData(engine)
    for s in range(len(initial.q)):
        report_step("run in MuJoCo", len(initial.q) - s)
        recording = model.data.recordings[initial.recording[s]]
        clock = _clock(initial, s)
        count = int(np.ceil((clock[-1] - clock[0]) / step - 1e-9))
        engine.opt.timestep = (clock[-1] - clock[0]) / count
        mujoco.mj_resetData(engine, state)
        state.qpos[places], state.qvel[dofs] = initial.q[s], initial.w[s]
        for a, j in bent:
            state.act[engine.actuator_actadr[a]] = memory[0][s, j]
        mujoco.set_mjcb_passive(None if passive is None else passive(engine))
        try:
            controls = logged(model, recording), true[initial.recording[s]].torque
            _run(engine, state, pairs, bare, controls, clock[0], count)
        finally:
            mujoco.set_mjcb_passive(None)
        out[s] = state.qpos[places]
    return out


def _run(
    engine: Any,
    state: Any,
    pairs: Sequence[tuple[int, int]],
    bare: Mapping[int, int],
    controls: tuple[Signal, Signal],
    begin: float,
    count: int,
) -> None:
    """So many steps under a logged control; its history is what was logged before.

    Joints without an actuator get the true torque, the second of the controls.
    """
    import mujoco

    (control, torque), dt = controls, engine.opt.timestep
    for actuator, j in pairs:
        length = int(engine.actuator_history[actuator, 0])
        if length:
            before = dt * np.arange(-length, 0)
            values = sample(control, begin + before)[:, j : j + 1]
            mujoco.mj_initCtrlHistory(engine, state, actuator, before, np.ascontiguousarray(values))
    late = any(engine.actuator_history[actuator, 0] for actuator, _ in pairs)
    middle = 0.0 if late or holds(control) else 0.5
    values = sample(control, begin + dt * (np.arange(count) + middle))
    applied = sample(torque, begin + dt * (np.arange(count) + 0.5))
    for row, push in zip(values, applied, strict=True):
        for actuator, j in pairs:
            state.ctrl[engine.actuator_ctrladr[actuator]] = row[j]
        for j, dof in bare.items():
            state.qfrc_applied[dof] = push[j]
        mujoco.mj_step(engine, state)


def logged(model: ExportedFriction, recording: Recording) -> Signal:
    """Commands of the actuators: logged targets in the calibration's angles, else torques."""
    servo = recording.servo
    if model.drive is None or servo is None:
        return recording.torque
    return servo.goal._replace(value=servo.goal.value - model.calibration.offset)
