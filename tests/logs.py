"""Small files of the formats that have readers of their own: what their tests read and damage."""

import io
import json

import numpy as np
import scipy.io

MOTOR = {"kt": 0.4, "R": 4.0}


def bam_log(samples=60, seed=0, passive=20, **changes):
    """A log of bam as a dict: driven first, without torque for the last `passive` entries."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(4e-3, 6e-3, samples))
    angle = np.sin(3 * time) + 0.1 * rng.normal()
    entries = [
        {
            "position": float(q),
            "speed": 0.0,
            "load": int(rng.integers(0, 65536)),
            "input_volts": 7.4,
            "temp": 30,
            "timestamp": float(t),
            "goal_position": float(np.cos(5 * t)),
            "torque_enable": k < samples - passive,
        }
        for k, (t, q) in enumerate(zip(time, angle, strict=True))
    ]
    log = {"mass": 0.49, "length": 0.1, "kp": 400, "vin": 7.4, "entries": entries}
    return {**log, **changes}


def bam_bytes(**changes):
    return json.dumps(bam_log(**changes)).encode()


def column(log, name):
    return np.array([entry[name] for entry in log["entries"]], dtype=float)


def mat_bytes(variables, do_compression=False):
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables, do_compression=do_compression)
    return stream.getvalue()


def emps_variables(samples=50, **changes):
    time = np.arange(samples)[:, None] * 1e-3
    variables = {"t": time, "qm": 0.1 * time, "qg": 0.2 * time, "vir": np.cos(time), "gtau": 35.0}
    return {**variables, **changes}


def marker_csv(samples=40):
    """CSV with a header: time and three markers, y before x."""
    time = np.arange(samples) * 0.01
    first, second = 0.5 * np.sin(time), 1.0 + time
    x = [300.0 + 0 * time, 300 + 100 * np.sin(first)]
    y = [200.0 + 0 * time, 200 + 100 * np.cos(first)]
    x.append(x[1] + 80 * np.sin(second))
    y.append(y[1] + 80 * np.cos(second))
    lines = ["t,y0,x0,y1,x1,y2,x2"]
    for row in zip(time, y[0], x[0], y[1], x[1], y[2], x[2], strict=True):
        lines.append(",".join(f"{value:.9f}" for value in row))
    return "\n".join(lines).encode(), np.stack([first, second - first], axis=1)


MARKERS = {"time": "t", "x": ["x0", "x1", "x2"], "y": ["y0", "y1", "y2"]}
