"""A photo laid over the painted head."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marbled import GENERIC, Person, at, clutter
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.numeric.rotation import angle_between
from mien.reconstruction.localization.alignment import align, refine
from mien.reconstruction.localization.camera_refinement import FocalLengthPrior
from mien.reconstruction.localization.photo_renderer import PhotoRenderer

TRUE = at(65.0, 5.0)
BELIEF = FocalLengthPrior(TRUE.focal_px, 0.05)


@pytest.fixture(scope="module")
def renderer(ann: Person, frontal: list[tuple[CapturedView, Camera]]) -> PhotoRenderer:
    return PhotoRenderer(frontal, ann.vertices, GENERIC)


def test_under_the_true_camera_they_agree(renderer: PhotoRenderer, ann: Person) -> None:
    alignment = align(ann.seen_by(TRUE).photo.pixels, TRUE, renderer, 1.0)
    assert alignment is not None
    assert alignment.matching_fraction(1.5) > 0.9
    assert alignment.textured_mm2 > 10_000


def test_a_camera_that_is_off_is_put_right(renderer: PhotoRenderer, ann: Person) -> None:
    pixels, camera = ann.seen_by(TRUE).photo.pixels, at(57.0, 9.0, 6.0, distance=860.0)
    for _ in range(3):
        alignment = align(pixels, camera, renderer, 1.0)
        assert alignment is not None
        refined = refine(camera, alignment, 2.0, BELIEF)
        assert refined is not None
        camera = refined
    assert np.degrees(angle_between(camera.R_cam_head, TRUE.R_cam_head)) < 0.5
    assert np.abs(camera.project(ann.vertices) - TRUE.project(ann.vertices)).max() < 1.5


def test_clutter_does_not_agree(renderer: PhotoRenderer) -> None:
    image = clutter(TRUE.height, TRUE.width, 9).astype(np.uint8)
    alignment = align(np.repeat(image[..., None], 3, axis=2), TRUE, renderer, 1.0)
    assert alignment is not None
    assert alignment.matching_fraction(1.5) < 0.05


def test_a_plain_photo_moves_no_camera(renderer: PhotoRenderer) -> None:
    plain = np.full((TRUE.height, TRUE.width, 3), 90, np.uint8)
    alignment = align(plain, TRUE, renderer, 1.0)
    assert alignment is not None
    assert alignment.matching_fraction(99.0) < 0.05
    assert refine(TRUE, alignment, 2.0, BELIEF) is None


@pytest.mark.parametrize(
    "camera",
    [
        replace(TRUE, t_cam_head=TRUE.t_cam_head * [1, 1, 0.05]),
        replace(TRUE, t_cam_head=TRUE.t_cam_head + np.array([2000, 0, 0])),
        replace(TRUE, t_cam_head=TRUE.t_cam_head * 40),
    ],
    ids=["inside the head", "beside it", "far away"],
)
def test_a_camera_that_hardly_sees_the_head(renderer: PhotoRenderer, camera: Camera) -> None:
    pixels = np.zeros((TRUE.height, TRUE.width, 3), np.uint8)
    assert align(pixels, camera, renderer, 1.0) is None
