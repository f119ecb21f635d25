"""The frames of a timeline, the camera relative to the moved head, and a timeline to try."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np

from mien.animate.timeline import Moment, Timeline
from mien.arrays import Array, Float, check_positive
from mien.camera import Camera
from mien.errors import InputError
from mien.limits import MAX_FPS, MAX_FRAMES


def sample_timeline() -> Path:
    """The file of the timeline that ships with mien; it has only units, so that it fits any head.

    Ten seconds: a silent sentence, a look around, a smile, raised brows; blinking and breathing.
    """
    return Path(str(files("mien.assets"))) / "data" / "sample_timeline.json"


def frame_times(timeline: Timeline, fps: float | None = None) -> Float[Array, " n"]:
    """(N,) seconds of the frames: from 0, one every 1 / fps, until the duration.

    Args:
        timeline: to be sampled.
        fps: frames a second; the timeline's own unless given.

    Raises:
        InputError: a rate out of range, more than MAX_FRAMES.
    """
    rate = check_positive("fps", timeline.fps if fps is None else fps)
    if rate > MAX_FPS:
        raise InputError("fps", f"at most {MAX_FPS:g}", f"{rate:g}")
    count = max(1, round(timeline.duration * rate))
    if count > MAX_FRAMES:
        found = f"{timeline.duration:g} s at {rate:g} frames a second"
        raise InputError("frames", f"at most {MAX_FRAMES}", found)
    return np.arange(count) / rate


def moved_camera(camera: Camera, moment: Moment) -> Camera:
    """The camera that sees the head at rest as `camera` sees the moved head.

    Args:
        camera: of the head at rest.
        moment: pose of the head.
    """
    return replace(
        camera,
        R_cam_head=camera.R_cam_head @ moment.rotation,
        t_cam_head=camera.R_cam_head @ moment.translation + camera.t_cam_head,
    )
