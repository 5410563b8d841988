"""What a better friction model buys in control: an acrobot swings up, and follows a motion.

    python comparisons/control.py [--seeds 50]

The simulated acrobot of data/acrobot_clean truly sticks; its motor is at the elbow. From each set
of recordings (another noise, each) friction is shot by Coulomb and viscous friction, and by the law
that comparisons recommend on these data. With each of them, and with none, CasADi plans motions by
direct multiple shooting: a swing-up, and a motion whose elbow follows two sines. The plans run on
the simulated rig, integrated by its own event-driven code, under the feedback of a time-varying
linear-quadratic regulator made from the same model; angles are noisy, torques late, starts drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import binomtest
from script import call

import frictionid as fid
from frictionid.deploy.export.exported import exported
from frictionid.deploy.export.formats.casadi import casadi_functions
from frictionid.friction.laws import CoulombViscous, NoFriction, Stribeck
from frictionid.mechanics.description import equations_of_motion
from frictionid.mechanics.symbolic import scalar_code
from frictionid.simulate import Rig, load_rig, sampled_loop
from frictionid.simulate.rig import nominal_mechanism, true_system

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
DT = 0.01  # [s], of plans and of the controller
LIMIT = 0.8  # [N m] of the motor
SMOOTH = 0.3  # [rad/s], over which plans smooth the sign of a velocity
NOISE = 0.0016231562  # [rad], that of the recordings' angles
DELAY = 0.005  # [s], by which torques act late
START = 0.05  # [rad], standard deviation of where a run starts, around hanging down
UPRIGHT, NEAR = np.array([np.pi, 0.0]), 0.2  # [rad]: it has swung up where it stays so near
SWING, HOLD = 3.0, 2.0  # [s] of a swing-up, and of the balance after it
FOLLOW = 4.0  # [s] of the other motion
RECORDINGS = 8  # of the data set, for a fit
STATE_WEIGHT = np.diag([20.0, 20.0, 1.0, 1.0])
TORQUE_WEIGHT = 10.0
MODELS = {
    "none": None,
    "Coulomb-viscous": CoulombViscous(),
    "recommended": Stribeck(symmetric=False),
}
NONE = fid.Friction(NoFriction(), np.zeros((2, 0)))
HOLDING = (0.0, 3.0, 0.0, 0.15)  # feedback after the plan: the elbow's alone, the shaft sticks
OBSERVER = (0.6, 0.25)  # share of a wrong angle that is believed, and that goes to the velocity


class Plan(NamedTuple):
    """States (N + 1, 4) and torques (N,) of a planned motion, gains (N + 1, 4), and time taken."""

    x: Array
    u: Array
    gain: Array


@dataclass(frozen=True)
class Outcome:
    """Of runs (R,): RMS error of the elbow [rad], of all angles, effort [N^2 m^2 s], success."""

    elbow: Array
    error: Array
    effort: Array
    success: Array


@cache
def rig() -> Rig:
    """The simulated acrobot, with the recordings that fits see."""
    whole = load_rig(ROOT / "data" / "acrobot_clean" / "rig.toml")
    every = len(whole.recordings) // RECORDINGS
    return replace(whole, recordings=whole.recordings[::every][:RECORDINGS])


def fits(seed: int) -> dict[str, fid.Friction]:
    """Friction of each model, from recordings with the noise of a seed."""
    data = fid.simulate(rig(), seed)
    known = {name: law for name, law in MODELS.items() if law is not None}
    shot = {n: fid.fit(data, law, method="shooting", free=["friction"]) for n, law in known.items()}
    return {"none": NONE, **{name: fit.friction for name, fit in shot.items()}}


@cache
def frictionless() -> ca.Function:
    """Motion without friction: feedback that counts on Coulomb friction as damping is too weak."""
    return motion(NONE)


def motion(friction: fid.Friction) -> ca.Function:
    """State after DT, of a state (q1, q2, w1, w2) and the torque: RK4, as plans see it."""
    mechanism = nominal_mechanism(rig())
    e = equations_of_motion(mechanism.description)
    code = scalar_code(e.arguments, [*e.M, *e.h])
    p = mechanism.base(mechanism.nominal()).tolist()
    smoothed = fid.compensating(friction, fid.Compensation(gain=1.0, smooth=SMOOTH))
    torque = casadi_functions(exported(smoothed))["torque"]
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")

    def rate(x: Any) -> Any:
        a, b, _, c, *h = code(ca, *ca.vertsplit(x), *p)
        M = ca.vertcat(ca.horzcat(a, b), ca.horzcat(b, c))
        Tf = torque(x[2:]) if friction.law.names else ca.SX.zeros(2)
        return ca.vertcat(x[2:], ca.solve(M, ca.vertcat(*h) + ca.vertcat(0, u) - Tf))

    k1 = rate(x)
    k2 = rate(x + DT / 2 * k1)
    k3 = rate(x + DT / 2 * k2)
    k4 = rate(x + DT * k3)
    return ca.Function("motion", [x, u], [x + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


def planned(step: ca.Function, wanted: Array | None, guess: Plan | None) -> Plan:
    """Plan of a swing-up, or of a motion whose elbow follows `wanted` (N + 1,) [rad]."""
    count = round(SWING / DT) if wanted is None else len(wanted) - 1
    x, u = ca.MX.sym("x", 4, count + 1), ca.MX.sym("u", 1, count)
    gaps = step.map(count)(x[:, :-1], u) - x[:, 1:]
    effort = ca.sumsqr(u) * DT + 1e-2 * ca.sumsqr(u[1:] - u[:-1])
    low = np.tile([-4 * np.pi, -4 * np.pi, -30.0, -30.0], (count + 1, 1))
    high = -low
    low[0] = high[0] = 0.0
    if wanted is None:
        low[-1] = high[-1] = [*UPRIGHT, 0.0, 0.0]
        aim = effort
    else:
        aim = effort + 50.0 * DT * ca.sumsqr(x[1, :] - wanted[None])
    problem = {"x": ca.veccat(x, u), "f": aim, "g": ca.vec(gaps)}
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 400}}
    solver = ca.nlpsol("plan", "ipopt", problem, options)
    begin = guess or _guess(count)
    bounds = np.full(count, LIMIT * 0.85)  # the rest is the feedback's
    found = solver(
        x0=np.concatenate([begin.x.ravel(), begin.u]),
        lbx=np.concatenate([low.ravel(), -bounds]),
        ubx=np.concatenate([high.ravel(), bounds]),
        lbg=0.0,
        ubg=0.0,
    )["x"].full()[:, 0]
    states, torques = found[: 4 * (count + 1)].reshape(-1, 4), found[4 * (count + 1) :]
    if not solver.stats()["success"]:
        return Plan(states, torques, np.full((count + 1, 4), np.nan))
    return Plan(states, torques, gains(frictionless(), states, torques))


def _guess(count: int) -> Plan:
    """A swing that grows: both angles to and fro, the elbow ahead."""
    t = DT * np.arange(count + 1)
    grow = t / t[-1]
    x = np.stack([np.pi * grow**2 * np.sin(2 * np.pi * 1.1 * t), np.sin(2 * np.pi * 1.1 * t)], 1)
    rate = np.gradient(x, DT, axis=0)
    return Plan(np.concatenate([x, rate], axis=1), np.zeros(count), np.zeros((count + 1, 4)))


def gains(step: ca.Function, x: Array, u: Array) -> Array:
    """Feedback (N + 1, 4) of the time-varying linear-quadratic regulator."""
    slope = step.jacobian()
    cost = 10.0 * STATE_WEIGHT
    out = [np.zeros(4)]  # where the plan ends, nothing follows
    for k in reversed(range(len(u))):
        A, B = (part.full() for part in slope(x[k], u[k], step(x[k], u[k])))
        K = np.linalg.solve(TORQUE_WEIGHT + B.T @ cost @ B, B.T @ cost @ A)[0]
        cost = STATE_WEIGHT + A.T @ cost @ (A - B @ K[None])
        out.append(K)
    return np.array(out[::-1])


def run(
    plans: Sequence[Plan], steps: Sequence[ca.Function], seeds: Sequence[int], hold: float
) -> Array:
    """True states (T, 4) and torques (T,) of each plan (P,) and seed (S,): (T, P, S, 5)."""
    count = len(plans[0].u) + 1 + round(hold / DT)
    time, (P, S) = DT * np.arange(count), (len(plans), len(seeds))
    random = [np.random.default_rng(seed) for seed in seeds]
    noise = NOISE * np.stack([r.standard_normal((count, 2)) for r in random], axis=1)
    begin = START * np.stack([r.standard_normal(2) for r in random])
    noise, begin = np.tile(noise, (1, P, 1)), np.tile(begin, (P, 1))
    x, u, gain = (_held([getattr(p, f) for p in plans], count, S) for f in ("x", "u", "gain"))
    u[len(plans[0].u) :] = 0.0
    gain[len(plans[0].u) + 1 :] = HOLDING
    now = {"x": np.concatenate([begin, 0.0 * begin], axis=1), "u": np.zeros(P * S)}
    models = [step.map(S) for step in steps]

    def command(k: int, y: Array) -> Array:
        owns = [slice(i * S, (i + 1) * S) for i in range(P)]
        pairs = zip(models, owns, strict=True)
        next_ = [model(now["x"][own].T, now["u"][None, own]).full().T for model, own in pairs]
        guess = np.concatenate(next_) if k else now["x"]
        wrong = y[0] + noise[k] - guess[:, :2]
        state = guess + np.concatenate([OBSERVER[0] * wrong, OBSERVER[1] / DT * wrong], axis=1)
        torque = np.clip(u[k] - (gain[k] * (state - x[k])).sum(-1), -LIMIT, LIMIT)
        now.update(x=state, u=torque)
        return np.stack([0.0 * torque, torque], axis=1)

    system = true_system(rig())
    start = np.stack([begin, 0.0 * begin, 0.0 * begin])
    moved, torque = sampled_loop(system, command, start, time, delay=DELAY, substeps=3)
    states = np.concatenate([moved[:, 0], moved[:, 1], torque[..., 1:]], axis=-1)
    return states.reshape(count, P, S, 5)


def _held(series: Sequence[Array], count: int, seeds: int) -> Array:
    """Series of each plan (P) as (T, P S, ...), its last entry held to the end."""
    long = [np.concatenate([s, np.repeat(s[-1:], count - len(s), axis=0)]) for s in series]
    return np.repeat(np.stack(long, axis=1), seeds, axis=1)


def trial(seed: int, guesses: dict[str, Plan], runs: int = 1) -> dict[tuple[str, str], Outcome]:
    """Outcomes of both tasks by each model, fitted to the recordings of a seed.

    guesses : plans to begin from, which are replaced by those that were found
    """
    t = DT * np.arange(round(FOLLOW / DT) + 1)
    wanted = np.minimum(t, 1.0) * (0.8 * np.sin(2 * np.pi * 0.7 * t) + 0.4 * np.sin(2 * np.pi * t))
    seeds = [1000 * seed + k for k in range(runs)]
    steps = {name: motion(friction) for name, friction in fits(seed).items()}
    out = {}
    for task, aim, hold in (("swing-up", None, HOLD), ("following", wanted, 0.0)):
        plans = []
        for name, step in steps.items():
            plan = planned(step, aim, guesses.get(f"{task} {name}"))
            guesses[f"{task} {name}"] = plan
            plans.append(plan)
        done = run(plans, list(steps.values()), seeds, hold)
        for i, name in enumerate(steps):
            out[task, name] = outcome(done[:, i], plans[i], aim)
    return out


def outcome(done: Array, plan: Plan, wanted: Array | None) -> Outcome:
    """Scores of runs (T, S, 5) of one plan."""
    count = len(plan.u)
    off = done[: count + 1, :, :2] - plan.x[:, None, :2]
    goal = plan.x[:, 1] if wanted is None else wanted
    elbow = np.sqrt(((done[: count + 1, :, 1] - goal[:, None]) ** 2).mean(axis=0))
    error = np.sqrt((off**2).sum(axis=-1).mean(axis=0))
    effort = (done[..., 4] ** 2).sum(axis=0) * DT
    if wanted is None:
        last = done[-round(1.0 / DT) :, :, :2]
        success = (np.abs(last - UPRIGHT) < NEAR).all(axis=(0, 2))
    else:
        success = error < NEAR
    return Outcome(elbow, error, effort, success)


def interval(values: Array) -> str:
    """Mean with its 95 % interval."""
    half = 1.96 * values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else float("nan")
    return f"{values.mean():.4f} +- {half:.4f}"


def main(*, seeds: int = 50) -> None:
    """Print a table of both tasks and all models.

    Parameters
    ----------
    seeds : Of recordings, starts and noise.
    """
    guesses: dict[str, Plan] = {}
    console = Console()
    trials = [
        trial(seed, guesses) for seed in track(range(seeds), "fit, plan, run", console=console)
    ]
    heads = ("task", "friction in the plan", "success", "error [rad]", "elbow [rad]", "effort")
    table = Table(*heads, title=f"{seeds} seeds; means with 95 % intervals")
    for task, name in trials[0]:
        own = [each[task, name] for each in trials]
        hits = np.concatenate([o.success for o in own])
        low, high = binomtest(int(hits.sum()), len(hits)).proportion_ci(method="wilson")
        columns = (
            interval(np.concatenate([getattr(o, f) for o in own]))
            for f in ("error", "elbow", "effort")
        )
        share = f"{hits.mean():.2f} ({low:.2f} to {high:.2f})"
        table.add_row(task, name, share, *columns)
    console.print(table)


if __name__ == "__main__":
    call(main)
