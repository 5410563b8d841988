"""The peer: Coulomb and viscous friction of each joint by mujoco.sysid, in a process of its own.

python mujoco_side.py TASK.npz RESULT.npz documented|batched|free

`documented` is the way of the toolbox's README: `ModelSequences`, `build_residual_fn`, `optimize`.
Version 4.0 then compiles models and rolls out anew for every window. `batched` hands all windows at
once to its `model_residual`, which is public too, and rolls them out side by side on all cores: the
same answer, sooner. `free` frees the start states as well, which the toolbox does not offer but
lets one do: parameters without modifier, that a `custom_rollout` puts into the initial states.

What is chosen to the toolbox's advantage, with the curve errors of joint 1 and 2 that it has then
(Coulomb and viscous truth, seed 1: 0.75 % / 0.77 %) and those that it would have otherwise:

- Predicted angles are read from the state. Its sensors show the state before the step that they are
  filed under, so they are one step late: 4.8 % / 3.8 %.
- Residuals are plain angles. By default those of each window are divided by the size of its own
  angle, so that noise counts most where a joint happens to be near zero: 1.5 % / 3.8 %.
- The torque is held as it was, not interpolated between samples: 0.9 % / 1.3 %.
- Dry friction is as stiff as it can be (acrobot_mjcf.py): 1.6 % / 1.3 % with default parameters.
- The integrator is RK4 (acrobot_mjcf.py): implicitfast with the same steps 4.3 % / 1.3 %, with four
  times as many, which then take as long, 1.1 % / 0.5 %.
- Four steps a sample. Eight take twice as long and bring 0.56 % / 0.60 %, two 1.4 % / 1.2 %. For
  `free` it is eight: the error of the steps is what free start states leave.
- Steps of the fit are scaled by the Jacobian and end at 1e-4 of the parameters, and a step that
  brings nothing is shortened 20 times, not 140: finite differences of motion with stick are not
  exact, and with the defaults up to three quarters of the evaluations go into such searches. The
  figures above do not change.
- Rollouts use all cores.
- `batched` and `free` use the toolbox's "scipy" backend: its own needs Jacobians that
  `model_residual` does not order right for more than one window, and has no sparse ones.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from exchange import Task, load
from mujoco import sysid

JOINTS = ("joint1", "joint2")
# [N m], [N m s/rad]: begin within a factor of three to four of most truths, bounds far away
COULOMB = (0.05, 0.0, 1.0)
VISCOUS = (0.001, 0.0, 0.1)
REACH = (0.1, 0.1, 5.0, 5.0)  # of free start states, [rad] and [rad/s]
TOLERANCE = {"x_scale": "jac", "xtol": 1e-4}
PATIENCE = {"mu_factor": 10**0.5, "mu_max": 1e3}
FLAT = {"ftol": 1e-5}


def available() -> bool:
    """Whether the toolbox is installed: without its extra, `mujoco.sysid` is there but empty."""
    return hasattr(sysid, "optimize")


def parameters() -> Any:
    """What is asked for: dry friction and damping of each joint."""
    out = sysid.ParameterDict()
    for joint in JOINTS:
        out.add(sysid.Parameter(f"{joint} coulomb", *COULOMB, modifier=_coulomb(joint)))
        out.add(sysid.Parameter(f"{joint} viscous", *VISCOUS, modifier=_viscous(joint)))
    return out


def _coulomb(joint: str) -> Any:
    return lambda spec, p: setattr(spec.joint(joint), "frictionloss", p.value[0])


def _viscous(joint: str) -> Any:
    return lambda spec, p: spec.joint(joint).damping.__setitem__(0, p.value[0])


def sequences(task: Task, spec: Any, substeps: int) -> Any:
    """The windows as the toolbox wants them, torques on the steps of the simulation."""
    model = spec.compile()
    steps = task.length * substeps
    # as the simulation adds up its time, or the last sample may fall behind its end by rounding
    time = np.concatenate([[0.0], np.add.accumulate(np.full(steps, model.opt.timestep))])
    torque = np.repeat(task.windows(task.torque)[:, :-1, 1:], substeps, axis=1)
    torque = np.concatenate([torque, torque[:, -1:]], axis=1)  # its last one is never applied
    names = [f"{joint}_qpos" for joint in JOINTS]
    angle = task.windows(task.angle)
    return sysid.ModelSequences(
        "acrobot",
        spec,
        [f"window {i}" for i in range(task.count)],
        [sysid.create_initial_state(model, s[:2], s[2:]) for s in task.start.reshape(-1, 4)],
        [sysid.TimeSeries.from_control_names(time, u, model) for u in torque],
        [sysid.TimeSeries.from_names(time[::substeps], q, model, names=names) for q in angle],
    )


def residual(substeps: int, first: bool) -> Any:
    """Measured minus predicted angles of a window; with its first sample where starts are free."""

    # the toolbox calls it with two more arguments by position, and with the state by name
    def of_window(_p: Any, predicted: Any, measured: Any, *_: Any, state: np.ndarray) -> Any:
        end = state[substeps - 1 :: substeps, 1:3]
        if first:  # the sensors' first row is the start itself
            end = np.concatenate([predicted.data[:1], end])
        return measured.data[-len(end) :] - end, measured, measured

    return of_window


def documented(task: Task, spec: Any, substeps: int) -> np.ndarray:
    """Estimates by the toolbox's README."""
    of_window = residual(substeps, first=False)
    evaluate = sysid.build_residual_fn(
        models_sequences=[sequences(task, spec, substeps)],
        modify_residual=of_window,
        resample_true=False,
        n_threads=cores(),
    )
    found = sysid.optimize(parameters(), evaluate, verbose=False, **TOLERANCE, **PATIENCE)
    return found[0].as_vector()


def batched(task: Task, spec: Any, substeps: int) -> np.ndarray:
    """Estimates with all windows rolled out side by side."""
    evaluate = together(sequences(task, spec, substeps), residual(substeps, first=False), None)
    found = sysid.optimize(
        parameters(), evaluate, optimizer="scipy", verbose=False, **TOLERANCE, **FLAT
    )
    return found[0].as_vector()


def free(task: Task, spec: Any, substeps: int) -> np.ndarray:
    """Estimates with each window's start state free, sparse Jacobians by grouped differences."""
    from scipy.sparse import csr_array, eye_array, hstack, kron

    params, start = parameters(), task.start.reshape(-1, 4)
    shared = params.size
    params.add(sysid.Parameter("start", start, start - REACH, start + REACH))

    def from_start(initial_states: Any, param_dicts: Any, **rest: Any) -> Any:
        states = np.array(initial_states)
        states[:, 1:5] = np.concatenate([p["start"].value for p in param_dicts])
        return sysid.sysid_rollout(initial_states=states, **rest)

    rows = 2 * (task.length + 1)
    everywhere = csr_array(np.ones((task.count * rows, shared)))
    own = kron(eye_array(task.count), np.ones((rows, 4)))
    found = sysid.optimize(
        params,
        together(sequences(task, spec, substeps), residual(substeps, first=True), from_start),
        optimizer="scipy",
        verbose=False,
        jac_sparsity=hstack([everywhere, own]).tocsr(),
        tr_solver="lsmr",
        **TOLERANCE,
        **FLAT,
    )
    return found[0].as_vector()[:shared]


def together(all_windows: Any, of_window: Any, rollout: Any) -> Any:
    """Residuals of all windows from one call of the toolbox's `model_residual`."""

    def evaluate(x: np.ndarray, params: Any) -> Any:
        found = sysid.model_residual(
            x,
            params,
            lambda p: sysid.apply_param_modifiers(p, all_windows.spec),
            all_windows.measured_rollout,
            modify_residual=of_window,
            custom_rollout=rollout,
            n_threads=cores(),
            resample_true=False,
        )
        return [found[0]], *found[1:]

    return evaluate


def cores() -> int:
    """Threads for rollouts: as many as this process may use."""
    return len(os.sched_getaffinity(0))


WAYS = {"documented": (documented, 4), "batched": (batched, 4), "free": (free, 8)}


def main(source: str, target: str, way: str) -> None:
    """Read a task, fit, write theta (2, 2): Coulomb and viscous friction of each joint."""
    if not available():
        sys.exit("mujoco.sysid lacks its packages: pip install -c constraints.txt -e '.[peers]'")
    task = load(Path(source))
    fit, substeps = WAYS[way]
    spec = mujoco.MjSpec.from_string(task.mjcf)
    spec.option.timestep = (task.time[1] - task.time[0]) / substeps
    np.savez(target, theta=fit(task, spec, substeps).reshape(2, 2))


if __name__ == "__main__":
    main(*sys.argv[1:])
