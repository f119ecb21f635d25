from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.mesh import Mesh
from mien.texture.atlas import atlas_surface, fill_gutters
from mien.texture.surface import cropped, mirrored, part_mask, restricted
from shapes import ellipsoid, with_nose


def test_texels_know_their_place_on_the_surface() -> None:
    mesh = ellipsoid()
    surface = atlas_surface(mesh, width=96, height=64)
    rows, columns = np.nonzero(surface.mask)
    corners = mesh.uvs[mesh.uv_triangles[surface.triangle_ids[rows, columns]]]
    uvs = np.einsum("nc,ncd->nd", surface.barycentrics[rows, columns], corners)
    np.testing.assert_allclose(uvs[:, 0] * 96, columns + 0.5, atol=1e-3)
    np.testing.assert_allclose((1 - uvs[:, 1]) * 64, rows + 0.5, atol=1e-3)
    points = mesh.vertices[mesh.triangles[surface.triangle_ids[rows, columns]]]
    expected = np.einsum("nc,ncd->nd", surface.barycentrics[rows, columns], points)
    np.testing.assert_allclose(surface.points[rows, columns], expected, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=2)[surface.mask], 1, atol=1e-5)


def test_the_size_of_a_texel() -> None:
    square = np.array([[0.0, 0, 0], [50, 0, 0], [50, 50, 0], [0, 50, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = Mesh(square, triangles, square[:, :2] / 50, triangles)
    assert atlas_surface(mesh, width=100, height=100).texel_mm == pytest.approx(0.5, rel=1e-4)


def test_mask_of_a_part() -> None:
    mesh = with_nose(ellipsoid())
    surface = atlas_surface(mesh, width=200, height=100)
    nose = part_mask(surface, mesh, "nose", "no such part")
    columns = np.flatnonzero(nose.any(axis=0))
    assert (columns[0], columns[-1]) == (160, 199)
    only = restricted(cropped(surface, np.s_[:, 150:]), nose[:, 150:])
    assert only.triangle_ids.shape == (100, 50)
    np.testing.assert_array_equal(only.mask, nose[:, 150:])


def test_the_mirrored_surface_is_the_other_side() -> None:
    mesh = ellipsoid()
    index = np.arange(len(mesh.vertices)).reshape(41, 81)
    mirror = index[:, ::-1].copy()
    mirror[:, 0] = index[:, 0]
    surface = atlas_surface(mesh, width=80, height=60)
    other = mirrored(surface, mesh, mirror.ravel())
    inside = surface.mask & (np.abs(surface.points[..., 0]) > 5)
    np.testing.assert_allclose(other.points[inside], surface.points[inside] * [-1, 1, 1], atol=1e-3)
    with pytest.raises(InputError, match="mirror: expected 3321 indices"):
        mirrored(surface, mesh, np.zeros(5, int))


def test_gutters_take_the_nearest_colour() -> None:
    inside = np.zeros((20, 30), bool)
    inside[5:10, 5:10] = inside[5:10, 20:25] = True
    pixels = np.zeros((20, 30, 3), np.uint8)
    pixels[:, :15], pixels[:, 15:] = [10, 20, 30], [200, 100, 50]
    filled = fill_gutters(pixels * inside[..., None].astype(np.uint8), inside)
    np.testing.assert_array_equal(filled, pixels)


def test_bad_input_is_refused() -> None:
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="mesh: expected one with texture coordinates"):
        atlas_surface(mesh)
    with pytest.raises(InputError, match="inside: expected at least one pixel, got none"):
        fill_gutters(np.zeros((2, 2, 3)), np.zeros((2, 2), bool))
    dot = Mesh(np.eye(3), np.array([[0, 1, 2]]), np.full((3, 2), 0.5), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="surface: expected neighbouring texels"):
        atlas_surface(dot, width=4, height=4)
