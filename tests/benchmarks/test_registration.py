"""What the registration benchmark measures, where the truth is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh", reason="the benchmarks need trimesh")
from benchmarks.registration import windows  # noqa: E402
from benchmarks.same_point import behind_pixels, calibration, same_vertices, seen_face  # noqa: E402
from benchmarks.scan import Scan, move  # noqa: E402

from benchmarks import registration  # noqa: E402
from mien.arrays import Array  # noqa: E402
from mien.assets.generic import load_generic_head  # noqa: E402
from mien.camera import Camera  # noqa: E402
from mien.numeric.rotation import rotation_from_vector  # noqa: E402
from mien.render.orbit import orbit_camera  # noqa: E402
from mien.render.shade import shown_parts  # noqa: E402

GENERIC = load_generic_head()
TRUTH = GENERIC.mesh.vertices


def cameras(*yaws: float) -> dict[str, Camera]:
    turns = {f"at{yaw}": np.radians(yaw) for yaw in yaws}
    return {
        name: orbit_camera(yaw, width=400, height=500, vertices=TRUTH)
        for name, yaw in turns.items()
    }


def scan(*yaws: float) -> Scan:
    shown = GENERIC.mesh.submesh(GENERIC.mesh.triangles_of(*shown_parts(GENERIC.mesh)))
    return Scan(trimesh.Trimesh(TRUTH, shown.triangles, process=False), cameras(*yaws))


def another_frame() -> Array:
    T = np.eye(4)
    T[:3, :3] = 1.1 * rotation_from_vector(np.radians([10.0, -30, 5]))
    T[:3, 3] = [20, -10, 5]
    return T


def seen_from(T: Array, camera: Camera) -> Camera:
    """The camera that sees a head moved by T as this one sees the head."""
    scale = np.cbrt(np.linalg.det(T[:3, :3]))
    R = camera.R_cam_head @ (T[:3, :3] / scale).T
    return replace(camera, R_cam_head=R, t_cam_head=scale * camera.t_cam_head - R @ T[:3, 3])


def test_the_truth_in_another_frame_has_no_error() -> None:
    T, true = another_frame(), scan(-30, 0, 30)
    moved = {name: seen_from(T, camera) for name, camera in true.cameras.items()}
    head = move(T, TRUTH)
    assert behind_pixels(head, GENERIC, moved, true).p95 < 0.02
    face = seen_face(TRUTH, GENERIC, true.cameras)
    assert same_vertices(head, TRUTH, face).p95 < 1e-9


def test_a_head_that_slides_along_itself_is_wrong_at_the_same_point() -> None:
    """The nearest point would find nothing where the surface is flat."""
    true = scan(0)
    shifted = {
        name: replace(camera, t_cam_head=camera.t_cam_head + camera.R_cam_head @ [2.0, 0, 0])
        for name, camera in true.cameras.items()
    }
    bent = TRUTH + np.where(TRUTH[:, 1:2] > 0, [4.0, 0, 0], 0.0)
    face = seen_face(TRUTH, GENERIC, true.cameras)
    assert same_vertices(bent, TRUTH, face).mean > 1
    # Moved before a fixed camera, what a pixel shows is another place of the head.
    assert behind_pixels(TRUTH, GENERIC, shifted, true).mean > 0.3


def test_what_no_photo_shows_is_not_the_seen_face() -> None:
    left = seen_face(TRUTH, GENERIC, cameras(60))
    assert TRUTH[left][:, 0].mean() > 10
    both = seen_face(TRUTH, GENERIC, cameras(60, -60))
    assert both.sum() > 1.3 * left.sum()
    assert (both | ~left).all()


def test_bounds_that_hold_and_bounds_that_do_not(rng: np.random.Generator) -> None:
    face = seen_face(TRUTH, GENERIC, cameras(-30, 0, 30))
    noise = rng.normal(size=TRUTH.shape)
    found = 2.0 * (TRUTH + noise / np.linalg.norm(noise, axis=1, keepdims=True))
    for uncertainty, held in ((1.5, 1.0), (0.2, 0.0)):
        bounds = np.full(len(TRUTH), uncertainty)
        result = calibration(found, bounds, TRUTH, face, GENERIC)
        assert result.face == pytest.approx(held, abs=0.02)
        assert result.skin == pytest.approx(held, abs=0.02)


def test_windows_are_neighbours() -> None:
    names = list(windows(scan(40, -20, 0, -50, 15)))
    assert names == [("at-50", "at-20", "at0", "at15"), ("at-20", "at0", "at15", "at40")]


def test_without_the_scans_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(registration, "DATA", tmp_path / "absent")
    assert registration.main(["--quick"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(f"error: {tmp_path / 'absent'}: expected the scans")
