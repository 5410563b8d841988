"""Result folders made by hand: numbers that a report must show, without fitting anything."""

import numpy as np

from frictionid.store import write_json

HORIZONS = (0.1, 0.5, 1.0)
FOLDS = 4
UNITS = {"one_step_euler": "rad/s", "one_step_integral": "rad/s", "curve_error": "1"}


def about(joints=2, truth=True, tests=None):
    """Entry of datasets.json; the true curve is 0.1 sgn(w) + 0.01 w."""
    velocity = np.linspace(-4.0, 4.0, 41)[:, None] * np.arange(1, joints + 1)
    return {
        "joints": [f"joint {j + 1}" for j in range(joints)],
        "torque_unit": "N m",
        "angle_unit": "rad",
        "recordings": 5,
        "samples": 1000,
        "seconds": 20.0,
        "tests": tests,
        "velocity": velocity,
        "truth": 0.1 * np.sign(velocity) + 0.01 * velocity if truth else None,
        "density": np.ones((joints, 60), dtype=int),
    }


def rows(loss, rollout, *, curve=None, joints=2, horizons=HORIZONS, folds=FOLDS, noise=None):
    """Rows of scores; to those of fold f noise[f] is added, and curve errors may be left out."""
    noise = np.zeros(folds) if noise is None else np.asarray(noise, dtype=float)
    out = []
    for score in ("one_step_euler", "one_step_integral"):
        for statistic in ("mean", "rms", "median", "q90"):
            each = [(str(f), loss + noise[f]) for f in range(folds)] + [("all", loss)]
            out += [[f, score, statistic, None, "all", v, "rad/s"] for f, v in each]
    for h in horizons:
        each = [(str(f), rollout * h + noise[f]) for f in range(folds)] + [("all", rollout * h)]
        for f, v in each:
            out.append([f, "rollout_angle", "median", h, "all", v, "rad"])
            out.append([f, "rollout_angle", "q90", h, "all", 2 * v, "rad"])
            out.append([f, "rollout_angle", "diverged", h, "all", float(2 * v > 1), "1"])
    if curve is not None:
        for f in (*map(str, range(folds)), "all"):
            for j in range(joints):
                out.append([f, "curve_error", "rms", None, str(j + 1), curve, "1"])
    out.append(["all", "n_parameters", "count", None, "all", 2.0 * joints, "1"])
    return out


def task(
    identifier,
    scored,
    *,
    dataset="made",
    fit="integral",
    seed=0,
    role="fitted",
    joints=2,
    motions=True,
    spread=0.01,
    refined=None,
):
    """Document of a task: `scored` maps data sets to rows; `role` as the report sees it."""
    rng = np.random.default_rng([len(identifier), seed, len(fit)])
    size = 0 if role == "none" else 2
    theta = np.full((joints, size), 0.1)
    folds = np.repeat(theta[None], FOLDS, axis=0)
    if role == "fitted":
        folds = folds * (1 + spread * rng.standard_normal(folds.shape))
    velocity = about(joints)["velocity"]
    lines = np.repeat((0.1 * np.sign(velocity))[None], FOLDS + 1, axis=0)
    lines = lines * (1 + 0.01 * rng.standard_normal((FOLDS + 1, 1, 1)))
    words = [
        {"coulomb": {"value": 0.1, "unit": "N m"}, "viscous": {"value": 0.1, "unit": "N m s/rad"}}
        for _ in range(joints if size else 0)
    ] or [{} for _ in range(joints)]
    return {
        "digest": "",
        "dataset": dataset,
        "identifier": identifier,
        "fit": fit,
        "seed": seed,
        "settings": {"identifier": f"{role.title()}()", "recipe": f"Recipe(name={fit!r})"},
        "rows": scored,
        "model": {
            "format": "frictionid model 1",
            "law": {"kind": "coulomb_viscous"},
            "joints": words,
            "theta": theta,
            "shape": list(theta.shape),
            "parameters": {},
            "provenance": {"source": "truth"} if role == "truth" else {},
        },
        "folds": {"theta": folds, "shape": list(folds.shape)},
        "curves": lines,
        "motions": [_motion(name, s, joints) for name in scored for s in (0.5, 2.0)]
        if motions
        else [],
        "seconds": {"fit": 0.1},
        **({} if refined is None else {"refined": refined}),
    }


def parameter(block, name, value, error, *, joint=None, unit="N m", **changes):
    """A parameter of a document of shooting, identified where its error is below half its value."""
    reach = 2.0 * error
    return {
        "block": block,
        "name": name if joint is None else f"{name} of joint {joint + 1}",
        "unit": unit,
        "joint": joint,
        "value": value,
        "error": error,
        "interval_90": [value - 0.8 * reach, value + 0.8 * reach],
        "interval_95": [value - reach, value + reach],
        "at_bound": False,
        "identified": bool(reach <= abs(value)),
        **changes,
    }


def shot(parameters, *, joints=2, correlation=None, **changes):
    """What a task's document says of a fit by shooting; the bands stand on the curves' grid."""
    D, w = len(parameters), about(joints)["velocity"]
    return {
        "parameters": parameters,
        "correlation": np.eye(D) if correlation is None else correlation,
        "freedom": 24,
        "clusters": 5,
        "singular_values": np.linspace(2.0, 0.1, D),
        "undetermined": [],
        "bands": {"level": 0.95, "pointwise": 0.01 + 0 * w, "simultaneous": 0.02 + 0 * w},
        "angle_noise": [0.001] * joints,
        "windows": 50,
        "left_out": [],
        "unexplained": [],
        "settled": True,
        "iterations": 9,
        **changes,
    }


def _motion(dataset, start, joints):
    time = np.linspace(0.0, 1.0, 11)
    measured = np.sin(time[:, None] * np.arange(1, joints + 1))
    return {
        "dataset": dataset,
        "recording": "folder/run_01",
        "start_s": start,
        "friction_of": "fold",
        "time": time,
        "measured": measured,
        "predicted": 1.1 * measured,
    }


def write(folder, tasks, datasets=None, **changes):
    """A result folder with these tasks; `changes` go into provenance.json."""
    datasets = datasets or {name: about() for t in tasks for name in t["rows"]}
    names = [f"task{i:02d}.json" for i in range(len(tasks))]
    for name, document in zip(names, tasks, strict=True):
        write_json(folder / "tasks" / name, document)
    write_json(folder / "datasets.json", datasets)
    provenance = {
        "suite": "made",
        "title": "Made by hand",
        "settings": {"every": 0.25, "folds": {"count": FOLDS, "kind": "recordings"}},
        "tasks": names,
        "versions": {"frictionid": "0"},
        "data": {name: {"a.csv": "00"} for name in datasets},
        "origin": {name: {"licence": "MIT"} for name in datasets},
        "folds": {name: "ff" for name in datasets},
    }
    write_json(folder / "provenance.json", provenance | changes)
    return folder


def typical(folder, **changes):
    """Two recipes, a fitted and a given model, no friction, the truth, and data that only test."""
    wobble = [0.01, -0.01, 0.02, -0.02]
    parts = [
        task("none", _both(0.6, 0.9, 1.0, wobble), role="none", fit=fit)
        for fit in ("study", "integral")
    ]
    parts += [
        task("stribeck", _both(0.3, 0.4, 0.2, wobble), fit="study"),
        task("stribeck", _both(0.4, 0.1, 0.05, wobble), fit="integral"),
        task("paper", _both(0.45, 0.3, 0.3, wobble), role="given"),
        task("truth", _both(0.35, 0.08, 0.0, wobble), role="truth"),
    ]
    datasets = {"made": about(), "other": about(truth=False, tests="made")}
    return write(folder, parts, datasets, **changes)


def _both(loss, rollout, curve, noise):
    return {
        "made": rows(loss, rollout, curve=curve, noise=noise),
        "other": [row for row in rows(loss, rollout) if row[0] == "all"],
    }
