"""VMC protocol: face and head for VRM avatars, as Open Sound Control over UDP, one bundle a frame.

Virtual Motion Capture's protocol (protocol.vmc.info, version 2.7) is what VSeeFace, Warudo,
VMagicMirror and receivers for Unity, Unreal, Godot and Blender understand. A frame is

    /VMC/Ext/OK 1 3 0 TRACKED           loaded, calibrated; TRACKED is 0 while the face is lost
    /VMC/Ext/T SECONDS
    /VMC/Ext/Bone/Pos BONE 0 0 0 X Y Z W    Head, LeftEye, RightEye: how they turn
    /VMC/Ext/Blend/Val NAME WEIGHT      52 face units (`JawOpen`), region weights (`mouth.joy`)
    /VMC/Ext/Blend/Apply

Units are called as the clips of "perfect sync" avatars are: ARKit's names with a capital, which
counts. Positions of bones belong to the avatar's own skeleton, which the sender does not have: 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from mien.animate.timeline import Moment
from mien.arrays import Array, Float
from mien.io.live.live_link import column_name, weights_with_gaze
from mien.rig.state import FaceState, Gaze

VMC_PORT = 39539
"""Where receivers listen by default."""

_LOADED, _CALIBRATED, _NORMAL_MODE = 1, 3, 0
_EYES = ("LeftEye", "RightEye")
_POSITION = (0.0, 0.0, 0.0)

_Message = tuple[str, tuple[str | int | float, ...]]


def encode_face(moment: Moment, given: Mapping[str, float]) -> bytes:
    """The bundle of a frame in which the face was found.

    Args:
        moment: the frame.
        given: weights by unit for the moment's face.

    Raises:
        InputError: a unit that is not one of ARKit's 52.
    """
    return _bundle([*_status(moment.time, tracked=True), *_bones(moment), *_blends(moment, given)])


def encode_lost(seconds: float) -> bytes:
    """The bundle of a frame in which it was not: the avatar stays as it is."""
    return _bundle(list(_status(seconds, tracked=False)))


def unity_quaternion(rotation: Float[Array, "3 3"]) -> tuple[float, float, float, float]:
    """A rotation of head space as Unity's x, y, z, w.

    Unity is left-handed: x to the avatar's right, y up, z forward. Mirroring x takes the one space
    to the other; a rotation's axis, being no arrow but a sense of turning, keeps its x and has y
    and z reversed.
    """
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True).tolist()
    return x, -y, -z, w


def _status(seconds: float, *, tracked: bool) -> Iterator[_Message]:
    yield "/VMC/Ext/OK", (_LOADED, _CALIBRATED, _NORMAL_MODE, int(tracked))
    yield "/VMC/Ext/T", (float(seconds),)


def _bones(moment: Moment) -> Iterator[_Message]:
    eye = unity_quaternion(_eye_rotation(moment.state.gaze))
    for bone, turn in (("Head", unity_quaternion(moment.rotation)), *((e, eye) for e in _EYES)):
        yield "/VMC/Ext/Bone/Pos", (bone, *_POSITION, *turn)


def _eye_rotation(gaze: Gaze) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("YX", [gaze.yaw, -gaze.pitch]).as_matrix()


def _blends(moment: Moment, given: Mapping[str, float]) -> Iterator[_Message]:
    # An avatar's clips go from 0 to 1; a region's weights are as they were found.
    units = weights_with_gaze(moment.state, given).items()
    weights = {column_name(unit): min(max(weight, 0.0), 1.0) for unit, weight in units}
    for name, weight in (weights | _region_weights(moment.state)).items():
        yield "/VMC/Ext/Blend/Val", (name, float(weight))
    yield "/VMC/Ext/Blend/Apply", ()


def _region_weights(state: FaceState) -> dict[str, float]:
    """`mouth.joy` for every weight of a photographed expression; neutral has the rest to 1."""
    return {
        f"{region}.{name}": weight
        for region, mixture in state.expressions.items()
        for name, weight in mixture.items()
    }


def _bundle(messages: list[_Message]) -> bytes:
    from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
    from pythonosc.osc_message_builder import build_msg

    bundle = OscBundleBuilder(IMMEDIATELY)
    for address, values in messages:
        bundle.add_content(build_msg(address, values))
    return bundle.build().dgram
