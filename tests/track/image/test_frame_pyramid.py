"""Cut-outs of a frame: where their pixels are, and which of them tell something."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from mien.arrays import Array
from mien.camera import Camera
from mien.track.image.frame_pyramid import FrameCrop, crop_pyramid

CAMERA = Camera(320, 240, 500.0, np.diag([1.0, -1.0, -1.0]), np.array([10.0, 5.0, 700.0]))
FACE = np.array([[100.0, 60.0], [220.0, 190.0]])


def frame(value: int = 100) -> Array:
    return np.full((240, 320, 3), value, np.uint8)


def cut(pixels: Array, points: Array = FACE, *, face_px: float = 60.0) -> list[FrameCrop]:
    return crop_pyramid(pixels, CAMERA, points, face_px=face_px, levels=3)


def spot(crop: FrameCrop) -> Array:
    """(2,) px: centre of what is bright."""
    bright = crop.pixels[..., 0].astype(np.float64) * crop.valid
    rows, columns = np.indices(bright.shape) + 0.5
    return np.array([(bright * columns).sum(), (bright * rows).sum()]) / bright.sum()


def test_a_place_is_seen_where_the_view_says(rng: np.random.Generator) -> None:
    for _ in range(5):
        place = np.array([*rng.uniform(-50, 50, 2), 20.0])
        at = CAMERA.project(place[None])[0]
        pixels = frame(0)
        low = np.floor(at - 8).astype(int)
        rows, columns = np.mgrid[low[1] : low[1] + 17, low[0] : low[0] + 17]
        away = np.hypot(columns + 0.5 - at[0], rows + 0.5 - at[1])
        pixels[rows, columns] = (200 * np.exp(-((away / 3) ** 2)))[..., None]
        seen = CAMERA.to_camera(place[None])[0]
        for crop in cut(pixels):
            expected = crop.focal * seen[:2] / seen[2] + (crop.cx, crop.cy)
            np.testing.assert_allclose(spot(crop), expected, atol=0.1)


def test_each_view_is_half_of_the_one_before() -> None:
    views = cut(frame())
    for large, small in pairwise(views):
        assert large.size == (2 * small.size[0], 2 * small.size[1])
        assert large.focal == pytest.approx(2 * small.focal)
        assert (large.cx, large.cy) == pytest.approx((2 * small.cx, 2 * small.cy))


@pytest.mark.parametrize(("face_px", "scale"), [(100, 1), (60, 0.5), (30, 0.25), (200, 1)])
def test_a_large_face_is_halved_until_it_is_near_the_size(face_px: float, scale: float) -> None:
    assert cut(frame(), face_px=face_px)[0].focal == pytest.approx(scale * CAMERA.focal_px)


def test_a_small_face_stays_as_it_is() -> None:
    points = np.array([[150.0, 100.0], [190.0, 140.0]])
    assert cut(frame(), points)[0].focal == pytest.approx(CAMERA.focal_px)


def test_a_face_that_moves_a_little_leaves_the_pixels_where_they_are() -> None:
    before, after = cut(frame()), cut(frame(), FACE + 0.4)
    for one, other in zip(before, after, strict=True):
        moved = np.array([one.cx - other.cx, one.cy - other.cy])
        np.testing.assert_allclose(moved, np.rint(moved), atol=1e-9)


@pytest.mark.parametrize("shift", [(-150, 0), (160, 0), (0, -130), (0, 140), (-150, 140)])
def test_beyond_the_frame_nothing_is_told(shift: tuple[int, int]) -> None:
    whole = cut(frame())
    for crop, inner in zip(cut(frame(), FACE + shift), whole, strict=True):
        # The frame's own rectangle, in px of the view.
        scale = crop.focal / CAMERA.focal_px
        corner = np.array([crop.cx, crop.cy]) - scale * CAMERA.principal
        columns, rows = np.arange(crop.size[0]) + 0.5, np.arange(crop.size[1]) + 0.5
        across = (columns > corner[0]) & (columns < corner[0] + 320 * scale)
        down = (rows > corner[1]) & (rows < corner[1] + 240 * scale)
        expected = down[:, None] & across
        assert 0.1 < expected.mean() < 1
        np.testing.assert_array_equal(crop.valid > 0.5, expected)
        np.testing.assert_allclose(crop.pixels, 100, atol=1e-3)
        assert inner.valid.min() == 1


def test_colours_that_are_cut_off_do_not_tell() -> None:
    pixels = frame()
    pixels[100:132, 120:152, 1] = 255
    for crop in cut(pixels):
        scale = crop.focal / CAMERA.focal_px
        lost = (1 - crop.valid).sum() / scale**2
        assert lost == pytest.approx(32 * 32, rel=0.02)
        assert crop.pixels[crop.valid == 1].max() == pytest.approx(100, abs=1e-3)
