"""A real frame of a camera pendulum: its marker is found where other software saw it."""

import cv2
import numpy as np

from frictionid.rig.camera.follow import Follower
from frictionid.rig.camera.marker_setup import Marker, MarkerSetup
from frictionid.rig.camera.source import Frame


def test_the_marker_of_a_real_frame_is_found(real_data):
    screen = cv2.imread(str(real_data / "phy180_camera_pendulum/cv_track_real_frame.png"))
    frame = np.ascontiguousarray(screen[66:737, 1:379])  # the first window of the screen shot
    # that software drew a green dot where it saw the marker, and a red one on the pivot
    green = (screen[66:737, 1:379] == (0, 255, 0)).all(axis=-1)
    there = np.argwhere(green).mean(axis=0)[::-1]
    bob = Marker(name="bob", hue=5.0, saturation=0.5, value=0.55, radius=8.0)
    step = Follower(MarkerSetup(markers=[Marker(name="pivot", at=[189.0, 105.0]), bob])).step(
        Frame(0.0, frame)
    )
    assert step.seen.all()
    assert np.hypot(*(step.at[1] - there)) < 4.0
