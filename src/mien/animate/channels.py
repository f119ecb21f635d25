"""Channels of a timeline, and the face state and head pose that their values stand for."""

from __future__ import annotations

from collections.abc import Mapping

from mien.arrays import Array, Float
from mien.errors import InputError
from mien.rig.regions import ENCLOSING_REGIONS
from mien.rig.state import FACE, FaceState, Gaze

HEAD, GAZE, UNITS = "head", "gaze", "units"
"""Groups of channels besides the regions. A channel's name is GROUP.NAME: `units.jawOpen`."""

CHANNEL_NAMES = {HEAD: ("yaw", "pitch", "roll", "x", "y", "z"), GAZE: ("yaw", "pitch")}
ANGLES = frozenset(
    f"{group}.{name}" for group in CHANNEL_NAMES for name in ("yaw", "pitch", "roll")
)

REGION_NAMES = tuple(ENCLOSING_REGIONS)


def split_channel(channel: str) -> tuple[str, str]:
    """`mouth.joy` to ("mouth", "joy").

    Raises:
        InputError: not GROUP.NAME.
    """
    group, _, name = channel.partition(".")
    if not (group and name) or name not in CHANNEL_NAMES.get(group, (name,)):
        raise InputError("channel", "GROUP.NAME as units.jawOpen, mouth.joy or head.yaw", channel)
    return group, name


def state_from_channels(values: Mapping[str, float]) -> FaceState:
    """The face state with these values by channel; channels that are missing are 0.

    Weights of a region are added to those of the regions that contain it (`left_mouth` to `mouth`
    to `face`), so that a motion of the mouth can be added to any face and fades in smoothly.
    """
    units: dict[str, float] = {}
    own: dict[str, dict[str, float]] = {}
    for channel, value in values.items():
        group, name = split_channel(channel)
        if group == UNITS:
            units[name] = float(value)
        elif group not in CHANNEL_NAMES:
            own.setdefault(group, {})[name] = float(value)
    gaze = Gaze(float(values.get("gaze.yaw", 0)), float(values.get("gaze.pitch", 0)))
    return FaceState({region: _with_enclosing(own, region) for region in own}, units, gaze)


def _with_enclosing(own: Mapping[str, Mapping[str, float]], region: str) -> dict[str, float]:
    total: dict[str, float] = {}
    for name in (*ENCLOSING_REGIONS.get(region, (FACE,)), region):
        for expression, weight in own.get(name, {}).items():
            total[expression] = total.get(expression, 0.0) + weight
    return total


def head_rotation(yaw: float, pitch: float, roll: float) -> Float[Array, "3 3"]:
    """Rotation of head space as `mien render` composes it: yaw first, then pitch, then roll.

    Args:
        yaw: radians, positive to the subject's left.
        pitch: radians, positive down.
        roll: radians, positive to the subject's right shoulder.
    """
    from scipy.spatial.transform import Rotation

    # Lower-case axes are fixed ones, turned about in the order of their letters.
    return Rotation.from_euler("yxz", [yaw, pitch, roll]).as_matrix()


def head_angles_rad(
    rotation: Float[Array, "3 3"], *, order: str = "yxz"
) -> tuple[float, float, float]:
    """Yaw, pitch and roll of a rotation, radians; pitch (in `order`'s middle) within pi / 2.

    Args:
        rotation: of head space.
        order: "yxz", that of head_rotation, or "YXZ", intrinsic rotations, as a neck and most other
            programs have them.
    """
    from scipy.spatial.transform import Rotation

    yaw, pitch, roll = Rotation.from_matrix(rotation).as_euler(order)
    return float(yaw), float(pitch), float(roll)
