"""A track as a CSV like OpenFace 2's, for programs that read pose, gaze and action units.

A row a frame, counted from 1: pose in the camera's frame (mm, radians), a gaze vector for each eye,
FACS action units from 0 to 5. What is approximate: docs/reference/track-files.md.

Source:
    OpenFace's wiki, "Output Format"; the order of its FeatureExtraction's columns.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float
from mien.camera import FRONTAL
from mien.errors import InputError
from mien.io.files.atomic import atomic_file
from mien.io.live.live_link import LOOK_RANGE
from mien.rig.state import FaceState, Gaze
from mien.track.state import Track, TrackedFrame, TrackState

FULL = 5.0
"""Intensity of FACS' "E", the maximum: that of a face unit of 1."""
TRACE = 1.0
"""Intensity of FACS' "A": from there on an action unit counts as present."""


def _both(unit: str) -> tuple[str, str]:
    return f"{unit}Left", f"{unit}Right"


ACTION_UNITS: Mapping[str, tuple[str, ...]] = {
    "AU01": ("browInnerUp",),
    "AU02": _both("browOuterUp"),
    "AU04": _both("browDown"),
    "AU05": _both("eyeWide"),
    "AU06": _both("cheekSquint"),
    "AU07": _both("eyeSquint"),
    "AU09": _both("noseSneer"),
    "AU10": _both("mouthUpperUp"),
    "AU12": _both("mouthSmile"),
    "AU14": _both("mouthDimple"),
    "AU15": _both("mouthFrown"),
    "AU17": ("mouthShrugLower",),
    "AU20": _both("mouthStretch"),
    "AU23": _both("mouthPress"),
    "AU25": _both("mouthLowerDown"),
    "AU26": ("jawOpen",),
    "AU28": ("mouthRollLower", "mouthRollUpper"),
    "AU45": _both("eyeBlink"),
}
"""The face units whose mean stands for an action unit."""

PRESENCE_ONLY = "AU28"
"""OpenFace has no intensity of it."""

_INTENSITIES = tuple(name for name in ACTION_UNITS if name != PRESENCE_ONLY)
COLUMNS = (
    *("frame", "face_id", "timestamp", "confidence", "success"),
    *(f"gaze_{eye}_{axis}" for eye in (0, 1) for axis in "xyz"),
    *("gaze_angle_x", "gaze_angle_y"),
    *(f"pose_{kind}{axis}" for kind in "TR" for axis in "xyz"),
    *(f"{name}_r" for name in _INTENSITIES),
    *(f"{name}_c" for name in ACTION_UNITS),
)


def save_openface(
    path: str | Path,
    track: Track,
    *,
    units_of: Callable[[FaceState], Mapping[str, float]] = lambda state: state.units,
) -> int:
    """Write a track as an OpenFace-style CSV, whole or not at all.

    A lost frame has success 0, confidence 0 and zeros.

    Args:
        path: the file.
        track: the track.
        units_of: weights by unit for a face state; its own units unless given, which leave out
            photographed expressions.

    Returns:
        how many frames were written.

    Raises:
        InputError: no frame, a place that cannot be written.
    """
    if not track.frames:
        raise InputError(path, "at least one frame to write", "none")
    with atomic_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for frame in track.frames:
            state = frame.state
            given = {} if state is None else units_of(state.face(track.layout))
            writer.writerow([*_header_cells(frame), *_face_cells(state, given)])
    return len(track.frames)


def action_units(units: Mapping[str, float]) -> dict[str, float]:
    """Intensities from 0 to 5 by the names of ACTION_UNITS."""
    weights = {
        name: float(np.mean([units.get(unit, 0.0) for unit in members]))
        for name, members in ACTION_UNITS.items()
    }
    # Lips also part when the jaw drops and nothing holds them together.
    parted = units.get("jawOpen", 0.0) - units.get("mouthClose", 0.0)
    weights["AU25"] = max(weights["AU25"], parted)
    return {name: min(max(FULL * weight, 0.0), FULL) for name, weight in weights.items()}


def pose_angles(R_cam_head: Float[Array, "3 3"]) -> Float[Array, " 3"]:
    """pose_Rx, pose_Ry, pose_Rz in radians: down, to the subject's right, clockwise in the picture.

    R = Rx Ry Rz turns a head that faces the camera, in the camera's axes.
    """
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R_cam_head @ FRONTAL).as_euler("XYZ")


def gaze_vectors(
    R_cam_head: Float[Array, "3 3"], gaze: Gaze, units: Mapping[str, float]
) -> Float[Array, "2 3"]:
    """Unit vectors of gaze, (2, 3) in the camera's axes: the subject's right eye, then left.

    Args:
        R_cam_head: (3, 3).
        gaze: of both eyes, in the head's axes.
        units: their EyeLook units add to the gaze.
    """
    directions = []
    for side, to_left, to_right in (("Right", "In", "Out"), ("Left", "Out", "In")):
        looks = {way: units.get(f"eyeLook{way}{side}", 0.0) for way in ("In", "Out", "Up", "Down")}
        yaw = gaze.yaw + LOOK_RANGE * (looks[to_left] - looks[to_right])
        pitch = gaze.pitch + LOOK_RANGE * (looks["Up"] - looks["Down"])
        directions.append([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
    return np.array(directions) @ R_cam_head.T


def _header_cells(frame: TrackedFrame) -> list[str]:
    found = frame.state is not None
    confidence = frame.seen if found and np.isfinite(frame.seen) else float(found)
    time = f"{frame.time:.6f}"
    return [str(frame.frame + 1), "0", time, f"{confidence:.6f}", str(int(found))]


def _face_cells(state: TrackState | None, units: Mapping[str, float]) -> list[str]:
    present = ["0"] * len(ACTION_UNITS)
    if state is None:
        return ["0"] * (len(COLUMNS) - len(present) - 5) + present
    intensities = action_units(units)
    vectors = gaze_vectors(state.R_cam_head, Gaze(*state.gaze.tolist()), units)
    x, y, z = vectors.mean(axis=0)
    numbers = [
        *vectors.ravel(),
        *(np.arctan2(x, -z), np.arctan2(y, -z)),
        *state.t_cam_head,
        *pose_angles(state.R_cam_head),
        *(intensities[name] for name in _INTENSITIES),
    ]
    present = [str(int(value >= TRACE)) for value in intensities.values()]
    # Adding 0 turns -0 into 0.
    return [f"{round(float(number), 6) + 0.0:.6f}" for number in numbers] + present
