"""Simple meshes with known surfaces, for the tests of texture and rendering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mien.arrays import Array
from mien.camera import Camera
from mien.mesh import Mesh
from mien.render.orbit import orbit_camera
from mien.texture.cylinder import Cylinder

RADII = np.array([75.0, 110.0, 95.0])


def ellipsoid(rings: int = 40, sectors: int = 80) -> Mesh:
    """A head-sized ellipsoid around the origin, poles up and down, its seam at the back (-z).

    Texture coordinates are longitude and latitude.
    """
    u, v = np.meshgrid(np.linspace(0, 1, sectors + 1), np.linspace(1, 0, rings + 1))
    longitude, latitude = 2 * np.pi * (u - 0.5), np.pi * (v - 0.5)
    ring = np.cos(latitude)
    unit = np.stack([ring * np.sin(longitude), np.sin(latitude), ring * np.cos(longitude)], axis=2)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    quads = np.stack([a, c, d, a, d, b], axis=2).reshape(-1, 3)
    uv_triangles = quads.astype(np.int32)
    # The seam's vertices are one and the same, only their texture coordinates are two.
    joined = index.copy()
    joined[:, -1] = joined[:, 0]
    triangles = joined.ravel()[uv_triangles]
    uvs = np.column_stack([u.ravel(), v.ravel()])
    return Mesh(unit.reshape(-1, 3) * RADII, triangles, uvs, uv_triangles)


def with_nose(mesh: Mesh) -> Mesh:
    """The ellipsoid with a ball of 18 mm radius before its face, a part of its own."""
    ball = ellipsoid(16, 32)
    vertices = ball.vertices / RADII * 18 + [0, 0, 105]
    return Mesh(
        np.vstack([mesh.vertices, vertices]),
        np.vstack([mesh.triangles, ball.triangles + len(mesh.vertices)]),
        np.vstack([mesh.uvs * [0.75, 1], ball.uvs * [0.2, 1] + [0.8, 0]]),
        np.vstack([mesh.uv_triangles, ball.uv_triangles + len(mesh.uvs)]),
        np.repeat(np.array([0, 1], np.uint8), [len(mesh.triangles), len(ball.triangles)]),
        ("skin", "nose"),
    )


def smooth_texture(width: int = 512, height: int = 256) -> Array:
    """(H, W, 3) uint8 with detail of some 20 texels, that goes around without a seam."""
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    waves = [np.sin(2 * np.pi * (12 * u)) * np.cos(20 * v), np.cos(2 * np.pi * 5 * u + 15 * v)]
    waves.append(np.sin(2 * np.pi * (7 * u) - 25 * v))
    return np.rint(128 + 90 * np.stack(waves, axis=2)).astype(np.uint8)


def camera_at(yaw_deg: float, mesh: Mesh, *, size: int = 320, pitch_deg: float = 0.0) -> Camera:
    """A camera that sees the whole mesh from this side."""
    yaw, pitch = np.radians([yaw_deg, pitch_deg])
    return orbit_camera(yaw, pitch, width=size, height=size, vertices=mesh.vertices)


def with_cylinder_uvs(mesh: Mesh, cylinder: Cylinder) -> Mesh:
    """The mesh with the cylinder's texture coordinates, one to each corner of a triangle.

    Triangles across the seam get u beyond 1; texture lookups go around.
    """
    corners = cylinder.uvs(mesh.vertices)[mesh.triangles]
    u = corners[..., 0]
    corners[..., 0] = np.where(u - u.max(axis=1, keepdims=True) < -0.5, u + 1, u)
    indices = np.arange(corners.size // 2, dtype=np.int32).reshape(-1, 3)
    return replace(mesh, uvs=corners.reshape(-1, 2), uv_triangles=indices)
