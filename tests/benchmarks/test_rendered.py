"""Rendered photos tell exactly what their truth says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("trimesh", reason="the benchmarks need trimesh")
from benchmarks.paint import Hits, ProjectedPaint, TexturePaint
from benchmarks.rendered import (
    TRUTH,
    Plan,
    degraded,
    main,
    portrait_camera,
    render_exactly,
    write_scene,
)
from benchmarks.scan import load_scan
from benchmarks.subjects import (
    Subject,
    emily,
    james,
    person_vertices,
    projector,
    smooth_field,
)

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.capture.images.photos import downscale, load_photo
from mien.mesh import Mesh
from mien.numeric.images.sampling import sample_bilinear
from mien.render.shade import rasterize_mesh
from shapes import RADII, ellipsoid, smooth_texture, with_nose

BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Dot:
    """A light dot, of 1 mm deviation, around a place in space."""

    place: Array

    def __call__(self, mesh: Mesh, hits: Hits) -> Array:
        away = hits.of(mesh.triangles, mesh.vertices) - self.place
        light: Array = 255 * np.exp(-(away**2).sum(axis=1, keepdims=True) / 2)
        return np.repeat(light, 3, axis=1)


@cache
def egg() -> Subject:
    return Subject(
        mesh=ellipsoid(80, 160),
        paint=TexturePaint(smooth_texture()),
        target=np.zeros(3),
        R_subject_portrait=np.eye(3),
        height_mm=260,
    )


def centroid(image: Array) -> Array:
    """(x, y) of the light, px."""
    light = image[..., 0].astype(float)
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]] + 0.5
    return np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()


@pytest.mark.parametrize(("yaw", "pitch", "roll"), [(0, 0, 0), (-15, 6, 4), (25, -8, -3)])
def test_a_dot_is_where_the_camera_says(yaw: float, pitch: float, roll: float) -> None:
    subject = egg()
    longitude, latitude = np.radians([6.0, 12.0])
    direction = np.array(
        [np.sin(longitude) * np.cos(latitude), np.sin(latitude), np.cos(longitude)]
    )
    direction[2] *= np.cos(latitude)
    place = direction * RADII
    subject = replace(subject, paint=Dot(place))
    camera = portrait_camera(subject, yaw, pitch, roll, width=420, height=500, focal_px=2100)
    camera = replace(camera, principal_px=np.array([203.4, 260.2]))
    found = centroid(render_exactly(subject, camera, background=BLACK))
    np.testing.assert_allclose(found, camera.project(place[None])[0], atol=0.1)


def test_a_dot_of_a_texture_is_where_its_coordinates_say() -> None:
    subject = egg()
    u, v = 0.53, 0.58
    rows, columns = np.mgrid[:256, :512] + 0.5
    away = (columns - 512 * u) ** 2 + (rows - 256 * (1 - v)) ** 2
    texture = np.rint(255 * np.exp(-away / 8)).astype(np.uint8)[..., None].repeat(3, axis=2)
    longitude, latitude = 2 * np.pi * (u - 0.5), np.pi * (v - 0.5)
    ring = np.cos(latitude)
    place = RADII * [ring * np.sin(longitude), np.sin(latitude), ring * np.cos(longitude)]
    subject = replace(subject, paint=TexturePaint(texture))
    camera = portrait_camera(subject, 5, width=420, height=500, focal_px=2100)
    found = centroid(render_exactly(subject, camera, background=BLACK))
    np.testing.assert_allclose(found, camera.project(place[None])[0], atol=0.15)


def test_two_views_agree_about_a_point_of_the_surface() -> None:
    subject = egg()
    cameras = [portrait_camera(subject, yaw, width=800, height=900) for yaw in (-20, 15)]
    points = subject.mesh.vertices
    both = np.ones(len(points), bool)
    for camera in cameras:
        view = camera.center - points
        cosine = (view * subject.mesh.vertex_normals()).sum(axis=1)
        both &= cosine > 0.6 * np.linalg.norm(view, axis=1)
    assert both.sum() > 500
    first, second = (
        sample_bilinear(render_exactly(subject, camera), camera.project(points[both]))
        for camera in cameras
    )
    assert np.abs(first - second).max() < 2.0
    assert np.abs(first - second).mean() < 0.5


def test_a_shading_is_a_factor() -> None:
    subject = egg()
    camera = portrait_camera(subject, 0, width=80, height=100)
    half = TexturePaint(smooth_texture(), np.full(len(subject.mesh.vertices), 0.5))
    bright = render_exactly(subject, camera, background=BLACK).astype(float)
    dark = render_exactly(replace(subject, paint=half), camera, background=BLACK)
    np.testing.assert_allclose(dark, bright / 2, atol=1.01)


def test_positive_yaw_sees_the_left_side_and_the_target_is_in_the_middle() -> None:
    subject = replace(egg(), target=np.array([3.0, -4.0, 5.0]))
    camera = portrait_camera(subject, 30, 10, 5, width=900, height=1000)
    assert camera.center[0] > 0
    assert camera.center[1] > 0
    np.testing.assert_allclose(camera.project(subject.target[None]), [[450, 500]])
    assert camera.focal_px * subject.height_mm / np.linalg.norm(
        camera.center - subject.target
    ) == pytest.approx(1000)


def test_projected_photos_give_the_surface_its_colours_back() -> None:
    subject = replace(egg(), mesh=with_nose(ellipsoid()))
    cameras = [portrait_camera(subject, yaw, width=500, height=600) for yaw in (-30, 0, 30)]
    projectors = tuple(
        projector(subject.mesh, camera, render_exactly(subject, camera)) for camera in cameras
    )
    shadow = np.array([1.0, 2.0, 3.0])
    painted = replace(subject, paint=ProjectedPaint(projectors, shadow))
    camera = portrait_camera(subject, 12, width=500, height=600)
    true, found = (render_exactly(s, camera).astype(int) for s in (subject, painted))
    inside = rasterize_mesh(subject.mesh, camera).mask
    assert np.median(np.abs(true - found)[inside]) <= 1
    assert np.quantile(np.abs(true - found)[inside], 0.9) < 8
    back = np.argmin(subject.mesh.vertices[subject.mesh.triangles].mean(axis=1)[:, 2])
    unseen = Hits(np.array([back]), np.array([[1.0, 0, 0]]))
    np.testing.assert_allclose(painted.paint(subject.mesh, unseen), [shadow])


def test_worse_photos_stay_within_what_is_told(rng: np.random.Generator) -> None:
    grey = [np.full((200, 200, 3), 100, np.uint8)] * 5
    photos = degraded(grey, rng)
    means = np.array([photo.mean(axis=(0, 1)) for photo in photos]) / 100
    brightness = np.sort(means.mean(axis=1))
    np.testing.assert_allclose(brightness, np.linspace(0.75, 1.2, 5), rtol=0.07)
    assert np.abs(means / means.mean(axis=1, keepdims=True) - 1).max() < 0.15
    for photo in photos:
        np.testing.assert_allclose(photo.std(axis=(0, 1)), 3, rtol=0.05)
    again = degraded(grey, np.random.default_rng(20021))
    assert all(np.array_equal(a, b) for a, b in zip(photos, again, strict=True))


def test_a_random_field_has_its_size_and_length(rng: np.random.Generator) -> None:
    points = np.array([[0.0, 0, 0], [25, 0, 0], [0, 0, 100]])
    draws = np.stack(
        [smooth_field(rng, points, rms_mm=2, length_mm=25, waves=50) for _ in range(4000)]
    )
    np.testing.assert_allclose((draws**2).sum(axis=2).mean(axis=0), 4, rtol=0.06)
    products = (draws[:, 0] * draws[:, 1]).sum(axis=1).mean() / 4
    assert products == pytest.approx(np.exp(-0.5), abs=0.05)
    assert (draws[:, 0] * draws[:, 2]).sum(axis=1).mean() / 4 == pytest.approx(0, abs=0.05)


def test_a_person_is_what_the_basis_says_and_crooked_beyond_it() -> None:
    generic, vertices = load_generic_head(), person_vertices(7)
    np.testing.assert_array_equal(vertices, person_vertices(7))
    assert np.linalg.norm(vertices - person_vertices(10), axis=1).mean() > 2
    coefficients = np.random.default_rng(7).normal(size=len(generic.identity.components))
    moves = vertices - generic.mesh.vertices - generic.identity.offsets(coefficients)
    skin = generic.mesh.vertices_of("skin")
    assert 1 < np.sqrt((moves[skin] ** 2).sum(axis=1).mean()) < 3
    crooked = moves - moves[generic.mirror] * [-1, 1, 1]
    assert np.linalg.norm(crooked, axis=1).mean() > 1
    for name in ("left_eyeball", "right_eyeball"):
        ball = generic.mesh.vertices_of(name)
        np.testing.assert_allclose(np.ptp(moves[ball], axis=0), 0, atol=1e-9)


def test_a_scene_is_read_back(tmp_path: Path) -> None:
    vertices = ellipsoid(80, 160).vertices
    plan = Plan(
        lambda: replace(egg(), vertices=vertices),
        yaws=(-10, 10),
        size=(60, 80),
        focal_px=(300, 400),
    )
    write_scene(tmp_path / "a", plan)
    write_scene(tmp_path / "b", replace(plan, degrade=True))
    first, second = load_scan(tmp_path / "a"), load_scan(tmp_path / "b")
    np.testing.assert_allclose(first.surface.vertices, vertices, atol=1e-4)
    np.testing.assert_array_equal(first.surface.faces, egg().mesh.triangles)
    with np.load(tmp_path / "a" / TRUTH) as truth:
        np.testing.assert_array_equal(truth["vertices"], vertices)
    for name, camera in first.cameras.items():
        photo = load_photo(tmp_path / "a" / f"{name}.png").pixels
        assert np.array_equal(photo, render_exactly(egg(), camera))
        worse = load_photo(tmp_path / "b" / f"{name}.png").pixels
        assert not np.array_equal(photo, worse)
        np.testing.assert_allclose(second.cameras[name].t_cam_head, camera.t_cam_head)


def test_more_photos_of_the_same_subject() -> None:
    plan = Plan(egg, yaws=(-30, 0, 30)).with_count(24)
    assert len(plan.yaws) == 24
    assert (plan.yaws[0], plan.yaws[-1]) == (-30, 30)


def test_an_unknown_scene_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([str(tmp_path), "nobody"])
    assert stopped.value.code == 2
    assert "expected james-5" in capsys.readouterr().err


def test_a_true_camera_sees_what_was_photographed(shared: Path) -> None:
    """The scans' own cameras photograph them as the photos do."""
    for subject, person, photos in (
        (james, "james", "photo_left.png"),
        (emily, "emily", "renders_mentalray/view4.jpg"),
    ):
        folder = shared / "data" / person
        camera = load_scan(folder).cameras[Path(photos).stem]
        photo = load_photo(folder / photos).pixels
        small = downscale(photo, max(photo.shape) // 4)
        camera = camera.resized(small.shape[0] / photo.shape[0])
        head = subject(folder)
        image = render_exactly(head, camera, finer=2)
        inside = rasterize_mesh(head.mesh, camera).mask
        difference = np.abs(image.astype(int) - small)[inside]
        assert np.median(difference) <= 3
        assert np.quantile(difference, 0.9) < 20
