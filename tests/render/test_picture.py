from __future__ import annotations

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.errors import InputError
from mien.head import Expression, FittedView, Head
from mien.render.morph import MorphRenderer
from mien.render.picture import HeadRenderer, render_head, turntable_frames
from mien.rig.state import FACE, FaceState, Gaze
from people import camera

GENERIC = load_generic_head()
MESH = GENERIC.mesh
AWED = MESH.vertices + 0.5 * GENERIC.unit_offsets[GENERIC.unit_names.index("jawOpen")]


@pytest.fixture(scope="module")
def head() -> Head:
    return Head(
        subject="nobody",
        mesh=MESH,
        expressions={
            "neutral": Expression(MESH.vertices, (FittedView("side.png", camera(30), 1.0, 13),)),
            "awe": Expression(AWED, (FittedView("awe/a.png", camera(0), 1.0, 13),), "awe"),
        },
        uncertainty_mm=np.ones(len(MESH.vertices)),
        unit_names=GENERIC.unit_names,
        unit_offsets=GENERIC.unit_offsets,
        textures={
            "atlas": np.full((16, 16, 3), (200, 100, 50), np.uint8),
            "awe": np.full((16, 16, 3), (60, 120, 180), np.uint8),
        },
    )


@pytest.fixture
def used(monkeypatch: pytest.MonkeyPatch) -> list[Camera]:
    """The cameras that pictures were rendered with; the pictures are empty."""
    cameras: list[Camera] = []

    def remember(self: object, face: object, camera: Camera, **options: object) -> object:
        cameras.append(camera)
        return np.zeros((camera.height, camera.width, 4), np.uint8)

    monkeypatch.setattr(MorphRenderer, "render", remember)
    return cameras


def place(seen_from: Camera, name: str) -> np.ndarray:
    return seen_from.project(MESH.vertices[[GENERIC.vertex_of(name)]])[0]


def test_yaw_turns_the_head_to_its_own_left(head: Head, used: list[Camera]) -> None:
    """Its left is the picture's right: there the nose points, and the right cheek comes to us."""
    for yaw in (0, 30, -30):
        render_head(head, yaw=np.radians(yaw))
    front, left, right = used
    # Of the width between the ears' lobes, where the nose's tip lies.
    share = []
    for seen_from in (front, left, right):
        near, nose, far = (
            place(seen_from, name)[0] for name in ("right_ear_lobe", "nose_tip", "left_ear_lobe")
        )
        share.append((nose - near) / (far - near))
    assert share[0] == pytest.approx(0.5, abs=0.01)
    assert share[1] > 0.8
    assert share[2] < 0.2
    assert left.center[0] < 0, "the camera stands on the subject's right"


def test_pitch_tips_the_head_down(head: Head, used: list[Camera]) -> None:
    for pitch in (0, 20):
        render_head(head, pitch=np.radians(pitch))
    level, down = (place(seen, "nose_tip")[1] - place(seen, "left_ear_lobe")[1] for seen in used)
    assert down > level + 50, "y is down"
    assert used[1].center[1] > 100, "the camera stands above"


def test_roll_tips_the_head_to_its_own_right_shoulder(head: Head, used: list[Camera]) -> None:
    render_head(head, roll=np.radians(20))
    right, left = (place(used[0], f"{side}_eye_outer") for side in ("right", "left"))
    across, down = right - left
    assert across < 0
    assert np.degrees(np.arctan2(down, -across)) == pytest.approx(20, abs=1)


@pytest.mark.parametrize("angles", [(0, 0, 0), (90, 0, 0), (180, 0, 0), (40, 30, 20)])
def test_the_whole_head_is_in_the_picture(
    angles: tuple[float, float, float], head: Head, used: list[Camera]
) -> None:
    yaw, pitch, roll = np.radians(angles)
    render_head(head, yaw=yaw, pitch=pitch, roll=roll, size=(320, 400))
    pixels = used[0].project(MESH.vertices)
    assert (pixels > 0).all()
    assert (pixels < [320, 400]).all()


def test_a_photos_camera_wins_over_size_and_angles(head: Head) -> None:
    seen_from = head.view("side.png").camera
    picture = render_head(head, photo="side.png", size=(20, 20), yaw=1.0)
    assert picture.shape == (seen_from.height, seen_from.width, 4)
    skin = np.unique(MESH.triangles[MESH.triangles_of("skin")])
    inside = np.rint(seen_from.project(MESH.vertices[skin])).astype(int)
    covered = np.argwhere(picture[..., 3] > 0)[:, ::-1]
    np.testing.assert_allclose(covered.min(axis=0), inside.min(axis=0), atol=2)
    np.testing.assert_allclose(covered.max(axis=0), inside.max(axis=0), atol=2)


def test_colours_and_alpha(head: Head) -> None:
    picture = render_head(head, size=(80, 100))
    assert picture.dtype == np.uint8
    assert picture[0, 0].tolist() == [0, 0, 0, 0]
    assert picture[50, 40, 3] == 255
    painted = render_head(head, size=(80, 100), background=(1, 2, 3))
    assert painted[0, 0].tolist() == [1, 2, 3, 255]
    assert (painted[..., 3] == 255).all()
    np.testing.assert_array_equal(painted[50, 40], picture[50, 40])


def test_a_state_is_what_the_rig_makes_of_it(head: Head) -> None:
    renderer = HeadRenderer(head)
    state = FaceState(
        {FACE: {"awe": 0.25}, "mouth": {"awe": -0.5}}, {"jawOpen": 0.5}, Gaze(0.3, 0.1)
    )
    size = (160, 200)
    face = renderer.rig.evaluate(state)
    drawn = MorphRenderer(head.mesh, renderer.rig.textures).render(
        face, renderer.camera(0.2, size=size)
    )
    for given in (head, renderer):
        picture = render_head(given, yaw=0.2, size=size, state=state)
        np.testing.assert_array_equal(picture, drawn)
    resting = render_head(renderer, yaw=0.2, size=size)
    assert (resting != drawn).any()


def test_one_expression_shows_its_own_texture(head: Head) -> None:
    whole = render_head(head, size=(80, 100), state=FaceState({FACE: {"awe": 1.0}}))
    half = render_head(head, size=(80, 100), state=FaceState({FACE: {"awe": 0.5}}))
    assert whole[40, 40].tolist() == [60, 120, 180, 255]
    assert half[40, 40].tolist() == [130, 110, 115, 255]


def test_a_photo_shows_the_expression_that_it_belongs_to(head: Head) -> None:
    awe = FaceState({FACE: {"awe": 1.0}})
    shown = render_head(head, photo="awe/a.png")
    np.testing.assert_array_equal(shown, render_head(head, photo="awe/a.png", state=awe))
    neutral = FaceState({FACE: {"neutral": 1.0}})
    other = render_head(head, photo="awe/a.png", state=neutral)
    assert (other[..., :3] != shown[..., :3]).any()
    resting = render_head(head, photo="side.png")
    np.testing.assert_array_equal(resting, render_head(head, photo="side.png", state=neutral))


def test_units_come_on_top_of_a_photos_expression(head: Head) -> None:
    blink = {"eyeBlinkLeft": 1.0}
    shown = render_head(head, photo="awe/a.png", state=FaceState(units=blink))
    told = FaceState({FACE: {"awe": 1.0}}, blink)
    np.testing.assert_array_equal(shown, render_head(head, photo="awe/a.png", state=told))


def test_units_do_not_change_the_framing(head: Head, used: list[Camera]) -> None:
    render_head(head)
    render_head(head, state=FaceState(units={"jawOpen": 1.0}))
    np.testing.assert_array_equal(used[0].t_cam_head, used[1].t_cam_head)


@pytest.mark.parametrize(
    ("state", "message"),
    [
        (FaceState(units={"jawopen": 1}), "unit: expected one of the head's, such as jawOpen"),
        (FaceState({FACE: {"aw": 1}}), "expression: expected one of the head's, such as awe"),
        (FaceState({"mouht": {"awe": 1}}), "region: expected one of the head's, such as mouth"),
        (FaceState({FACE: {"awe": 1.6}}), "weight of awe: expected -0.5 to 1.5, got 1.6"),
        (FaceState({FACE: {"awe": -0.6}}), "weight of awe: expected -0.5 to 1.5, got -0.6"),
    ],
)
def test_bad_states_are_refused(head: Head, state: FaceState, message: str) -> None:
    with pytest.raises(InputError, match=message):
        render_head(head, state=state)


def test_an_unknown_photo(head: Head) -> None:
    with pytest.raises(InputError, match=r"photos \(side\.png, awe/a\.png\), got front\.png"):
        render_head(head, photo="front.png")


def test_a_turntable_goes_once_around(head: Head, used: list[Camera]) -> None:
    frames = list(turntable_frames(head, frames=4, size=(48, 60)))
    assert [frame.shape for frame in frames] == [(60, 48, 3)] * 4
    middle = (MESH.vertices.min(axis=0) + MESH.vertices.max(axis=0)) / 2
    azimuth = [np.arctan2(*(seen.center - middle)[[0, 2]]) for seen in used]
    turned = np.degrees(np.unwrap(azimuth))
    np.testing.assert_allclose(turned - turned[0], [0, 90, 180, 270], atol=1e-6)
    assert turned[0] == pytest.approx(0, abs=1e-6)


def test_a_picture_that_is_too_large_is_refused_before_it_is_made(head: Head) -> None:
    with pytest.raises(InputError, match="size: expected at most 8192 px a side, got 9000x10"):
        render_head(head, size=(9000, 10))
