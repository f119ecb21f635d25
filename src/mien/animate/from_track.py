"""A track as a timeline: the tracked motion, for any camera and any head."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mien.animate.channels import CHANNEL_NAMES, HEAD, head_angles_rad
from mien.animate.curves import MIN_STEP, sampled
from mien.animate.timeline import PIVOT_MM, Moment, Timeline
from mien.arrays import Array, Float
from mien.camera import FRONTAL, Camera
from mien.errors import InputError
from mien.rig.regions import ENCLOSING_REGIONS
from mien.rig.state import FACE
from mien.track.state import GAZE, Layout, Track, TrackedFrame, TrackState


def rest_camera(track: Track) -> Camera:
    """The video's camera for a head at rest, which faces it at the median position.

    `perform.moved_camera(rest_camera(track), moment)` gives the camera of the video at a moment.

    Raises:
        InputError: no frame with a face.
    """
    positions = [state.t_cam_head for _, state in _found(track)]
    middle = np.median(positions, axis=0)
    return Camera(track.width, track.height, track.focal_px, FRONTAL, middle)


def track_timeline(track: Track) -> Timeline:
    """The timeline with a key for every frame and linear interpolation.

    Times count from the first frame. Lost frames are interpolated. The head's pose is relative to
    that of rest_camera. Channels that are always 0 are left out.

    Raises:
        InputError: no frame with a face.
    """
    found = _found(track)
    times = np.array([frame.time for frame, _ in found]) - track.frames[0].time
    values = _face_values(track.layout, [state for _, state in found])
    values |= _head_values(rest_camera(track), [state for _, state in found])
    # Of frames with the same time, which a broken stream may have, the first is used.
    distinct = np.append(True, np.diff(times) >= MIN_STEP)
    elapsed = track.frames[-1].time - track.frames[0].time
    return Timeline(
        duration=elapsed + 1 / track.fps,
        fps=track.fps,
        tracks={
            channel: sampled(times[distinct], numbers[distinct])
            for channel, numbers in values.items()
            if numbers.any()
        },
    )


def track_moments(track: Track) -> Iterator[Moment]:
    """Face and head at each of the track's frames, lost ones too; times count from the first.

    Raises:
        InputError: no frame with a face.
    """
    times = np.array([frame.time for frame in track.frames])
    return track_timeline(track).moments_at(times - times[:1])


def _found(track: Track) -> list[tuple[TrackedFrame, TrackState]]:
    found = [(frame, frame.state) for frame in track.frames if frame.state is not None]
    if not found:
        raise InputError("track", "at least one frame with a face", f"{len(track.frames)} without")
    return found


def _face_values(layout: Layout, states: list[TrackState]) -> dict[str, Float[Array, " n"]]:
    """(N,) by channel. Weights of a timeline's regions are added, those of a track are absolute."""
    given = dict(zip(layout.channels, np.array([state.values for state in states]).T, strict=True))
    values = {name: given[name] for name in (*(f"units.{u}" for u in layout.units), *GAZE)}
    for region in layout.regions:
        enclosing = next(
            (r for r in ENCLOSING_REGIONS.get(region, (FACE,)) if r in layout.regions), None
        )
        for name in layout.expressions[1:]:
            below = given[f"{enclosing}.{name}"] if enclosing else 0.0
            values[f"{region}.{name}"] = given[f"{region}.{name}"] - below
    return values


def _head_values(camera: Camera, states: list[TrackState]) -> dict[str, Float[Array, " n"]]:
    """(N,) by channel: yaw, pitch, roll, and how far the pivot moves."""
    back = camera.R_cam_head.T
    rotations = np.array([back @ state.R_cam_head for state in states])
    moved = np.array([back @ (state.t_cam_head - camera.t_cam_head) for state in states])
    angles = np.unwrap([head_angles_rad(rotation) for rotation in rotations], axis=0)
    pivot = np.array(PIVOT_MM)
    shifts = moved - (pivot - rotations @ pivot)
    names = (f"{HEAD}.{name}" for name in CHANNEL_NAMES[HEAD])
    return dict(zip(names, np.column_stack([angles, shifts]).T, strict=True))
