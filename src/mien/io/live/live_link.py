"""Live Link Face: the 61 numbers a frame of Epic's capture app, in its files and its packets.

52 ARKit face units, then angles of head and eyes. The angles are Unreal's, in radians: yaw positive
to the subject's right, pitch positive down, roll positive to the subject's left shoulder; the head
is tipped to the side first, then down, then turned. (Checked against a recording of the app, whose
eyes' angles and EyeLook units agree in these signs.)
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mien.animate.channels import head_angles_rad
from mien.animate.timeline import Moment
from mien.arrays import Array
from mien.errors import InputError
from mien.limits import UNIT_RANGE
from mien.rig.state import FaceState

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
"""In the order of the app's columns."""
ANGLES = ("Yaw", "Pitch", "Roll")
HEAD_COLUMNS = tuple(f"Head{angle}" for angle in ANGLES)
EYE_COLUMNS = tuple(f"{side}Eye{angle}" for side in ("Left", "Right") for angle in ANGLES)

TIMECODE_RATE = 60
"""Frames a second that the app's timecodes count, whatever the recording's own rate."""

LOOK_RANGE = float(np.radians(30))
"""Angle that an EyeLook unit of 1 stands for; 26 to 40 degrees in recordings of the app."""


def column_name(unit: str) -> str:
    """`eyeBlinkLeft` to `EyeBlinkLeft`."""
    return unit[:1].upper() + unit[1:]


def live_link_values(moment: Moment, given: Mapping[str, float]) -> dict[str, float]:
    """The 61 numbers of a frame: weights by UNITS, angles by HEAD_COLUMNS and EYE_COLUMNS.

    Args:
        moment: the frame.
        given: weights by unit for the moment's face.

    Returns:
        in the order of the file's columns; Unreal's angles, radians.

    Raises:
        InputError: a unit that the format does not have.
    """
    weights = weights_with_gaze(moment.state, given)
    yaw, pitch, roll = head_angles_rad(moment.rotation, order="YXZ")
    angles = [-yaw, pitch, -roll, *_eye_angles(weights)]
    return weights | dict(zip((*HEAD_COLUMNS, *EYE_COLUMNS), angles, strict=True))


def weights_with_gaze(state: FaceState, given: Mapping[str, float]) -> dict[str, float]:
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
