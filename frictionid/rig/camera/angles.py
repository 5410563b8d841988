"""Joint angles of tracked markers, with their standard deviations, and as a table."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import Array, huber_cost
from frictionid.data.readers.csv_table import csv_text
from frictionid.data.readers.formats.markers import link_lengths, mirror
from frictionid.errors import InputError

from .follow import Markers, unwrapped_direction
from .marker_setup import Camera, MarkerSetup

_MAX_FRAMES = 600
# Prior standard deviations of stretch, slant and bulge, and of a given pivot [px].
_PLANE_SIGMA = np.array([0.01, 0.01, 0.05, 0.05, 0.05])
_PIVOT_SIGMA = 3.0
_FLOOR = 0.05  # [px], added to the noise
# Neighbouring frames err alike: no more than so many residuals count as independent.
_INDEPENDENT = 200
_HUBER = 2.0  # standard deviations from which on the cost grows linearly
_RATIO = 0.1  # by which the links' lengths may contradict the picture


def flattened(points: Array, size: tuple[int, int], shape: tuple[float, ...]) -> Array:
    """Points (..., 2) [px] as a camera without tilt and lens distortion would see them [px].

    With p from the picture's middle in half diagonals, p <- p (1 + bulge |p|^2), then
    p <- p / (1 + slant p), then p <- p + [[a, b], [b, -a]] p; see `ViewCalibration`.

    >>> flattened(np.array([[10.0, 20.0]]), (640, 480), (0.0, 0.0, 0.0, 0.0, 0.0))
    array([[10., 20.]])
    """
    stretch, diagonal, right, down, bulge = shape
    middle = (np.array(size, float) - 1) / 2
    half = np.linalg.norm(middle)
    p = (np.asarray(points, float) - middle) / half
    p = p * (1.0 + bulge * (p**2).sum(-1, keepdims=True))
    p = p / (1.0 + p @ np.array([right, down]))[..., None]
    p = p + p @ np.array([[stretch, diagonal], [diagonal, -stretch]])
    return middle + half * p


class ViewCalibration(NamedTuple):
    """View of a camera onto the plane of motion.

    Attributes
    ----------
    size : width and height of the picture [px]
    shape : stretch along x against y and along the diagonal, slant to the right and downwards
        (perspective), bulge (lens distortion); relative to the half diagonal, about the middle
    pivot : array, shape (2,) [px], corrected; None where the pivot is a dot
    lengths : array, shape (n,) [px], of the links in the plane
    residual : array, shape (T, n) [px], measured minus estimated length, nan where an end is hidden
    """

    size: tuple[int, int]
    shape: tuple[float, ...]
    pivot: Array | None
    lengths: Array
    residual: Array


def calibrate_view(
    markers: Array,
    sigma: Array,
    seen: Array,
    size: tuple[int, int],
    *,
    fixed: bool,
    view: bool = True,
    lengths: Array | None = None,
) -> ViewCalibration:
    """View in which links keep their lengths: robust least squares with priors on the plane.

    The unknowns are x = (shape of the plane (5), shift of the pivot (2), lengths of the links).

    Parameters
    ----------
    markers : array, shape (T, n + 1, 2) [px]
    sigma : array, shape (T, n + 1) [px]
    seen : array of bool, shape (T, n + 1)
    size : width and height of the picture [px]
    fixed : bool
        Whether the first marker is one given place, which is then corrected.
    view : bool
        False corrects the pivot only, not tilt and lens.
    lengths : array, shape (n,), optional
        Of the links, in any unit: only their ratio counts.
    """
    n = markers.shape[1] - 1
    both = seen[:, 1:] & seen[:, :-1]
    rows = np.flatnonzero(both.any(axis=1))
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), _MAX_FRAMES)).astype(int)]
    use = both[rows]
    noise = np.hypot(link_noise(sigma[rows]), _FLOOR)
    weight = np.sqrt(min(1.0, _INDEPENDENT / max(int(use.sum()), 1)))
    # a single link draws a circle, which looks like one under many perspectives and lenses
    free = np.array([1.0, 1.0, n > 1, n > 1, n > 1]) * view
    # from the last unknowns to the lengths of the links
    ratio = np.eye(n) if lengths is None else np.asarray(lengths)[:, None] / lengths[0]

    def shape(x: Array) -> tuple[float, ...]:
        return tuple(x[:5] * free)

    def shift(x: Array) -> Array:
        return x[5:7] * fixed

    def lengths_of(x: Array) -> Array:
        return (ratio * x[7:]).sum(axis=1)

    def longer(x: Array, markers: Array) -> Array:  # measured minus estimated lengths (T, n) [px]
        moved = markers.copy()
        moved[:, 0] += shift(x)
        return link_lengths(flattened(moved, size, shape(x))) - lengths_of(x)

    def residual(x: Array) -> Array:
        off = _huber(longer(x, markers[rows]) / noise)
        return np.concatenate([weight * off[use], x[:5] / _PLANE_SIGMA, x[5:7] / _PIVOT_SIGMA])

    measured = link_lengths(markers[rows])
    start = np.array([np.median(link[u]) for link, u in zip(measured.T, use.T, strict=True)])
    first = start if lengths is None else np.array([np.mean(start / ratio[:, 0])])
    scale = np.concatenate([_PLANE_SIGMA, [1.0, 1.0], np.ones(len(first))])
    x = least_squares(residual, np.concatenate([np.zeros(7), first]), x_scale=scale).x
    pivot = markers[0, 0] + shift(x) if fixed else None
    off = np.where(both, longer(x, markers), np.nan)
    return ViewCalibration(size, shape(x), pivot, lengths_of(x), off)


def link_noise(sigma: Array) -> Array:
    """Standard deviations (T, n) of links between markers with deviations (T, n + 1); nan is 0."""
    sigma = np.nan_to_num(sigma)
    return np.sqrt(sigma[:, 1:] ** 2 + sigma[:, :-1] ** 2)


def _huber(x: Array) -> Array:
    """Residuals whose squares are Huber's cost, so that wrong dots do not bend the view."""
    return np.sign(x) * np.sqrt(huber_cost(np.abs(x), _HUBER))


def length_contradiction(markers: Array, seen: Array, lengths: Array) -> tuple[Array, Array] | None:
    """Ratios of the links' lengths as measured and as given where they contradict, else None.

    >>> chain = np.array([[[0.0, 0.0], [0.0, 10.0], [0.0, 30.0]]])
    >>> length_contradiction(chain, np.ones((1, 3), bool), np.array([0.1, 0.2])) is None
    True
    """
    both = seen[:, 1:] & seen[:, :-1]
    pairs = zip(link_lengths(markers).T, both.T, strict=True)
    median = np.array([np.median(link[use]) if use.any() else np.nan for link, use in pairs])
    measured, stated = median / median[0], np.asarray(lengths) / lengths[0]
    return (measured, stated) if (np.abs(measured / stated - 1) > _RATIO).any() else None


FOUND, PREDICTED, LOST = "found", "predicted", "lost"
_OUTLIER, _PIXELS = 6.0, 1.0  # standard deviations and [px] by which a link may seem too long
_AHEAD = 0.1  # [s] for which a prediction is given
_MIN_FRAMES = 10  # with all dots


class Angles(NamedTuple):
    """Joint angles of all frames.

    Attributes
    ----------
    time : array, shape (T,) [s], middles of the exposures
    q : array, shape (T, n) [rad], nan where not found
    sigma : array, shape (T, n) [rad], standard deviations
    predicted : array, shape (T, n) [rad]
    state : T words: "found", "predicted" (a dot is hidden) or "lost" (for longer)
    markers : array, shape (T, n + 1, 2) [px], nan where not found
    calibration : ViewCalibration
    sync_led : column name and brightness (T,), 0 to 1, of a sync LED in every frame, or None
    """

    time: Array
    q: Array
    sigma: Array
    predicted: Array
    state: tuple[str, ...]
    markers: Array
    calibration: ViewCalibration
    sync_led: tuple[str, Array] | None = None


def angles_of(tracks: Markers, setup: MarkerSetup, size: tuple[int, int], name: str) -> Angles:
    """Angles of markers that were tracked through pictures of a size (width, height) [px].

    Raises
    ------
    InputError
        Where dots were hardly ever found, or the links' lengths contradict the picture of the
        video `name`.
    """
    pivot = setup.markers[0]
    seen = tracks.seen.copy()
    markers = tracks.at.copy()
    rests = pivot.at is None and not pivot.moves  # one place that counts in all frames
    if rests:
        seen[:, 0] = seen[:, 0].any()
    _check_seen(seen, setup, name)
    lengths = None if setup.links.lengths is None else np.array(setup.links.lengths)
    if lengths is not None and (off := length_contradiction(markers, seen, lengths)):
        raise InputError(
            f"{name}: links have the ratio {_ratio(off[0])} in the picture and {_ratio(off[1])} by "
            "links.lengths; correct the lengths or the order of the markers"
        )
    if rests:
        markers[:, 0] = np.median(markers[seen[:, 0], 0], axis=0)
    calibration = calibrate_view(
        *(markers, tracks.sigma, seen, size),
        fixed=pivot.at is not None,
        view=setup.camera.calibrate,
        lengths=lengths,
    )
    if calibration.pivot is not None:
        markers[:, 0] = calibration.pivot
    # a link that seems too long or too short ends in a wrong dot
    limit = np.maximum(_OUTLIER * link_noise(tracks.sigma), _PIXELS)
    seen[:, 1:] &= np.abs(np.nan_to_num(calibration.residual)) <= limit
    return _angles(tracks, setup.camera, markers, seen, calibration)


def _angles(
    tracks: Markers, camera: Camera, markers: Array, seen: Array, calibration: ViewCalibration
) -> Angles:
    """Angles of links between markers in the plane of motion.

    Whole turns are those of the tracker's prediction, which counts how often a link went round,
    and across short gaps those of `joined_turns`, which knows both sides.
    """
    flat = flattened(markers, calibration.size, calibration.shape)
    link = np.diff(mirror(flat) if camera.mirrored else flat, axis=1)
    both = seen[:, 1:] & seen[:, :-1]
    guide = -tracks.theta if camera.mirrored else tracks.theta
    theta = np.where(both, unwrapped_direction(link, guide), guide) - np.radians(camera.down)
    theta = joined_turns(tracks.time, theta, both)
    q = np.diff(theta, axis=1, prepend=0.0)
    complete = both & np.concatenate([np.ones_like(both[:, :1]), both[:, :-1]], axis=1)
    sigma = np.where(complete, _deviation(link, np.nan_to_num(tracks.sigma)), np.nan)
    late = {"start": 0.5, "middle": 0.0, "end": -0.5}[camera.stamp] * camera.exposure
    return Angles(
        time=tracks.time + late,
        q=np.where(complete, q, np.nan),
        sigma=sigma,
        predicted=q,
        state=_states(tracks.time, complete.all(axis=1)),
        markers=np.where(seen[..., None], markers, np.nan),
        calibration=calibration,
    )


def joined_turns(time: Array, theta: Array, tracked: Array) -> Array:
    """Directions (T, n) [rad] with the whole turns across gaps that the speeds beside them ask for.

    A prediction with an acceleration goes astray within frames of fast motion. Gaps are of at most
    0.1 s; speeds are those of the last two frames before, and of the first two behind, if any.

    tracked : (T, n) of bool

    >>> time, tracked = np.arange(6.0) / 60, np.array([1, 1, 0, 0, 1, 1], dtype=bool)[:, None]
    >>> astray = 30.0 * time[:, None] - 2 * np.pi * (time[:, None] > 0.05)
    >>> joined_turns(time, astray, tracked).ravel()[[0, 1, 4, 5]].round(2)
    array([0. , 0.5, 2. , 2.5])
    """
    out = theta.copy()
    for j, column in enumerate(tracked.T):
        frames = np.flatnonzero(column)
        wide = (np.diff(frames) > 1) & (np.diff(time[frames]) <= _AHEAD)
        for a, b in zip(frames[:-1][wide], frames[1:][wide], strict=True):
            pairs = [(k, k + 1) for k in (a - 1, b) if k >= 0 and column[k : k + 2].sum() == 2]
            if not pairs:
                continue
            speed = np.mean([(theta[n, j] - theta[k, j]) / (time[n] - time[k]) for k, n in pairs])
            expected = out[a, j] + speed * (time[b] - time[a])
            out[b:, j] += 2 * np.pi * np.round((expected - out[b, j]) / (2 * np.pi))
    return out


def _deviation(link: Array, sigma: Array) -> Array:
    """Standard deviations (T, n) [rad] of joint angles, by the derivatives dq/d(marker).

    A marker moved by dx across a link of length l turns it by dx / l.
    """
    T, n = link.shape[:2]
    length = np.linalg.norm(link, axis=-1)
    across = (
        np.stack([link[..., 1], -link[..., 0]], axis=-1) / np.maximum(length, 1e-9)[..., None] ** 2
    )
    turn = np.zeros((T, n, n + 1, 2))  # of the links by the markers
    for i in range(n):
        turn[:, i, i], turn[:, i, i + 1] = -across[:, i], across[:, i]
    slope = np.diff(turn, axis=1, prepend=0.0)  # of the joint angles
    return np.sqrt(((slope * sigma[:, None, :, None]) ** 2).sum(axis=(2, 3)))


def _check_seen(seen: Array, setup: MarkerSetup, name: str) -> None:
    for i, marker in enumerate(setup.markers):
        if not seen[:, i].any():
            raise InputError(
                f"{name}: the dot of {marker.name!r} (hue {marker.hue:g} deg) is in no frame, or "
                "never as far from its neighbour as its link is long; correct rig.toml or let "
                "frictionid track --setup propose one"
            )
    whole = int(seen.all(axis=1).sum())
    if whole < min(_MIN_FRAMES, len(seen)):
        raise InputError(
            f"{name}: all dots are seen together in {whole} of {len(seen)} frames only; correct "
            "colours, radii and places in rig.toml or let frictionid track --setup propose one"
        )


def _states(time: Array, complete: Array) -> tuple[str, ...]:
    states, last = [], -np.inf
    for t, there in zip(time, complete, strict=True):
        last = t if there else last
        states.append(FOUND if there else PREDICTED if t - last <= _AHEAD else LOST)
    return tuple(states)


def angles_csv(angles: Angles) -> str:
    """CSV text with the columns time, q1.., sigma1.., predicted1.., state and that of a sync LED.

    Angles are empty unless found.
    """
    hidden = np.array(angles.state) == PREDICTED
    predicted = np.where(hidden[:, None], angles.predicted, np.nan)
    columns = {"time": _cells(angles.time, 6)}
    for label, values, digits in (
        ("q", angles.q, 7),
        ("sigma", angles.sigma, 7),
        ("predicted", predicted, 4),
    ):
        columns |= {f"{label}{j}": _cells(v, digits) for j, v in enumerate(values.T, start=1)}
    columns["state"] = list(angles.state)
    if angles.sync_led is not None:
        name, brightness = angles.sync_led
        columns[name] = _cells(brightness, 5)
    return csv_text(columns)


def _cells(values: Array, digits: int) -> list[str]:
    return [f"{v:.{digits}f}" if np.isfinite(v) else "" for v in values]


def _ratio(lengths: Array) -> str:
    return " : ".join(f"{v:.3g}" for v in lengths)
