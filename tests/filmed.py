"""Simulated films of an acrobot, and the angles that a tracker should find in them."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from frictionid.acquire.camera.angles import angles_of
from frictionid.acquire.camera.follow import follow, gathered
from frictionid.acquire.camera.marks import Links, Marker, Marks
from frictionid.acquire.camera.source import Frame
from frictionid.recordings import Motion
from frictionid.signals import Signal
from frictionid.simulate.film import Film, shots
from frictionid.simulate.scene import Look
from frictionid.simulate.view import View

LENGTHS = (0.153, 0.175)
SMALL = View(size=(640, 480), pivot=(320.0, 240.0), scale=600.0)
RED, BLUE = (0.0, 0.85, 0.85), (210.0, 0.85, 0.85)


def motion(frames, speed=1.0, whirl=0.0, seed=0, rate=60.0):
    """Both joints swing, the second one may go round and round, [rad/s]."""
    t = np.arange(frames) / rate
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0, 2 * np.pi, 2)
    q = np.column_stack([1.4 * np.sin(5 * speed * t + a), 1.1 * np.sin(8 * speed * t + b)])
    w = np.column_stack(
        [7 * speed * np.cos(5 * speed * t + a), 8.8 * speed * np.cos(8 * speed * t + b)]
    )
    q[:, 1] += whirl * t
    w[:, 1] += whirl
    return Motion(Signal(t, q), Signal(t, w))


def marker(name, hsv, radius=8.0, **others):
    return Marker(name=name, hue=hsv[0], saturation=hsv[1], value=hsv[2], radius=radius, **others)


def marks_of(film, **others):
    """What a user who measured the rig would write."""
    names = ("pivot", "elbow", "tip")
    markers = [
        Marker(name=name, at=list(film.view.pivot))
        if not hsv
        else marker(name, hsv, film.look.radius)
        for name, hsv in zip(names, film.look.dots, strict=True)
    ]
    return Marks(markers=markers, links=Links(lengths=list(film.lengths)), **others)


def taken(film, movement):
    return list(shots(film, movement))


def frames(film_shots):
    return [Frame(s.time, s.image) for s in film_shots]


def tracked(film, film_shots, marks=None, followed=follow):
    marks = marks or marks_of(film)
    steps = gathered(list(followed(marks, iter(frames(film_shots)))))
    return angles_of(steps, marks, film.view.size, "film")


def truth(movement, time):
    return CubicHermiteSpline(movement.angle.time, movement.angle.value, movement.velocity.value)(
        time
    )


def errors(angles, movement):
    """Errors (K, n) [deg] of the frames that were found."""
    found = np.array(angles.state) == "found"
    return np.degrees(angles.q - truth(movement, angles.time))[found]


def rms(e):
    return np.sqrt((e**2).mean(axis=0))


__all__ = ["BLUE", "LENGTHS", "RED", "SMALL", "Film", "Look", "View"]
