"""Joint angles of followed markers, with their standard deviations, and as a table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.acquire.camera.calibrate import Calibration, calibrate, contradiction
from frictionid.acquire.camera.follow import Followed
from frictionid.acquire.camera.marks import Marks
from frictionid.arrays import Array
from frictionid.data.marker_geometry import flattened, mirror
from frictionid.errors import InputError

FOUND, PREDICTED, LOST = "found", "predicted", "lost"
_STRETCHED = 6.0  # deviations, and pixels, by which a link may seem longer than it is
_PIXELS = 1.0
_AHEAD = 0.1  # [s] for which a prediction is worth giving
_FEWEST = 10  # frames with all dots


class Angles(NamedTuple):
    """Joint angles of each frame.

    time : (T,), middle of the exposure [s]; q : (T, n) [rad], nan where not found
    sigma : (T, n) [rad]; predicted : (T, n) [rad], where the chain was thought to be
    state : (T,), "found", "predicted" (a dot is hidden) or "lost" (for longer)
    markers : (T, n + 1, 2) [px], nan where not found; calibration : Calibration
    lamp : name and brightness (T,) of a lamp, from 0 to 1, in every frame
    """

    time: Array
    q: Array
    sigma: Array
    predicted: Array
    state: tuple[str, ...]
    markers: Array
    calibration: Calibration
    lamp: tuple[str, Array] | None = None


def angles_of(followed: Followed, marks: Marks, size: tuple[int, int], name: str) -> Angles:
    """Angles of markers that were followed through pictures of a size (width, height) [px].

    Raises
    ------
    InputError
        Where dots were hardly ever seen, or links contradict the picture; `name` names the video.
    """
    found = _steady(followed, marks)
    _check_seen(found, marks, name)
    lengths = marks.links.lengths
    if lengths is not None and (off := contradiction(followed.at, found, np.array(lengths))):
        raise InputError(
            f"{name}: links have the ratio {_ratio(off[0])} in the picture and {_ratio(off[1])} by "
            "links.lengths; correct the lengths or the order of the markers"
        )
    fixed = marks.markers[0].at is not None
    markers = followed.at.copy()
    if not fixed and not marks.markers[0].moves:
        markers[:, 0] = np.median(markers[found[:, 0], 0], axis=0)
    calibration = calibrate(
        *(markers, followed.sigma, found, size),
        fixed=fixed,
        view=marks.camera.calibrate,
        lengths=None if lengths is None else np.array(lengths),
    )
    if calibration.pivot is not None:
        markers[:, 0] = calibration.pivot
    found = found & _sound(calibration, followed)
    flat = flattened(markers, calibration.plane)
    return _angles(followed, marks, flat, markers, found, calibration)


def _angles(
    followed: Followed,
    marks: Marks,
    flat: Array,
    markers: Array,
    found: Array,
    calibration: Calibration,
) -> Angles:
    camera = marks.camera
    turned = np.radians(camera.down)
    link = np.diff(mirror(flat) if camera.mirrored else flat, axis=1)
    seen = np.arctan2(link[..., 0], link[..., 1])
    both = found[:, 1:] & found[:, :-1]
    guide = -followed.theta if camera.mirrored else followed.theta
    # the turn is that of the prediction, which knows how often the link has gone round
    theta = guide + (seen - guide + np.pi) % (2 * np.pi) - np.pi
    theta = np.where(both, theta, guide) - turned
    q = np.diff(theta, axis=1, prepend=0.0)
    known = both & np.concatenate([np.ones_like(both[:, :1]), both[:, :-1]], axis=1)
    sigma = np.where(known, _deviation(link, np.nan_to_num(followed.sigma)), np.nan)
    late = {"start": 0.5, "middle": 0.0, "end": -0.5}[camera.stamp] * camera.exposure
    return Angles(
        followed.time + late,
        np.where(known, q, np.nan),
        sigma,
        q,
        _states(followed.time, known.all(axis=1)),
        np.where(found[..., None], markers, np.nan),
        calibration,
    )


def _deviation(link: Array, sigma: Array) -> Array:
    """Standard deviations (T, n) [rad] of joint angles: each marker turns the links beside it."""
    T, n = link.shape[:2]
    length = np.linalg.norm(link, axis=-1)
    across = (
        np.stack([link[..., 1], -link[..., 0]], axis=-1) / np.maximum(length, 1e-9)[..., None] ** 2
    )
    slope = np.zeros((T, n, n + 1, 2))  # of the joint angles by the markers
    for i in range(n):
        slope[:, i, i + 1] += across[:, i]
        slope[:, i, i] -= across[:, i]
        if i:
            slope[:, i, i] -= across[:, i - 1]
            slope[:, i, i - 1] += across[:, i - 1]
    return np.asarray(np.sqrt(((slope * sigma[:, None, :, None]) ** 2).sum(axis=(2, 3))))


def _steady(followed: Followed, marks: Marks) -> Array:
    """Which markers (T, n + 1) count: a pivot that stays where it is always does."""
    found = followed.found.copy()
    if marks.markers[0].at is None and not marks.markers[0].moves:
        found[:, 0] = found[:, 0].any()
    return found


def _check_seen(found: Array, marks: Marks, name: str) -> None:
    for i, marker in enumerate(marks.markers):
        if not found[:, i].any():
            raise InputError(
                f"{name}: the dot of {marker.name!r} (hue {marker.hue:g} deg) is in no frame, or "
                "never as far from its neighbour as its link is long; correct rig.toml or let "
                "frictionid track --setup propose one"
            )
    seen = int(found.all(axis=1).sum())
    if seen < min(_FEWEST, len(found)):
        raise InputError(
            f"{name}: all dots are seen together in {seen} of {len(found)} frames only; correct "
            "colours, radii and places in rig.toml or let frictionid track --setup propose one"
        )


def _sound(calibration: Calibration, followed: Followed) -> Array:
    """Which markers (T, n + 1) do not make the link before them seem too long or too short."""
    noise = np.sqrt(
        np.nan_to_num(followed.sigma[:, 1:]) ** 2 + np.nan_to_num(followed.sigma[:, :-1]) ** 2
    )
    limit = np.maximum(_STRETCHED * noise, _PIXELS)
    far = np.abs(np.nan_to_num(calibration.residual)) > limit
    return np.concatenate([np.ones((len(far), 1), dtype=bool), ~far], axis=1)


def _states(time: Array, known: Array) -> tuple[str, ...]:
    states, last = [], -np.inf
    for t, there in zip(time, known, strict=True):
        last = t if there else last
        states.append(FOUND if there else PREDICTED if t - last <= _AHEAD else LOST)
    return tuple(states)


def table_of(angles: Angles) -> str:
    """CSV text: time, q1.., sigma1.., predicted1.., state, lamp; angles are empty unless found."""
    n = angles.q.shape[1]
    joints = range(1, n + 1)
    names = ["time", *(f"{what}{j}" for what in ("q", "sigma", "predicted") for j in joints)]
    lamp, bright = angles.lamp or ("", angles.time)
    lines = [",".join([*names, "state", *([lamp] if lamp else [])])]
    for k, state in enumerate(angles.state):
        there = [_cell(v, 7) for v in angles.q[k]] + [_cell(v, 7) for v in angles.sigma[k]]
        ahead = [_cell(v, 4) if state == PREDICTED else "" for v in angles.predicted[k]]
        last = [_cell(bright[k], 5)] if lamp else []
        lines.append(",".join([f"{angles.time[k]:.6f}", *there, *ahead, state, *last]))
    return "\n".join(lines) + "\n"


def _cell(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else ""


def _ratio(lengths: Array) -> str:
    return " : ".join(f"{v:.3g}" for v in lengths)
