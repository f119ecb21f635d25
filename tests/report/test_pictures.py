from __future__ import annotations

import base64
import io

import numpy as np
import pytest
from PIL import Image

from mien.assets.generic import load_generic_head
from mien.head import Expression, Head
from mien.reconstruction.result import Mark, PhotoFit
from mien.report.pictures import coverage_pictures, overlay_picture, preview_pictures
from people import camera

GENERIC = load_generic_head()


@pytest.fixture(scope="module")
def head() -> Head:
    """Blue on its own left, red on its right."""
    mesh = GENERIC.mesh
    corner_side = mesh.vertices[mesh.triangles][..., 0].mean(axis=1) > 0
    uvs = mesh.uvs
    assert uvs is not None
    left = np.full(len(uvs), 0.25)
    left[mesh.uv_triangles[corner_side]] = 0.75
    texture = np.zeros((8, 64, 3), np.uint8)
    texture[:, :32, 0], texture[:, 32:, 2] = 255, 255
    painted = type(mesh)(
        mesh.vertices,
        mesh.triangles,
        np.column_stack([left, np.full(len(uvs), 0.5)]),
        mesh.uv_triangles,
        mesh.part,
        mesh.part_names,
    )
    return Head(
        "nobody",
        painted,
        {"neutral": Expression(mesh.vertices)},
        np.ones(len(mesh.vertices)),
        textures={"atlas": texture},
    )


def decoded(uri: str) -> np.ndarray:
    start = "data:image/jpeg;base64,"
    assert uri.startswith(start)
    with Image.open(io.BytesIO(base64.b64decode(uri.removeprefix(start)))) as image:
        return np.asarray(image).astype(int)


def share_of_left(picture: dict[str, str]) -> float:
    """How much of the head in a picture is its own left (blue) half."""
    pixels = decoded(picture["source"])
    red, blue = pixels[..., 0] > 150, pixels[..., 2] > 150
    return float(blue.sum() / (red | blue).sum())


def test_captions_name_the_side_that_is_seen(head: Head) -> None:
    shares = {picture["caption"]: share_of_left(picture) for picture in preview_pictures(head)}
    assert shares["left side"] > 0.95
    assert shares["right side"] < 0.05
    assert 0.6 < shares["left"] < 0.95
    assert 0.05 < shares["right"] < 0.4
    assert shares["front"] == pytest.approx(0.5, abs=0.05)
    assert shares["back"] == pytest.approx(0.5, abs=0.05)


def test_coverage_is_bright_where_photos_show_the_head(head: Head) -> None:
    coverage = np.zeros((8, 64))
    coverage[:, 32:] = 2.0
    pictures = {
        item["caption"]: decoded(item["source"]) for item in coverage_pictures(head, coverage)
    }
    assert list(pictures) == ["front", "left side", "back", "right side"]
    bright = {name: (pixels[..., 0] > 200).mean() for name, pixels in pictures.items()}
    assert bright["left side"] > 0.2
    assert bright["right side"] < 0.01
    assert bright["left side"] > bright["front"] > 0.05


def test_coverage_of_nothing(head: Head) -> None:
    for picture in coverage_pictures(head, np.zeros((8, 64))):
        assert (decoded(picture["source"])[..., 0] < 120).all()


def test_marks_are_joined_to_where_the_model_puts_them() -> None:
    seen_from = camera(0)
    used = Mark("nose_tip", np.array([100.0, 100.0]), np.array([80.0, 0.0]), True)
    wrong = Mark("chin", np.array([100.0, 300.0]), np.array([0.0, 80.0]), True, "far off")
    fit = PhotoFit(seen_from, (used, wrong))
    black = np.zeros((1300, 1000, 3), np.uint8)
    picture = decoded(overlay_picture(GENERIC.mesh, fit, black))
    scale = 900 / 1300
    assert picture.shape == (900, round(1000 * scale), 3)
    green = picture[..., 1] - picture[..., 0] > 60
    red = picture[..., 0] - picture[..., 1] > 60
    for colour, mark in ((green, used), (red, wrong)):
        middle = (mark.image_point + mark.residual_px / 2) * scale - 0.5
        for place in (mark.image_point * scale - 0.5, middle):
            x, y = np.rint(place).astype(int)
            assert colour[y - 1 : y + 2, x - 1 : x + 2].any(), mark.name


def test_a_small_photo_is_not_enlarged() -> None:
    seen_from = camera(0).resized(0.25)
    small = np.zeros((seen_from.height, seen_from.width, 3), np.uint8)
    assert (
        decoded(overlay_picture(GENERIC.mesh, PhotoFit(seen_from, ()), small)).shape == small.shape
    )
