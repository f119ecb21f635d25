from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.errors import InputError
from mien.texture.atlas import atlas_surface
from mien.texture.cylinder import cylinder_surface, fit_cylinder
from mien.texture.visibility import feather, prepare_view, surface_visibility
from shapes import camera_at, ellipsoid, with_nose

GREY = np.full((320, 320, 3), 128, np.uint8)


def test_what_the_nose_hides_is_invisible() -> None:
    mesh = with_nose(ellipsoid())
    camera = camera_at(40, mesh)
    surface = atlas_surface(mesh, width=400, height=200)
    seen = surface_visibility(surface, prepare_view(mesh, camera, GREY), feather_mm=0.1)
    bare = mesh.submesh(mesh.triangles_of("skin"))
    alone = surface_visibility(surface, prepare_view(bare, camera, GREY), feather_mm=0.1)
    # Texels whose ray to the camera goes through the ball, at least 8 mm deep.
    to = surface.points - [0, 0, 105]
    direction = camera.center - surface.points
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    across = np.linalg.norm(np.cross(to, direction), axis=2)
    behind = (across < 16) & (np.einsum("hwc,hwc->hw", to, direction) < 0)
    skin = np.zeros(surface.mask.shape, bool)
    skin[:, :300] = True
    facing = skin & behind & (seen.certainty > 0.5)
    assert facing.sum() > 50
    assert not seen.feathered[facing].any()
    assert (alone.feathered[facing] > 0).all()


def test_certainty_is_the_cosine_towards_the_camera() -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh)
    surface = atlas_surface(mesh, width=100, height=80)
    seen = surface_visibility(surface, prepare_view(mesh, camera, GREY))
    to_camera = camera.center - surface.points
    to_camera /= np.linalg.norm(to_camera, axis=2, keepdims=True)
    expected = np.einsum("hwc,hwc->hw", surface.normals, to_camera).clip(0)
    np.testing.assert_allclose(seen.certainty, expected, atol=1e-5)
    assert not seen.feathered[seen.certainty < 0.1].any()
    np.testing.assert_allclose(seen.feathered[seen.certainty > 0.6], 1, atol=1e-6)


@pytest.mark.parametrize("least", [0.17, 0.4, 0.7])
def test_surfaces_below_the_minimal_certainty_are_invisible(least: float) -> None:
    mesh = ellipsoid()
    surface = atlas_surface(mesh, width=100, height=80)
    view = prepare_view(mesh, camera_at(0, mesh), GREY)
    seen = surface_visibility(surface, view, feather_mm=0, min_certainty=least)
    assert not seen.feathered[seen.certainty < least].any()
    # Steeper, neighbouring pixels lie too far apart to be one layer's.
    facing = seen.certainty > max(least, 0.4)
    np.testing.assert_array_equal(seen.feathered[facing], 1)


def test_points_outside_the_photo_are_invisible_and_its_border_is_feathered() -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh)
    # The right half of the photo is cut away: it shows x < 0 only.
    half = replace(camera, width=160)
    surface = cylinder_surface(mesh, fit_cylinder(mesh), width=256, height=128)
    seen = surface_visibility(surface, prepare_view(mesh, half, GREY[:, :160]), feather_mm=10)
    front = surface.points[64, 128 - 40 : 128 + 40, 0], seen.feathered[64, 128 - 40 : 128 + 40]
    x, weight = front
    assert not weight[x > 1].any()
    assert (np.diff(weight[(x > -12) & (x < 0)]) < 0).all()
    np.testing.assert_allclose(weight[(x < -14) & (x > -40)], 1, atol=1e-6)


def test_outlines_and_unusable_pixels_do_not_count() -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh)
    person = np.ones((320, 320), bool)
    person[:100] = False
    view = prepare_view(mesh, camera, GREY, subject=person, outline_mm=10)
    inside = np.isfinite(view.depth)
    assert not view.usable[:100].any()
    assert not (view.usable & ~inside).any()
    pixel_mm = 2 * 75 / inside[160].sum()
    middle_row = np.flatnonzero(view.usable[160])
    lost = (inside[160].sum() - len(middle_row)) / 2 * pixel_mm
    assert lost == pytest.approx(10, abs=1)


def test_fine_photos_are_halved_to_the_size_of_the_texels() -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh, size=1200)
    photo = np.zeros((1200, 1200, 3), np.uint8)
    pixel_mm = np.linalg.norm(camera.center) / camera.focal_px
    view = prepare_view(mesh, camera, photo, texel_mm=2.2 * pixel_mm)
    assert view.photo.shape == (600, 600, 3)
    points = mesh.vertices[:10]
    np.testing.assert_allclose(view.camera.project(points), camera.project(points) / 2, atol=1e-9)
    same = prepare_view(mesh, camera, photo, texel_mm=1.2 * pixel_mm)
    assert same.photo.shape == (1200, 1200, 3)


def test_the_ramp_is_the_cubic_and_level_at_both_ends() -> None:
    visible = np.zeros((5, 60), bool)
    visible[:, 10:] = True
    ramp = feather(visible, 20)[2]
    t = np.clip((np.arange(60) - 9 - 0.5) / 20, 0, 1)
    np.testing.assert_allclose(ramp, t * t * (3 - 2 * t), atol=1e-5)
    assert not ramp[:10].any()
    assert ramp[10] < 0.01
    assert np.abs(np.diff(ramp, 2)).max() < 2 * 6 / 20**2
    assert (ramp[32:] == 1).all()


def test_the_ramp_goes_around_where_the_ends_touch() -> None:
    visible = np.ones((5, 60), bool)
    visible[:, 0] = False
    assert feather(visible, 8)[2, 59] == 1
    assert feather(visible, 8, wrap=True)[2, 59] == feather(visible, 8)[2, 1] < 0.1
    np.testing.assert_array_equal(feather(visible, 0), visible)


def test_bad_input_is_refused() -> None:
    mesh = ellipsoid()
    with pytest.raises(InputError, match="photo: expected 320x320 px as its camera says, got 10x"):
        prepare_view(mesh, camera_at(0, mesh), np.zeros((20, 10, 3), np.uint8))
    view = prepare_view(mesh, camera_at(0, mesh), GREY)
    surface = atlas_surface(mesh, width=50, height=50)
    with pytest.raises(InputError, match="tolerance_mm: expected a number above zero"):
        surface_visibility(surface, view, tolerance_mm=0)
