"""The observer as C99, beside its friction; the controller gives M and dL/dq."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.formats import c
from frictionid.errors import InputError
from frictionid.files import write_bytes
from frictionid.outputs import check_outputs

from .watch import Watch

_HEADER = """
/* After each sample call observer_filter with the angles, the mean logged torque since
 * the last sample and its length; with its q and w compute the inertia M(q) and dLdq (the torque
 * of gravity and velocities, C(q,w)' w - g(q)), then observer_update. It gives the external torque
 * of each joint, and half the width of its band; beyond it, something touches. The first
 * call is with dt = 0. What the model's parameters may be off by is a constant of the band. */
typedef struct {{
    double angle[{n}], first[{m}], second[{m}], momentum[{n}], force[{n}];
    double stick[{n}], w[{n}], slower[{m}], torque[{m}];
    int started;
}} observer;
void observer_filter(observer *s, const double angle[{n}], const double torque[{n}], double dt,
                     double q[{n}], double w[{n}]);
void observer_update(observer *s, const double M[{n}][{n}], const double dLdq[{n}], double dt,
                     double torque[{n}], double band[{n}]);
"""
_SOURCE = """
static const double rate = {rate}, quick = {quick}, slow[{n}] = {slow}, level[{n}] = {level};
static const double gain[{n}] = {gain}, bias[{n}] = {bias}, offset[{n}] = {offset};
static const double noise[{n}] = {noise}, shake[{n}] = {shake};
static const double spread[{n}] = {spread}, factor[{n}] = {factor};

static void filtered(double *x, double *y, double a, double b, double rate, double dt)
{{
    const double step = rate * dt, decay = exp(-step), lag = dt > 0 ? (b - a) / step : 0;
    const double off = *x - a + lag;
    *y = b - 2 * lag + decay * (*y - a + 2 * lag + step * off);
    *x = b - lag + decay * off;
}}

void observer_filter(observer *s, const double angle[{n}], const double torque[{n}], double dt,
                     double q[{n}], double w[{n}])
{{
    for (int i = 0; i < {m}; i++) {{
        const int j = i % {n};
        const double b = i >= {n} ? torque[j] : angle[j];
        const double a = i >= {n} || !s->started ? b : s->angle[j];
        if (!s->started)
            s->first[i] = s->second[i] = b;
        filtered(&s->first[i], &s->second[i], a, b, quick, dt);
    }}
    for (int j = 0; j < {n}; j++) {{
        s->angle[j] = angle[j];
        q[j] = s->second[j] - offset[j];
        w[j] = quick * (s->first[j] - s->second[j]);
    }}
}}

void observer_update(observer *s, const double M[{n}][{n}], const double dLdq[{n}], double dt,
                     double torque[{n}], double band[{n}])
{{
    double q[{n}], w[{n}], u[{n}], Tf[{n}];
    for (int j = 0; j < {n}; j++) {{
        const double rise = quick * (s->first[{n} + j] - s->second[{n} + j]);
        q[j] = s->second[j] - offset[j];
        w[j] = quick * (s->first[j] - s->second[j]);
        u[j] = gain[j] * (s->second[{n} + j] - {delay} * rise) + bias[j];
    }}
    (void)q;
    {call};
    for (int j = 0; j < {n}; j++) {{
        const double force = dLdq[j] + u[j] - Tf[j], step = dt > 1e-9 ? dt : 1e-9;
        const double change = s->started ? fabs(w[j] - s->w[j]) : 0;
        const double ratio = w[j] / (slow[j] + change / (quick * step));
        const double stick = level[j] * exp(-ratio * ratio);
        double p = 0, variance = noise[j] * noise[j] + spread[j] * spread[j];
        for (int k = 0; k < {n}; k++) {{
            p += M[j][k] * w[k];
            variance += M[j][k] * M[j][k] * shake[k] * shake[k];
        }}
        if (s->started) {{
            const double left = (p - s->momentum[j]) / step - (s->force[j] + force) / 2;
            const double rest = (s->stick[j] + stick) / 2;
            filtered(&s->slower[j], &s->torque[j], left, left, rate, dt);
            filtered(&s->slower[{n} + j], &s->torque[{n} + j], rest, rest, rate, dt);
        }}
        s->momentum[j] = p;
        s->force[j] = force;
        s->stick[j] = stick;
        s->w[j] = w[j];
        torque[j] = s->torque[j];
        band[j] = factor[j] * sqrt(variance + s->torque[{n} + j] * s->torque[{n} + j]);
    }}
    s->started = 1;
}}
"""


def write_code(watch: Watch, out: Path, read: Sequence[Path], *, replace: bool) -> tuple[Path, ...]:
    """Write a C source and its header; their paths.

    Raises
    ------
    InputError
        For laws with memory or loads, and parts that turn with several joints.
    """
    source, mechanism = watch.momentum_observer, watch.dataset.mechanism
    friction = source.friction
    if friction.law.has_memory or friction.law.uses_load or mechanism.coupled:
        raise InputError(
            "watch: code is for static laws of each joint without loads: fit another law, or run "
            "frictionid watch"
        )
    paths = out.with_suffix(".c"), out.with_suffix(".h")
    check_outputs(paths, read, replace=replace)
    model = exported(friction, mechanism.joints)
    settings = ExportSettings(stem=out.stem)
    written = c.write(model, settings).files
    n, members = mechanism.n, source.members
    arguments = [*ex.functions(model)[0].arguments, "Tf"]
    numbers = {
        "n": n,
        "m": 2 * n,
        "rate": repr(source.rate),
        "quick": repr(source.quick),
        "delay": repr(float(members.delay[0])),
        "call": f"friction_torque({', '.join(arguments)})",
        **{name: _array(getattr(members, name)[0]) for name in ("gain", "bias", "offset")},
        **{name: _array(getattr(source, name)) for name in ("slow", "level")},
        **{
            name: _array(getattr(watch.band, name))
            for name in ("noise", "shake", "spread", "factor")
        },
    }
    motors = mechanism.motors
    numbers["gain"], numbers["bias"] = (
        _array(values * motors) for values in (members.gain[0], members.bias[0])
    )
    header = (
        written[".h"]
        .decode()
        .replace("#ifdef __cplusplus\n}", _HEADER.format(**numbers) + "\n#ifdef __cplusplus\n}")
    )
    write_bytes(paths[0], (written[".c"].decode() + _SOURCE.format(**numbers)).encode())
    write_bytes(paths[1], header.encode())
    return paths


def _array(values: Array) -> str:
    return "{" + ", ".join(repr(float(v)) for v in np.ravel(values)) + "}"
