"""Where a head might be in a photo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marbled import GENERIC, Person, at, clutter
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.numeric.rotation import angle_between
from mien.reconstruction.localization.initial_cameras import (
    ReferenceView,
    initial_cameras,
    reference_views,
)
from mien.reconstruction.localization.photo_renderer import PhotoRenderer

Known = list[tuple[CapturedView, Camera]]


@pytest.fixture(scope="module")
def renderer(ann: Person, frontal: Known) -> PhotoRenderer:
    return PhotoRenderer(frontal, ann.vertices, GENERIC)


@pytest.fixture(scope="module")
def references(renderer: PhotoRenderer) -> tuple[ReferenceView, ...]:
    return reference_views(renderer)


def test_a_look_shows_the_whole_head(
    references: tuple[ReferenceView, ...], renderer: PhotoRenderer
) -> None:
    for reference in references:
        pixels = reference.camera.project(renderer.corners)
        size = np.array([reference.camera.width, reference.camera.height])
        assert ((pixels > 0) & (pixels < size)).all()
        found = reference.camera.project(renderer.center[None])[0]
        np.testing.assert_allclose(found, reference.camera.principal, atol=1e-6)


@pytest.mark.parametrize(("yaw", "pitch", "roll"), [(75, 0, 0), (-55, 15, 30), (-90, -10, -100)])
def test_first_start_lies_within_reach(
    references: tuple[ReferenceView, ...],
    renderer: PhotoRenderer,
    ann: Person,
    yaw: int,
    pitch: int,
    roll: int,
) -> None:
    """Whichever way the photo is turned."""
    true = at(yaw, pitch, roll)
    grey = ann.seen_by(true).photo.pixels[..., 0]
    template = replace(at(0), focal_px=1.1 * true.focal_px)
    start = initial_cameras(grey, template, references, renderer.center)[0]
    assert np.degrees(angle_between(start.R_cam_head, true.R_cam_head)) < 25
    assert np.abs(start.project(renderer.corners) - true.project(renderer.corners)).mean() < 20
    assert start.focal_px == template.focal_px


def test_nothing_to_start_from(
    references: tuple[ReferenceView, ...], renderer: PhotoRenderer
) -> None:
    plain = np.full((200, 200), 90, np.uint8)
    assert initial_cameras(plain, at(0), references, renderer.center) == []
    noise = clutter(200, 200, 3).astype(np.uint8)
    assert len(initial_cameras(noise, at(0), references, renderer.center)) <= 4
