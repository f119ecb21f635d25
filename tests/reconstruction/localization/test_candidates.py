"""Where a head might be in a photo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marbled import GENERIC, Person, at, clutter
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.numeric.rotation import angle_between
from mien.reconstruction.localization.candidates import Look, find_looks, find_starts
from mien.reconstruction.localization.gallery import Gallery

Known = list[tuple[CapturedView, Camera]]


@pytest.fixture(scope="module")
def gallery(ann: Person, frontal: Known) -> Gallery:
    return Gallery(frontal, ann.vertices, GENERIC)


@pytest.fixture(scope="module")
def looks(gallery: Gallery) -> tuple[Look, ...]:
    return find_looks(gallery)


def test_a_look_shows_the_whole_head(looks: tuple[Look, ...], gallery: Gallery) -> None:
    for look in looks:
        pixels = look.camera.project(gallery.corners)
        size = np.array([look.camera.width, look.camera.height])
        assert ((pixels > 0) & (pixels < size)).all()
        found = look.camera.project(gallery.center[None])[0]
        np.testing.assert_allclose(found, look.camera.principal, atol=1e-6)


@pytest.mark.parametrize(("yaw", "pitch", "roll"), [(75, 0, 0), (-55, 15, 30), (-90, -10, -100)])
def test_first_start_lies_within_reach(
    looks: tuple[Look, ...], gallery: Gallery, ann: Person, yaw: int, pitch: int, roll: int
) -> None:
    """Whichever way the photo is turned."""
    true = at(yaw, pitch, roll)
    grey = ann.seen_by(true).photo.pixels[..., 0]
    template = replace(at(0), focal_px=1.1 * true.focal_px)
    start = find_starts(grey, template, looks, gallery.center)[0]
    assert np.degrees(angle_between(start.R_cam_head, true.R_cam_head)) < 25
    assert np.abs(start.project(gallery.corners) - true.project(gallery.corners)).mean() < 20
    assert start.focal_px == template.focal_px


def test_nothing_to_start_from(looks: tuple[Look, ...], gallery: Gallery) -> None:
    plain = np.full((200, 200), 90, np.uint8)
    assert find_starts(plain, at(0), looks, gallery.center) == []
    noise = clutter(200, 200, 3).astype(np.uint8)
    assert len(find_starts(noise, at(0), looks, gallery.center)) <= 4
