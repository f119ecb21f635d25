"""The whole registration on photos of a head that is known exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from marbled import GENERIC, SHOWN, Person, detected
from mien.arrays import Array
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.numeric.similarity import estimate_similarity
from mien.reconstruction.dense.joint import FocalGroups
from mien.reconstruction.dense.register import Registration, register_views
from mien.reconstruction.features import gather_features

Photos = list[tuple[CapturedView, Camera]]


def lenses(photos: Photos) -> FocalGroups:
    focal = np.log([camera.focal_px for _, camera in photos])
    return FocalGroups(np.arange(len(photos)), focal + 0.1, np.full(len(photos), 0.3))


def turned(camera: Camera, k: int, degrees: float) -> Camera:
    axis = np.random.default_rng(k).normal(size=3)
    turn = rotation_from_vector(np.radians(degrees) * axis / np.linalg.norm(axis))
    return replace(camera, R_cam_head=turn @ camera.R_cam_head, focal_px=1.1 * camera.focal_px)


@pytest.fixture(scope="module")
def found(photos: Photos) -> Registration:
    """From the generic head, cameras 4 degrees and focal lengths 10 % off."""
    views, cameras = zip(*photos, strict=True)
    starts = [turned(camera, k, 4.0) for k, camera in enumerate(cameras)]
    steps: list[tuple[int, int]] = []
    result = register_views(
        views,
        starts,
        GENERIC.mesh.vertices,
        gather_features(views, GENERIC),
        lenses(photos),
        GENERIC,
        progress=lambda done, total: steps.append((done, total)),
    )
    assert result is not None
    assert steps[-1][0] == steps[-1][1]
    assert [done for done, _ in steps] == sorted(done for done, _ in steps)
    return result


def test_cameras(found: Registration, photos: Photos) -> None:
    for a, b in zip(found.cameras[1:], [camera for _, camera in photos][1:], strict=True):
        first, true_first = found.cameras[0].R_cam_head, photos[0][1].R_cam_head
        off = angle_between(a.R_cam_head @ first.T, b.R_cam_head @ true_first.T)
        assert np.degrees(off) < 0.15
    ratios = [a.focal_px / b.focal_px for a, (_, b) in zip(found.cameras, photos, strict=True)]
    assert np.abs(np.log(ratios)).max() < 0.03


def off_surface_mm(vertices: Array, truth: Array, part: Array) -> Array:
    """Distance of some vertices from the true surface, along its normals, after ICP."""
    chosen = np.flatnonzero(part & (truth[:, 2] > 0))
    normals = SHOWN.with_vertices(truth).vertex_normals()
    shown = np.unique(SHOWN.triangles)
    tree, laid = cKDTree(truth[shown]), vertices[chosen]
    for _ in range(30):
        nearest = shown[tree.query(laid)[1]]
        along = ((laid - truth[nearest]) * normals[nearest]).sum(axis=1)
        laid = estimate_similarity(laid, laid - along[:, None] * normals[nearest])(laid)
    return np.abs(along)


def test_surface(found: Registration, ann: Person) -> None:
    """A pixel shows 0.8 mm here, and the nearest vertex stands for the nearest point."""
    face = GENERIC.regions["face"] > 0.5
    off = off_surface_mm(found.vertices, ann.vertices, face)
    before = off_surface_mm(GENERIC.mesh.vertices, ann.vertices, face)
    assert np.median(off) < 0.4
    assert np.median(off) < 0.4 * np.median(before)


def test_what_the_photos_see_is_known_best(found: Registration) -> None:
    sd = found.deviation_mm
    vertices = GENERIC.mesh.vertices
    face = (GENERIC.regions["face"] > 0.5) & (vertices[:, 2] > 0)
    assert np.median(sd[face]) < 0.6 * np.median(sd[vertices[:, 2] < -130])
    assert sd.min() > 0.5


def test_the_quality_of_good_photos(found: Registration) -> None:
    assert found.quality.notes([f"{k}.png" for k in range(4)]) == ()
    assert (found.quality.shared > 200).all()
    assert (found.quality.rms_px < 0.3).all()


def test_the_same_again_is_the_same(photos: Photos) -> None:
    views, cameras = zip(*photos[:2], strict=True)
    features = gather_features(views, GENERIC)
    args = (views, cameras, GENERIC.mesh.vertices, features, lenses(photos[:2]), GENERIC)
    one, other = (register_views(*args, scales=(1.0,)) for _ in range(2))
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.vertices, other.vertices)


def test_photos_that_share_nothing(photos: Photos) -> None:
    blank = [
        replace(view, photo=replace(view.photo, pixels=np.full_like(view.photo.pixels, 127)))
        for view, _ in photos
    ]
    cameras = [camera for _, camera in photos]
    features = gather_features(blank, GENERIC)
    args = (blank, cameras, GENERIC.mesh.vertices, features, lenses(photos), GENERIC)
    assert register_views(*args) is None


def test_another_expression_in_one_photo_is_noticed(ann: Person, photos: Photos) -> None:
    index = GENERIC.unit_names.index("jawOpen")
    spoken = Person(ann.vertices + 0.7 * GENERIC.unit_offsets[index], ann.skin)
    mixed = [*photos]
    camera = photos[1][1]
    seen = spoken.seen_by(camera, name="spoken.png")
    mixed[1] = (detected(seen, camera, spoken.vertices), camera)
    views, cameras = zip(*mixed, strict=True)
    features = gather_features(views, GENERIC)
    result = register_views(
        views, cameras, GENERIC.mesh.vertices, features, lenses(photos), GENERIC
    )
    assert result is not None
    notes = result.quality.notes(["0.png", "spoken.png", "2.png", "3.png"])
    assert any("spoken.png" in note and "the mouth" in note for note in notes)
    assert not any(name in note for note in notes for name in ("0.png", "2.png", "3.png"))
    upper = GENERIC.regions["forehead"] + GENERIC.regions["nose"] > 0.5
    assert np.median(off_surface_mm(result.vertices, ann.vertices, upper)) < 0.4
