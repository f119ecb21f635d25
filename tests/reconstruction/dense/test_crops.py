from __future__ import annotations

from dataclasses import replace

import numpy as np

from marbled import GENERIC, Person, at
from mien.numeric.raster.rasterizer import interpolate
from mien.reconstruction.dense.crops import crop_view, finest_mm_per_px, visible_mesh

MESH = visible_mesh(GENERIC, GENERIC.mesh.vertices)
CAMERA = at(10)
VIEW = Person(GENERIC.mesh.vertices, 0).seen_by(CAMERA)


def test_places_of_the_crop_are_those_of_the_photo() -> None:
    crop = crop_view(VIEW, CAMERA, MESH, 1.5)
    assert crop is not None
    points = MESH.vertices[::97]
    there = crop.to_photo(crop.camera.project(points))
    assert np.abs(there - CAMERA.project(points)).max() < 0.8
    assert crop.grey.shape == crop.raster.triangle_ids.shape
    assert abs(crop.scale.mean() * 1.5 * CAMERA.focal_px / CAMERA.t_cam_head[2] - 1) < 0.05


def test_the_surface_behind_a_pixel_is_what_the_photo_shows_there() -> None:
    """Also where a whole number of pixels makes the crop a little wider than its scale says."""
    for mm_per_px in (0.8, 1.1, 1.6, 2.3):
        crop = crop_view(VIEW, CAMERA, MESH, mm_per_px)
        assert crop is not None
        rows, columns = np.nonzero(crop.raster.mask)
        points = interpolate(crop.raster, MESH.triangles, MESH.vertices)[rows, columns]
        there = crop.to_photo(np.column_stack([columns, rows]) + 0.5)
        np.testing.assert_allclose(CAMERA.project(points), there, atol=0.01)


def test_no_finer_than_the_photo() -> None:
    crop = crop_view(VIEW, CAMERA, MESH, 0.01)
    assert crop is not None
    np.testing.assert_allclose(crop.scale, 1)
    x, y = crop.corner.astype(int)
    height, width = crop.grey.shape
    np.testing.assert_array_equal(crop.grey, VIEW.photo.pixels[y : y + height, x : x + width, 0])
    expected = CAMERA.t_cam_head[2] / CAMERA.focal_px
    np.testing.assert_allclose(finest_mm_per_px([CAMERA]), expected)


def test_a_head_that_is_not_in_the_photo() -> None:
    away = replace(CAMERA, t_cam_head=CAMERA.t_cam_head + np.array([3000.0, 0, 0]))
    assert crop_view(VIEW, away, MESH, 1.0) is None
    behind = replace(CAMERA, t_cam_head=np.array([0.0, 0.0, -900.0]))
    assert crop_view(VIEW, behind, MESH, 1.0) is None


def test_hair_cap_and_lashes_do_not_hide_the_face() -> None:
    names = {MESH.part_names[part] for part in np.unique(MESH.part)}
    assert names == {"skin", "left_eyeball", "right_eyeball"}
