from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.mesh import Mesh
from mien.texture.cylinder import Cylinder, cylinder_surface, fit_cylinder
from shapes import RADII, ellipsoid, with_cylinder_uvs, with_nose


def test_the_cylinder_stands_around_the_middle_of_the_head() -> None:
    mesh = ellipsoid()
    cylinder = fit_cylinder(mesh.with_vertices(mesh.vertices + np.array([5, 10, -20])))
    assert cylinder.axis_x == pytest.approx(5, abs=0.01)
    assert cylinder.axis_z == pytest.approx(-20, abs=0.01)
    assert (cylinder.bottom, cylinder.top) == pytest.approx((10 - RADII[1], 10 + RADII[1]))


def test_coordinates_run_from_the_right_ear_over_the_face_to_the_left() -> None:
    cylinder = Cylinder(0, 0, -100, 100)
    points = np.array([[-1.0, 0, 0], [0, 50, 1], [1, -100, 0], [0.001, 100, -1], [-0.001, 100, -1]])
    expected = [[0.25, 0.5], [0.5, 0.75], [0.75, 0], [1, 1], [0, 1]]
    np.testing.assert_allclose(cylinder.uvs(points), expected, atol=1e-3)


def test_points_lie_on_the_ellipsoid_and_on_their_rays() -> None:
    mesh = ellipsoid(120, 240)
    cylinder = fit_cylinder(mesh)
    surface = cylinder_surface(mesh, cylinder, width=128, height=64)
    assert surface.mask.all()
    # A facet's deepest point lies its sagitta below the ellipsoid.
    level = np.linalg.norm(surface.points / RADII, axis=2)
    assert (level <= 1 + 1e-6).all()
    assert (level > 1 - 5e-4).all()
    rows, columns = np.mgrid[:64, :128]
    uvs = cylinder.uvs(surface.points.astype(np.float64))
    np.testing.assert_allclose(uvs[..., 0], (columns + 0.5) / 128, atol=1e-5)
    np.testing.assert_allclose(uvs[..., 1], 1 - (rows + 0.5) / 64, atol=1e-5)
    normals = surface.points / RADII**2
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    assert np.einsum("hwc,hwc->hw", normals, surface.normals)[4:-4].min() > 0.999


def test_rays_hit_what_a_brute_force_search_hits(rng: np.random.Generator) -> None:
    mesh = with_nose(ellipsoid(12, 16))
    tilted = mesh.vertices @ np.linalg.qr(rng.normal(size=(3, 3)))[0]  # The axis hits no vertex.
    mesh = mesh.with_vertices(tilted)
    cylinder = fit_cylinder(mesh)
    surface = cylinder_surface(mesh, cylinder, width=90, height=60)
    for row, column in zip(rng.integers(0, 60, 150), rng.integers(0, 90, 150), strict=True):
        angle = 2 * np.pi * (column + 0.5) / 90 - np.pi
        height = cylinder.top + (row + 0.5) / 60 * (cylinder.bottom - cylinder.top)
        axis = np.array([cylinder.axis_x, height, cylinder.axis_z])
        radius = farthest_hit(mesh, axis, np.array([np.sin(angle), 0, np.cos(angle)]))
        if radius is None:
            assert surface.triangle_ids[row, column] == -1
        else:
            found = np.linalg.norm(surface.points[row, column] - axis)
            assert found == pytest.approx(radius, abs=1e-3)


def farthest_hit(mesh: Mesh, origin: np.ndarray, direction: np.ndarray) -> float | None:
    """By solving origin + r direction = a + s (b - a) + t (c - a) for every triangle."""
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]] for corner in range(3))
    columns = np.stack([np.broadcast_to(direction, a.shape), a - b, a - c], axis=2)
    solvable = np.abs(np.linalg.det(columns)) > 1e-9
    r, s, t = np.linalg.solve(columns[solvable], (a - origin)[solvable][..., None])[..., 0].T
    hits = r[(r > 0) & (s >= 0) & (t >= 0) & (s + t <= 1)]
    return float(hits.max()) if len(hits) else None


def test_only_the_chosen_parts_are_met() -> None:
    mesh = with_nose(ellipsoid())
    surface = cylinder_surface(mesh, fit_cylinder(mesh), width=64, height=32, parts=("nose",))
    assert 0 < surface.mask.mean() < 0.1
    assert set(mesh.part[surface.triangle_ids[surface.mask]]) == {1}


def test_texture_coordinates_of_triangles_across_the_seam_stay_together() -> None:
    mesh = ellipsoid()
    turn = np.array([[np.cos(0.02), 0, np.sin(0.02)], [0, 1, 0], [-np.sin(0.02), 0, np.cos(0.02)]])
    mesh = mesh.with_vertices(mesh.vertices @ turn)
    wrapped = with_cylinder_uvs(mesh, fit_cylinder(mesh))
    u = wrapped.uvs[wrapped.uv_triangles][..., 0]
    inner = np.abs(mesh.vertices[mesh.triangles][..., [0, 2]]).max(axis=(1, 2)) > 20
    assert np.ptp(u[inner], axis=1).max() < 0.2
    assert u.max() > 1


def test_a_mesh_without_triangles_is_refused() -> None:
    with pytest.raises(InputError, match="mesh: expected triangles to put a cylinder around"):
        fit_cylinder(Mesh(np.zeros((3, 3)), np.zeros((0, 3), np.int32)))
