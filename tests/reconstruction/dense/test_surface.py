from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from marbled import GENERIC, Person, at
from mien.arrays import Array
from mien.camera import Camera
from mien.mesh import Mesh
from mien.reconstruction.dense.crops import visible_mesh
from mien.reconstruction.dense.surface import measure_offsets, move_surface, sample_heights
from mien.reconstruction.dense.tracks import Tracks
from mien.reconstruction.shape.deformation import eye_centers

CAMERAS = (at(-25), at(0), at(25))


def seen_exactly(truth: Array, mesh: Mesh, cameras: Sequence[Camera], count: int = 4000) -> Tracks:
    """Places of the mesh, and where the cameras would see those of the true head."""
    rng = np.random.default_rng(0)
    front = mesh.triangles[(mesh.vertices[mesh.triangles][..., 2] > -10).all(axis=1)]
    corners = front[rng.integers(len(front), size=count)]
    shares = rng.dirichlet(np.ones(3), size=count)
    points = np.einsum("nc,ncd->nd", shares, truth[corners])
    photos = len(cameras)
    return Tracks(
        corners=corners,
        barycentrics=shares,
        reference=np.zeros(count, int),
        photo=np.repeat(np.arange(photos), count),
        point=np.tile(np.arange(count), photos),
        image_points=np.concatenate([camera.project(points) for camera in cameras]),
        sigma_px=np.full(photos * count, 0.05),
        overlap=np.ones(count),
    )


@pytest.fixture(scope="module")
def swollen() -> Array:
    """The generic head with a smooth bump of 2 mm on one cheek and 1 mm everywhere."""
    mesh = GENERIC.mesh
    bump = np.exp(-((mesh.vertices - [35.0, -45.0, 20.0]) ** 2).sum(axis=1) / (2 * 20.0**2))
    return mesh.vertices + (1 + 2 * bump)[:, None] * mesh.vertex_normals()


def test_offsets_are_the_distances_along_the_normals(swollen: Array) -> None:
    mesh = visible_mesh(GENERIC, GENERIC.mesh.vertices)
    tracks = seen_exactly(swollen, mesh, CAMERAS)
    offsets = measure_offsets(tracks, CAMERAS, mesh)
    normals = tracks.on(mesh.vertex_normals())
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    moved = tracks.on(swollen) - tracks.on(mesh.vertices)
    np.testing.assert_allclose(offsets.along_normal, (moved * normals).sum(axis=1), atol=2e-3)
    assert (offsets.sd > 0).all()


def test_the_surface_goes_where_the_photos_put_it(swollen: Array) -> None:
    vertices = GENERIC.mesh.vertices
    mesh = visible_mesh(GENERIC, vertices)
    tracks = seen_exactly(swollen, mesh, CAMERAS)
    moved = move_surface(vertices, tracks, measure_offsets(tracks, CAMERAS, mesh), GENERIC)
    cheek = (np.abs(tracks.on(vertices) - [40.0, -40.0, 20.0]) < 12).all(axis=1)
    left = (tracks.on(moved - swollen) * tracks.on(mesh.vertex_normals())).sum(axis=1)[cheek]
    assert cheek.sum() > 15
    assert np.median(np.abs(left)) < 0.05
    assert np.abs(moved - vertices)[vertices[:, 2] < -160].max() < 0.3


def test_a_tenth_of_wrong_matches_does_no_harm(swollen: Array) -> None:
    mesh = visible_mesh(GENERIC, GENERIC.mesh.vertices)
    tracks = seen_exactly(swollen, mesh, CAMERAS)
    rng = np.random.default_rng(1)
    wrong = rng.random(len(tracks.point)) < 0.1
    tracks.image_points[wrong] += rng.normal(size=(wrong.sum(), 2)) * 3
    moved = move_surface(
        GENERIC.mesh.vertices, tracks, measure_offsets(tracks, CAMERAS, mesh), GENERIC
    )
    left = tracks.on(moved - swollen)
    normals = tracks.on(mesh.vertex_normals())
    assert np.median(np.abs((left * normals).sum(axis=1))) < 0.15


def test_lips_stay_together_and_eyes_round(swollen: Array) -> None:
    vertices = GENERIC.mesh.vertices
    mesh = visible_mesh(GENERIC, vertices)
    tracks = seen_exactly(swollen, mesh, CAMERAS)
    moved = move_surface(vertices, tracks, measure_offsets(tracks, CAMERAS, mesh), GENERIC)
    upper, lower = (list(GENERIC.polylines[f"{side}_lip_inner"]) for side in ("upper", "lower"))
    gap = np.linalg.norm(moved[upper] - moved[lower], axis=1)
    before = np.linalg.norm(vertices[upper] - vertices[lower], axis=1)
    assert np.abs(gap - before).max() < 1.5
    ball = GENERIC.mesh.vertices_of("left_eyeball")
    radius = np.linalg.norm(moved[ball] - moved[ball].mean(axis=0), axis=1)
    before = np.linalg.norm(vertices[ball] - vertices[ball].mean(axis=0), axis=1)
    np.testing.assert_allclose(radius / before, (radius / before).mean(), rtol=1e-6)
    assert len(eye_centers(GENERIC.mesh.with_vertices(moved))) == 2


def test_heights_are_known_where_places_are(ann: Person) -> None:
    mesh = visible_mesh(GENERIC, ann.vertices)
    tracks = seen_exactly(ann.vertices, mesh, CAMERAS)
    offsets = measure_offsets(tracks, CAMERAS, mesh)
    sd = sample_heights(tracks, offsets, GENERIC, draws=30).std(axis=0)
    skin = np.unique(mesh.triangles)
    front, back = ann.vertices[skin, 2] > 10, ann.vertices[skin, 2] < -120
    assert np.median(sd[skin][front]) < 0.1
    assert np.median(sd[skin][back]) > 1.0
