"""What the accuracy benchmark measures, where the truth is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh", reason="the benchmarks need trimesh")
from benchmarks.scan import (  # noqa: E402
    FACE_RADIUS_MM,
    Samples,
    Scan,
    SurfaceError,
    distance_to,
    face_samples,
    move,
    relative_rotation_error,
    similarity,
    start_from_shared_pixels,
)

from benchmarks import accuracy  # noqa: E402
from mien.arrays import Array  # noqa: E402
from mien.camera import Camera  # noqa: E402
from mien.numeric.rotation import rotation_from_vector  # noqa: E402
from shapes import camera_at, ellipsoid, with_nose  # noqa: E402

HEAD = with_nose(ellipsoid())
CAMERAS = {"front": camera_at(0, HEAD), "left": camera_at(40, HEAD)}


def scan_of(vertices: Array) -> Scan:
    return Scan(trimesh.Trimesh(vertices, HEAD.triangles, process=False), CAMERAS)


def small_move() -> Array:
    """A turn of 2 degrees, a step of some mm and a scale of 1.01."""
    T = np.eye(4)
    T[:3, :3] = 1.01 * rotation_from_vector(np.radians([1.0, -1.5, 1.0]))
    T[:3, 3] = [2, -1, 1]
    return T


@pytest.fixture(scope="module")
def samples() -> Samples:
    near = HEAD.vertices[(HEAD.vertices[:, 2] > 60)]
    return face_samples(HEAD, list(CAMERAS.values()), near, height=40)


def test_a_head_has_no_error_against_itself(samples: Samples) -> None:
    found = distance_to(scan_of(HEAD.vertices), samples.on(HEAD.vertices), np.eye(4))
    for error in (found.before, found.after):
        assert max(error.median, error.mean, error.p95) < 1e-5
    np.testing.assert_allclose(found.T_scan_head, np.eye(4), atol=1e-5)


def test_points_behind_the_same_pixels_give_the_similarity() -> None:
    T = small_move()
    scale = np.cbrt(np.linalg.det(T[:3, :3]))
    R, t = T[:3, :3] / scale, T[:3, 3] / scale
    # The scan is the moved head, and its camera sees it as the head's own camera sees the head.
    camera = CAMERAS["front"]
    turned = camera.R_cam_head @ R.T
    there = replace(camera, R_cam_head=turned, t_cam_head=scale * (camera.t_cam_head - turned @ t))
    scan = scan_of(move(T, HEAD.vertices))
    on_head, on_scan = start_from_shared_pixels(scan, HEAD, camera, there)
    assert len(on_head) > 1000
    np.testing.assert_allclose(similarity(on_head, on_scan), T, atol=2e-3)


def test_icp_finds_back(samples: Samples) -> None:
    scan = scan_of(move(small_move(), HEAD.vertices))
    found = distance_to(scan, samples.on(HEAD.vertices), np.eye(4))
    assert found.before.mean > 1
    assert found.after.mean < found.before.mean / 10


def test_only_what_a_camera_sees_of_the_face_is_sampled() -> None:
    near = HEAD.vertices[[int(np.argmax(HEAD.vertices[:, 2]))]]
    places = face_samples(HEAD, [CAMERAS["front"]], near, height=200).on(HEAD.vertices)
    assert len(places) > 50
    assert np.linalg.norm(places - near, axis=1).max() < FACE_RADIUS_MM
    on_ball = np.linalg.norm((places - [0, 0, 105]) / 18, axis=1)
    assert np.abs(on_ball - 1).max() < 0.05, "what the nose hides is not seen"
    assert places[:, 2].min() > 105


def test_hair_and_lashes_are_not_sampled() -> None:
    hidden = replace(HEAD, part_names=("skin", "hair"))
    samples = face_samples(hidden, [CAMERAS["front"]], HEAD.vertices, height=60)
    assert samples.triangles.max() < len(ellipsoid().vertices)


def test_summary_of_distances() -> None:
    error = SurfaceError.of(np.arange(101.0))
    assert (error.median, error.mean, error.p95) == (50, 50, 95)


def camera(R: Array, *, principal: tuple[float, float] | None = None) -> Camera:
    centre = None if principal is None else np.array(principal)
    return Camera(1200, 1600, 6400, R, np.array([0, 0, 1500.0]), centre)


def test_turn_between_photos() -> None:
    first, second = np.eye(3), rotation_from_vector(np.radians([0, 40.0, 0]))
    scan = replace(scan_of(HEAD.vertices), cameras={"a": camera(first), "b": camera(second)})
    fitted = {"a": camera(first), "b": camera(rotation_from_vector(np.radians([0, 37.0, 0])))}
    assert relative_rotation_error(scan.cameras, scan) == [pytest.approx(0, abs=1e-6)]
    assert relative_rotation_error(fitted, scan) == [pytest.approx(3)]


def test_a_crop_off_the_centre_is_a_turn() -> None:
    true = camera(np.eye(3), principal=(700.0, 800.0))
    turn = rotation_from_vector(np.array([0, np.arctan(100 / 6400), 0]))
    scan = replace(scan_of(HEAD.vertices), cameras={"a": camera(np.eye(3)), "b": true})
    fitted = {"a": camera(np.eye(3)), "b": camera(turn)}
    assert relative_rotation_error(fitted, scan) == [pytest.approx(0, abs=1e-6)]


def test_without_the_scans_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(accuracy, "DATA", tmp_path)
    assert accuracy.main(["james"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(f"error: {tmp_path / 'james'}: expected the scan")


def test_the_scans_load(shared: Path) -> None:
    from benchmarks.scan import load_scan

    for person, photos in (("james", 2), ("emily", 7)):
        scan = load_scan(shared / "data" / person)
        assert len(scan.cameras) == photos
        for view in scan.cameras.values():
            pixels = view.project(np.array(scan.surface.vertices))
            size = [view.width, view.height]
            inside = ((pixels > 0) & (pixels < size)).all(axis=1)
            assert inside.mean() > 0.7
