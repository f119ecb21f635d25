"""Live Link Face CSV: what Epic's capture app records and Unreal, Blender and Maya plug-ins read.

A row a frame: timecode, 52 ARKit face units (`EyeBlinkLeft`), angles of head and eyes. The angles
are Unreal's, in radians: yaw positive to the subject's right, pitch positive down, roll positive to
the subject's left shoulder; the head is tipped to the side first, then down, then turned. (Checked
against a recording of the app, whose eyes' angles and EyeLook units agree in these signs.)
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from mien.animate.channels import head_angles
from mien.animate.timeline import Moment
from mien.arrays import Array
from mien.errors import InputError
from mien.io.files.atomic import atomic_file
from mien.limits import UNIT_RANGE
from mien.rig.state import FaceState

# The order of the app's columns.
UNITS = (
    *(
        f"eye{what}{side}"
        for side in ("Left", "Right")
        for what in ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")
    ),
    *("jawForward", "jawRight", "jawLeft", "jawOpen", "mouthClose", "mouthFunnel", "mouthPucker"),
    *("mouthRight", "mouthLeft", "mouthSmileLeft", "mouthSmileRight", "mouthFrownLeft"),
    *("mouthFrownRight", "mouthDimpleLeft", "mouthDimpleRight", "mouthStretchLeft"),
    *("mouthStretchRight", "mouthRollLower", "mouthRollUpper", "mouthShrugLower"),
    *("mouthShrugUpper", "mouthPressLeft", "mouthPressRight", "mouthLowerDownLeft"),
    *("mouthLowerDownRight", "mouthUpperUpLeft", "mouthUpperUpRight", "browDownLeft"),
    *("browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight", "cheekPuff"),
    *("cheekSquintLeft", "cheekSquintRight", "noseSneerLeft", "noseSneerRight", "tongueOut"),
)
ANGLES = ("Yaw", "Pitch", "Roll")
HEAD_COLUMNS = tuple(f"Head{angle}" for angle in ANGLES)
EYE_COLUMNS = tuple(f"{side}Eye{angle}" for side in ("Left", "Right") for angle in ANGLES)
TIMECODE, COUNT = "Timecode", "BlendShapeCount"

TIMECODE_RATE = 60
"""Frames a second that the app's timecodes count, whatever the recording's own rate."""

LOOK_RANGE = float(np.radians(30))
"""Angle that an EyeLook unit of 1 stands for; 26 to 40 degrees in recordings of the app."""


def save_live_link(
    path: str | Path,
    moments: Iterable[Moment],
    *,
    units_of: Callable[[FaceState], Mapping[str, float]] = lambda state: state.units,
) -> int:
    """Write a performance as a Live Link Face CSV, whole or not at all.

    The format knows no photographed expressions and no moved head: only units, head and eye
    angles are written. Where the eyes look is added to the EyeLook units, which is what most
    programs read.

    Args:
        moments: in rising time, from 0 s on.
        units_of: the units that stand for a face; for a caller who can explain its photographed
            expressions in units.

    Returns:
        how many frames were written.

    Raises:
        InputError: no moment, a unit that the format has no column for, a negative time, a place
            that cannot be written.
    """
    count = 0
    header = [TIMECODE, COUNT, *map(column_of, UNITS), *HEAD_COLUMNS, *EYE_COLUMNS]
    with atomic_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for moment in moments:
            writer.writerow(_row(moment, units_of(moment.state)))
            count += 1
        if not count:
            raise InputError(path, "at least one frame to write", "none")
    return count


def column_of(unit: str) -> str:
    """`eyeBlinkLeft` to `EyeBlinkLeft`."""
    return unit[:1].upper() + unit[1:]


def timecode(seconds: float) -> str:
    """HH:MM:SS:FF.sss with TIMECODE_RATE frames a second. Raises: InputError: negative."""
    if not seconds >= 0:
        raise InputError("time", "a frame at 0 s or later", f"{seconds:g} s")
    total, thousandths = divmod(round(seconds * TIMECODE_RATE * 1000), 1000)
    whole, frame = divmod(total, TIMECODE_RATE)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours:02}:{minutes:02}:{whole % 60:02}:{frame:02}.{thousandths:03}"


def values_of(moment: Moment, given: Mapping[str, float]) -> dict[str, float]:
    """The 61 numbers of a frame: weights by UNITS, angles by HEAD_COLUMNS and EYE_COLUMNS.

    Args:
        given: weights of the units that stand for the moment's face.

    Returns:
        in the order of the file's columns; Unreal's angles, radians.

    Raises:
        InputError: a unit that the format does not know.
    """
    weights = unit_weights(moment.state, given)
    yaw, pitch, roll = head_angles(moment.rotation, order="YXZ")
    angles = [-yaw, pitch, -roll, *_eye_angles(weights)]
    return weights | dict(zip((*HEAD_COLUMNS, *EYE_COLUMNS), angles, strict=True))


def unit_weights(state: FaceState, given: Mapping[str, float]) -> dict[str, float]:
    """All 52 UNITS: the given ones, and where the eyes look added to the EyeLook units.

    What goes beyond UNIT_RANGE so, which readers refuse, stays at its end.

    Raises:
        InputError: a unit that is none of them.
    """
    for name in given:
        if name not in UNITS:
            raise InputError("unit", "one of the 52 that Live Link Face has columns for", name)
    looks, (low, high) = _looks(state), UNIT_RANGE
    return {
        name: min(max(float(given.get(name, 0.0)) + looks.get(name, 0.0), low), high)
        for name in UNITS
    }


def _row(moment: Moment, given: Mapping[str, float]) -> list[str]:
    # Adding 0 turns -0 into 0.
    numbers = [f"{value + 0.0:.10f}" for value in values_of(moment, given).values()]
    return [timecode(moment.time), str(len(numbers)), *numbers]


def _looks(state: FaceState) -> dict[str, float]:
    """The EyeLook units that stand for where the eyes look."""
    left, up = state.gaze.yaw / LOOK_RANGE, state.gaze.pitch / LOOK_RANGE
    looks = {"eyeLookOutLeft": left, "eyeLookInRight": left}
    looks |= {"eyeLookInLeft": -left, "eyeLookOutRight": -left}
    looks |= {f"eyeLookUp{side}": up for side in ("Left", "Right")}
    looks |= {f"eyeLookDown{side}": -up for side in ("Left", "Right")}
    return {name: max(0.0, share) for name, share in looks.items()}


def _eye_angles(weights: Mapping[str, float]) -> Array:
    """(6,) yaw, pitch and roll of the left eye, then the right one's, radians."""
    angles = []
    for side, to_right, to_left in (("Left", "In", "Out"), ("Right", "Out", "In")):
        yaw = weights[f"eyeLook{to_right}{side}"] - weights[f"eyeLook{to_left}{side}"]
        pitch = weights[f"eyeLookDown{side}"] - weights[f"eyeLookUp{side}"]
        angles += [yaw, pitch, 0.0]
    return LOOK_RANGE * np.array(angles)
