"""Pictures painted with the colours of photos."""

from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC, Person, at
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.reconstruction.localization.photo_renderer import PhotoRenderer, reduced, resized_to

Known = list[tuple[CapturedView, Camera]]


@pytest.fixture(scope="module")
def renderer(ann: Person, frontal: Known) -> PhotoRenderer:
    return PhotoRenderer(frontal, ann.vertices, GENERIC)


def test_from_a_photos_own_place_the_photo_is_painted(
    renderer: PhotoRenderer, frontal: Known
) -> None:
    view, camera = frontal[1]
    rendering = renderer.render(camera)
    off = rendering.grey.astype(float) - view.photo.pixels[..., 0]
    assert rendering.visible.mean() > 0.15
    assert np.abs(off[rendering.visible]).mean() < 2


def test_between_the_photos_the_truth_is_painted(renderer: PhotoRenderer, ann: Person) -> None:
    camera = at(60.0, 5.0)
    rendering, photo = renderer.render(camera), ann.seen_by(camera).photo.pixels[..., 0]
    visible = rendering.visible
    assert visible.sum() > 0.5 * np.isfinite(rendering.points[..., 0]).sum()
    assert np.corrcoef(rendering.grey[visible], photo[visible])[0, 1] > 0.95


def test_places_are_those_behind_the_pixels(renderer: PhotoRenderer) -> None:
    camera = at(-75.0)
    rendering = renderer.render(camera)
    rows, columns = np.nonzero(rendering.visible)
    found = camera.project(rendering.points[rows, columns])
    np.testing.assert_allclose(found, np.column_stack([columns, rows]) + 0.5, atol=1e-2)


def test_nothing_is_known_of_the_back(renderer: PhotoRenderer) -> None:
    seen_from_behind = renderer.render(at(180.0))
    assert np.isfinite(seen_from_behind.points).any()
    assert seen_from_behind.visible.mean() < 0.02


def test_a_photo_that_shows_something_else_there_is_not_asked(ann: Person, frontal: Known) -> None:
    """The nose hides what is beyond from a camera on its other side."""
    left_only = PhotoRenderer(frontal[2:], ann.vertices, GENERIC).render(at(-30.0))
    both = PhotoRenderer(frontal, ann.vertices, GENERIC).render(at(-30.0))
    assert left_only.visible.sum() < 0.7 * both.visible.sum()


def test_reduced_photo_and_its_camera_agree() -> None:
    camera = at(20.0)
    grey = reduced(np.zeros((camera.height, camera.width, 3), np.uint8), 0.37)
    small = resized_to(camera, grey.shape)
    assert grey.shape == (small.height, small.width) == (166, 142)
    points = GENERIC.mesh.vertices
    scale = np.array([small.width / camera.width, small.height / camera.height])
    np.testing.assert_allclose(small.project(points), camera.project(points) * scale, atol=0.2)
    assert reduced(np.zeros((5, 7, 3), np.uint8), 3.0).shape == (5, 7)
