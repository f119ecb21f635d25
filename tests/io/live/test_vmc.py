"""VMC protocol: messages read by another reader; turns as a left-handed Unity makes them."""

from __future__ import annotations

import numpy as np
import pytest

from mien.animate.channels import head_rotation
from mien.animate.timeline import Moment
from mien.errors import InputError
from mien.io.live.live_link import UNITS
from mien.io.live.vmc import encode_face, encode_lost, unity_quaternion
from mien.rig.state import FaceState, Gaze
from packets import blend_values, messages

MIRROR = np.diag([-1.0, 1.0, 1.0])
"""Head space to Unity's and back: x is to the subject's left in one, to the right in the other."""


def moment(state: FaceState | None = None, rotation: np.ndarray | None = None) -> Moment:
    turned = np.eye(3) if rotation is None else rotation
    return Moment(1.5, state or FaceState(), turned, np.zeros(3))


def bones(data: bytes) -> dict[str, list[float]]:
    found = [values for address, values in messages(data) if address == "/VMC/Ext/Bone/Pos"]
    return {str(values[0]): [float(v) for v in values[1:]] for values in found}  # type: ignore[arg-type]


def unity_matrix(quaternion: tuple[float, float, float, float]) -> np.ndarray:
    """What Unity's Matrix4x4.Rotate gives; the formula does not know of handedness."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize(
    ("angles", "euler"),
    [
        # Unity's Inspector: a positive x looks down, a positive y to the right, a positive z tips
        # the avatar to its left.
        ((0.5, 0.0, 0.0), (0.0, -0.5, 0.0)),
        ((0.0, 0.5, 0.0), (0.5, 0.0, 0.0)),
        ((0.0, 0.0, 0.5), (0.0, 0.0, -0.5)),
    ],
)
def test_turns_go_where_unitys_go(
    angles: tuple[float, float, float], euler: tuple[float, float, float]
) -> None:
    quaternion = unity_quaternion(head_rotation(*angles))
    half = np.array(euler) / 2
    assert quaternion == pytest.approx((*np.sin(half), np.cos(0.25)))


def test_a_turned_point_is_its_mirror_image_turned(rng: np.random.Generator) -> None:
    for _ in range(20):
        rotation = head_rotation(*rng.uniform(-1.2, 1.2, 3))
        point = rng.normal(size=3)
        in_unity = unity_matrix(unity_quaternion(rotation)) @ (MIRROR @ point)
        np.testing.assert_allclose(MIRROR @ in_unity, rotation @ point, atol=1e-12)


def test_a_frame_is_one_bundle_in_the_protocols_order() -> None:
    found = messages(encode_face(moment(), {}))
    addresses = [address for address, _ in found]
    assert addresses == [
        "/VMC/Ext/OK",
        "/VMC/Ext/T",
        *["/VMC/Ext/Bone/Pos"] * 3,
        *["/VMC/Ext/Blend/Val"] * 52,
        "/VMC/Ext/Blend/Apply",
    ]
    assert found[0][1] == [1, 3, 0, 1]
    assert found[1][1] == [1.5]
    assert found[-1][1] == []
    assert found[2][1] == ["Head", 0, 0, 0, 0, 0, 0, 1]


def test_a_lost_face_leaves_the_avatar_as_it_is() -> None:
    found = messages(encode_lost(2.0))
    assert found == [("/VMC/Ext/OK", [1, 3, 0, 0]), ("/VMC/Ext/T", [2.0])]


def test_units_are_called_as_perfect_sync_calls_them() -> None:
    found = blend_values(encode_face(moment(), {"jawOpen": 0.5, "browInnerUp": 0.25}))
    assert set(found) == {unit[0].upper() + unit[1:] for unit in UNITS}
    assert {n: v for n, v in found.items() if v} == {"JawOpen": 0.5, "BrowInnerUp": 0.25}


def test_units_go_from_0_to_1_and_region_weights_as_found() -> None:
    state = FaceState({"mouth": {"joy": -0.25, "anger": 1.25}})
    found = blend_values(encode_face(moment(state), {"jawOpen": -0.5, "cheekPuff": 1.5}))
    assert (found["JawOpen"], found["CheekPuff"]) == (0, 1)
    assert (found["mouth.joy"], found["mouth.anger"]) == (-0.25, 1.25)


def test_region_weights_go_by_region_and_expression() -> None:
    state = FaceState({"mouth": {"joy": 0.5, "anger": 0.25}, "eyes": {"joy": 0.0, "anger": 1.0}})
    found = blend_values(encode_face(moment(state), {"mouthSmileLeft": 0.75}))
    assert found["MouthSmileLeft"] == 0.75
    assert {name: value for name, value in found.items() if "." in name} == {
        "mouth.joy": 0.5,
        "mouth.anger": 0.25,
        "eyes.joy": 0.0,
        "eyes.anger": 1.0,
    }


def test_head_and_eyes_turn() -> None:
    turned = head_rotation(0.4, 0.2, -0.1)
    data = encode_face(moment(FaceState(gaze=Gaze(0.3, 0.2)), turned), {})
    found = bones(data)
    assert set(found) == {"Head", "LeftEye", "RightEye"}
    head = unity_matrix(tuple(found["Head"][3:]))  # type: ignore[arg-type]
    np.testing.assert_allclose(head, MIRROR @ turned @ MIRROR, atol=1e-6)
    assert found["LeftEye"] == found["RightEye"]
    forward = unity_matrix(tuple(found["LeftEye"][3:])) @ [0, 0, 1]  # type: ignore[arg-type]
    wanted = [-np.sin(0.3) * np.cos(0.2), np.sin(0.2), np.cos(0.3) * np.cos(0.2)]
    np.testing.assert_allclose(forward, wanted, atol=1e-6)
    assert blend_values(data)["EyeLookOutLeft"] > 0


def test_an_unknown_unit_is_named() -> None:
    with pytest.raises(InputError, match=r"unit: expected one of the 52 .* got jawDrop"):
        encode_face(moment(), {"jawDrop": 1.0})
