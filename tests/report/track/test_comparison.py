from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marbled import GENERIC
from mien.arrays import Array
from mien.camera import Camera
from mien.errors import InputError
from mien.head import Head
from mien.render.picture import HeadRenderer
from mien.report.track.comparison import draw_tracked_head, face_mask, face_psnr
from mien.track.state import Track, TrackedFrame
from posable import head
from tracks import LAYOUT, random_state, track_of

GREEN = (20, 200, 60)


@pytest.fixture(scope="module")
def renderer() -> HeadRenderer:
    return HeadRenderer(head())


@pytest.fixture
def track(rng: np.random.Generator) -> Track:
    return track_of([random_state(rng), None], rng)


def filmed(renderer: HeadRenderer, track: Track, found: TrackedFrame) -> Array:
    """The frame exactly as it is said to have been found, before a green wall."""
    assert found.state is not None
    state = found.state.face(LAYOUT)
    picture = renderer.draw(state, track.camera(found.state), background=GREEN)[..., :3]
    colours = np.clip(np.rint(picture * found.gain + found.bias), 0, 255).astype(np.uint8)
    wall = (picture == GREEN).all(axis=2)
    colours[wall] = GREEN
    return colours


def test_an_exact_track_is_drawn_exactly(renderer: HeadRenderer, track: Track) -> None:
    found = track.frames[0]
    drawn = draw_tracked_head(renderer, track, found)
    assert drawn is not None
    frame = filmed(renderer, track, found)
    assert drawn.mask.mean() > 0.05
    assert face_psnr(frame, drawn.picture, drawn.mask) > 60
    np.testing.assert_array_equal(drawn.blended_over(frame), frame)


def test_only_the_face_is_drawn_over_a_frame(renderer: HeadRenderer, track: Track) -> None:
    drawn = draw_tracked_head(renderer, track, track.frames[0])
    assert drawn is not None
    frame = np.full((track.height, track.width, 3), GREEN, np.uint8)
    over = drawn.blended_over(frame)
    np.testing.assert_array_equal(over[~drawn.mask], frame[~drawn.mask])
    whole = (over == drawn.picture[..., :3]).all(axis=2) & drawn.mask
    assert 0.5 < whole.sum() / drawn.mask.sum() < 0.95, "softly bordered"


def test_a_part_of_a_frame(renderer: HeadRenderer, track: Track) -> None:
    found = track.frames[0]
    assert found.state is not None
    camera = track.camera(found.state)
    right = replace(camera, width=400, principal_px=camera.principal - [240, 0])
    whole, part = (draw_tracked_head(renderer, track, found, item) for item in (camera, right))
    assert whole is not None
    assert part is not None
    np.testing.assert_array_equal(part.mask, whole.mask[:, 240:])


def test_nothing_is_drawn_where_it_is_lost(renderer: HeadRenderer, track: Track) -> None:
    assert draw_tracked_head(renderer, track, track.frames[1]) is None


def test_face_mask_contains_the_visible_face() -> None:
    made: Head = head()
    facing = Camera(260, 260, 400.0, np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0, 600]))
    inside = face_mask(made.mesh, facing)
    vertices = made.mesh.vertices

    def seen(vertex: Array) -> bool:
        column, row = facing.project(vertex[None])[0].astype(int)
        return bool(inside[row, column])

    for name in ("nose_tip", "chin", "left_eyebrow_upper.2", "upper_lip_outer.4"):
        assert seen(vertices[GENERIC.vertex_of(name)]), name
    for name in ("left_ear.3", "right_ear.3"):
        assert not seen(vertices[GENERIC.vertex_of(name)]), name
    for part in ("left_eyeball", "right_eyeball"):
        assert seen(vertices[GENERIC.mesh.vertices_of(part)].mean(axis=0)), part
    assert not seen(vertices[vertices[:, 1].argmax()])
    assert not seen(vertices[vertices[:, 1].argmin()])


def test_psnr_of_a_known_difference() -> None:
    frame = np.full((4, 6, 3), 100, np.uint8)
    drawn = np.full((4, 6, 4), 116, np.uint8)
    mask = np.zeros((4, 6), bool)
    mask[1:3, 2:4] = True
    drawn[~mask] = 255
    assert face_psnr(frame, drawn, mask) == pytest.approx(20 * np.log10(255 / 16))
    assert np.isnan(face_psnr(frame, drawn, np.zeros((4, 6), bool)))


def test_sizes_must_agree(renderer: HeadRenderer, track: Track) -> None:
    frame, mask = np.zeros((4, 6, 3), np.uint8), np.ones((4, 6), bool)
    with pytest.raises(InputError, match="drawn: expected 6x4 px, got 5x4"):
        face_psnr(frame, frame[:, :5], mask)
    drawn = draw_tracked_head(renderer, track, track.frames[0])
    assert drawn is not None
    with pytest.raises(InputError, match="pixels: expected 640x360 px, got 6x4"):
        drawn.blended_over(frame)
