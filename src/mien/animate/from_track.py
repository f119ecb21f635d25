"""A track as a performance: what a head did before a camera, for any camera and any head."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mien.animate.channels import HEAD, MEMBERS, head_angles_rad
from mien.animate.curves import MIN_STEP, sampled
from mien.animate.timeline import PIVOT_MM, Moment, Timeline
from mien.arrays import Array, Float
from mien.camera import FRONTAL, Camera
from mien.errors import InputError
from mien.rig.regions import ENCLOSING_REGIONS
from mien.rig.state import FACE
from mien.track.state import GAZE, Layout, Track, TrackedFrame, TrackState


def rest_camera(track: Track) -> Camera:
    """The video's camera before a head at rest: one that faces it where the head mostly was.

    Seen through `perform.moved_camera(rest_camera(track), moment)`, a track's moments are where
    they were in the video.

    Raises:
        InputError: no frame with a face.
    """
    places = [state.t_cam_head for _, state in _found(track)]
    middle = np.median(places, axis=0)
    return Camera(track.width, track.height, track.focal_px, FRONTAL, middle)


def track_timeline(track: Track) -> Timeline:
    """The performance with a key for every frame, straight from each to the next.

    Times count from the first frame. Lost frames are bridged by their neighbours. The head's pose
    is relative to rest_camera's head. What stays at 0 has no track.

    Raises:
        InputError: no frame with a face.
    """
    found = _found(track)
    times = np.array([frame.time for frame, _ in found]) - track.frames[0].time
    values = _face_values(track.layout, [state for _, state in found])
    values |= _head_values(rest_camera(track), [state for _, state in found])
    # Frames of the same time, which a broken stream may have, show one moment: the first counts.
    apart = np.append(True, np.diff(times) >= MIN_STEP)
    elapsed = track.frames[-1].time - track.frames[0].time
    return Timeline(
        duration=elapsed + 1 / track.fps,
        fps=track.fps,
        tracks={
            channel: sampled(times[apart], numbers[apart])
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
    """(N,) by channel. A timeline's regions add to those around them, a track's stand alone."""
    given = dict(zip(layout.channels, np.array([state.values for state in states]).T, strict=True))
    values = {name: given[name] for name in (*(f"units.{u}" for u in layout.units), *GAZE)}
    for region in layout.regions:
        around = next(
            (r for r in ENCLOSING_REGIONS.get(region, (FACE,)) if r in layout.regions), None
        )
        for name in layout.expressions[1:]:
            below = given[f"{around}.{name}"] if around else 0.0
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
    names = (f"{HEAD}.{name}" for name in MEMBERS[HEAD])
    return dict(zip(names, np.column_stack([angles, shifts]).T, strict=True))
