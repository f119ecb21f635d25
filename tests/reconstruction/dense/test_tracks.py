from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC, Person
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.numeric.raster.rasterizer import rasterize
from mien.reconstruction.dense.crops import visible_mesh
from mien.reconstruction.dense.tracks import NO_TRACKS, Tracks, find_tracks

Photos = list[tuple[CapturedView, Camera]]


@pytest.fixture(scope="module")
def tracks(ann: Person, photos: Photos) -> Tracks:
    return tracked(photos, ann.vertices)


def tracked(photos: Photos, vertices: np.ndarray, points: int = 600) -> Tracks:
    views, cameras = zip(*photos, strict=True)
    mesh = visible_mesh(GENERIC, vertices)
    return find_tracks(views, cameras, mesh, mm_per_px=1.0, points=points)


def misses_px(tracks: Tracks, photos: Photos, true_places: np.ndarray) -> np.ndarray:
    """(M,) px between observations and the true projections."""
    projected = np.stack([camera.project(true_places) for _, camera in photos])
    off: np.ndarray = projected[tracks.photo, tracks.point] - tracks.image_points
    return np.hypot(*off.T)


def test_places_of_the_true_head_are_seen_where_they_are(
    tracks: Tracks, ann: Person, photos: Photos
) -> None:
    misses = misses_px(tracks, photos, tracks.on(ann.vertices))
    assert np.median(misses) < 0.25
    assert np.quantile(misses, 0.95) < 0.8


def test_a_wrong_head_does_not_mislead(ann: Person, photos: Photos) -> None:
    """The generic head is up to 8 mm off hers: a point is what its reference photo shows there."""
    tracks = tracked(photos, GENERIC.mesh.vertices)
    shown = visible_mesh(GENERIC, ann.vertices)
    true_places = np.zeros((len(tracks.corners), 3))
    for k, (_, camera) in enumerate(photos):
        depth = camera.to_camera(shown.vertices)[:, 2]
        raster = rasterize(
            camera.project(shown.vertices), depth, shown.triangles, camera.width, camera.height
        )
        own = (tracks.photo == k) & (tracks.reference[tracks.point] == k)
        pixels = tracks.image_points[own]
        seen = raster.depth[np.floor(pixels[:, 1]).astype(int), np.floor(pixels[:, 0]).astype(int)]
        at = tracks.point[own]
        depths = np.where(np.isfinite(seen), seen, 1).astype(float)
        true_places[at] = camera.unproject(pixels, depths)
    assert np.median(misses_px(tracks, photos, true_places)) < 0.2


def test_each_place_is_seen_by_its_reference_and_another(tracks: Tracks) -> None:
    assert (np.bincount(tracks.point, minlength=len(tracks.corners)) >= 2).all()
    seen = set(zip(tracks.photo.tolist(), tracks.point.tolist(), strict=True))
    assert len(seen) == len(tracks.photo)
    assert all((photo, n) in seen for n, photo in enumerate(tracks.reference.tolist()))
    np.testing.assert_allclose(tracks.barycentrics.sum(axis=1), 1, atol=1e-5)
    assert (tracks.sigma_px > 0).all()


def test_no_more_places_than_asked_for_and_crowding_says_how_dense(
    ann: Person, photos: Photos, tracks: Tracks
) -> None:
    assert len(tracks.corners) <= 600
    dense = tracked(photos, ann.vertices, points=6000)
    assert len(dense.corners) > 3 * len(tracks.corners)
    assert (tracks.overlap >= 1).all()
    assert dense.overlap.mean() > 2 * tracks.overlap.mean()


def test_photos_without_a_pattern_share_nothing(photos: Photos) -> None:
    from dataclasses import replace

    blank = [
        (replace(view, photo=replace(view.photo, pixels=np.full_like(view.photo.pixels, 127))), c)
        for view, c in photos
    ]
    assert len(tracked(blank, GENERIC.mesh.vertices).corners) == len(NO_TRACKS.corners) == 0
