"""Recordings of a simulated rig: commands, motion, camera."""

import numpy as np

from frictionid.data.recordings import Dataset, Recording, TrueMotion
from frictionid.data.signals import Array, Signal, sample
from frictionid.errors import InputError
from frictionid.mechanics import Plant

from .integrate import integrate_motion
from .rig import Rig, Run, generator, nominal_mechanism, true_system
from .torques import sampled_loop, tracking

ORIGIN = "simulated by frictionid simulate"
# Commands are multiples of 1e-6 N m, so that the tables hold them exactly.
COMMAND_DECIMALS = 6


def simulate(rig: Rig, seed: int | None = None) -> Dataset:
    """Data set of the rig, with true motion and friction; the same for the same seed.

    Parameters
    ----------
    rig : Rig
    seed : int, optional
        In place of the rig's own. Each recording draws from the seed and its name, independently of
        the others.

    Raises
    ------
    InputError
        Where friction is too stiff for the steps.

    Examples
    --------
    >>> from frictionid.simulate import Camera, Curve, Rig, Run, Stribeck
    >>> machine = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 1.0}}
    >>> rig = Rig("demo", machine, Stribeck(Curve((1.0,), (1.0,), (0.1,))),
    ...           Camera(samples=4), (Run("fall", start_angle=(1.5,)),))
    >>> simulate(rig).recordings[0].angle.value.ravel().round(4)
    array([1.5   , 1.4988, 1.4951, 1.489 ])
    """
    seed = rig.seed if seed is None else seed
    time = np.arange(rig.camera.samples) / rig.camera.rate
    with np.errstate(over="ignore", invalid="ignore"):
        commands, states = _tracked(rig, seed, time) if rig.controller else _driven(rig, seed, time)
    for r, run in enumerate(rig.recordings):
        if not np.isfinite(states[:, :, r]).all():
            raise InputError(
                f"recording {run.name!r}: the simulated motion diverges, friction is too stiff for "
                f"its steps: raise substeps = {rig.substeps}"
            )
    recordings = [
        _recorded(rig, run, seed, command, time, states[:, :, r])
        for r, (run, command) in enumerate(zip(rig.recordings, commands, strict=True))
    ]
    texts = {"description": rig.description, "licence": rig.licence, "citation": rig.citation}
    return Dataset(
        name=rig.name,
        mechanism=nominal_mechanism(rig),
        recordings=tuple(recordings),
        origin={"origin": ORIGIN, **{key: text for key, text in texts.items() if text}},
        truth={
            **rig.friction.table(),
            "rig": {
                "torque_delay": rig.drive.delay,
                "torque_gain": rig.drive.gain,
                "parameters": dict(rig.true_parameters),
                "angle_noise": rig.camera.angle_noise,
                "seed": seed,
            },
        },
    )


def _driven(rig: Rig, seed: int, time: Array) -> tuple[list[Signal], Array]:
    """Logged torques of all recordings, and true states at the camera's times (K, 3, R, n)."""
    commands = [_command(rig, run, seed, time[-1]) for run in rig.recordings]
    edges = _merged(time, commands[0].time + rig.drive.delay)
    middles = 0.5 * (edges[1:] + edges[:-1]) - rig.drive.delay
    applied = np.stack([sample(command, middles) for command in commands], axis=1)
    q = np.array([run.start_angle for run in rig.recordings], dtype=float)
    w = np.array([run.start_velocity or (0.0,) * q.shape[1] for run in rig.recordings])
    step = 1.0 / (rig.camera.rate * rig.substeps)
    states = integrate_motion(true_system(rig, seed), q, w, rig.drive.gain * applied, edges, step)
    return commands, states[np.searchsorted(edges, time)]


def _tracked(rig: Rig, seed: int, time: Array) -> tuple[list[Signal], Array]:
    """`_driven` under the position controller."""
    assert rig.controller is not None
    system, references = true_system(rig, seed), [run.references for run in rig.recordings]
    nominal, drive = Plant.from_parameters(nominal_mechanism(rig), {}), rig.drive
    command = tracking(system, nominal, rig.controller, references, time)
    states, torque = sampled_loop(
        *(system, *command, time), delay=drive.delay, gain=drive.gain, substeps=rig.substeps
    )
    rounded = np.round(torque, COMMAND_DECIMALS)
    commands = [Signal(time, rounded[:, r], hold="previous") for r in range(rounded.shape[1])]
    return commands, states


def _command(rig: Rig, run: Run, seed: int, end: float) -> Signal:
    """Logged torque of all joints, held between its samples."""
    count = int(np.floor(end * rig.drive.rate + 1e-9)) + 1
    time = np.arange(count) / rig.drive.rate
    mechanism = nominal_mechanism(rig)
    value = np.zeros((count, mechanism.n))
    draw = generator(seed, run.name, "torque")
    for joint, torque in zip(np.flatnonzero(mechanism.driven), run.torques, strict=False):
        value[:, joint] = torque.values(time, draw)
    return Signal(time, np.round(value, COMMAND_DECIMALS), hold="previous")


def _merged(time: Array, changes: Array) -> Array:
    """The camera's times, and the instants between them at which the applied torque changes."""
    inside = changes[(changes > time[0]) & (changes < time[-1])]
    # an instant that differs from a frame by rounding would make an interval of no length
    at = np.clip(np.searchsorted(time, inside), 1, len(time) - 1)
    gap = np.minimum(np.abs(inside - time[at]), np.abs(inside - time[at - 1]))
    return np.union1d(time, inside[gap > 1e-9])


def _recorded(
    rig: Rig, run: Run, seed: int, command: Signal, time: Array, states: Array
) -> Recording:
    q, w = states[:, 0], states[:, 1]
    noise = generator(seed, run.name, "camera").standard_normal(q.shape)
    angle = q + np.asarray(rig.camera.angle_noise) * noise
    if rig.camera.resolution:
        angle = rig.camera.resolution * np.round(angle / rig.camera.resolution)
    return Recording(
        name=run.name,
        angle=Signal(time, angle),
        covariates=_covariates(rig, run, time),
        torque=_logged(rig, run, seed, command),
        truth=TrueMotion(Signal(time, q), Signal(time, w)),
    )


def _covariates(rig: Rig, run: Run, time: Array) -> dict[str, Signal]:
    """The temperature of the recording, where the rig has one."""
    temperatures = rig.variation.temperature if rig.variation is not None else ()
    if not temperatures:
        return {}
    value = temperatures[rig.recordings.index(run)]
    return {"temperature": Signal(time, np.full((len(time), 1), value))}


def _logged(rig: Rig, run: Run, seed: int, command: Signal) -> Signal:
    """The command with the noise of what measures it."""
    if not rig.drive.torque_noise:
        return command
    noise = generator(seed, run.name, "torque sensor").standard_normal(command.value.shape)
    size = rig.drive.torque_noise * np.sqrt(np.mean(command.value**2, axis=0))
    return command._replace(value=np.round(command.value + size * noise, COMMAND_DECIMALS))
