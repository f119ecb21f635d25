from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.mesh import Mesh
from mien.render.mipmap import build_pyramids
from mien.render.multitexture import prepare_textured_mesh
from mien.render.shade import CLAY, Light, over_background, render
from shapes import RADII, camera_at, ellipsoid, smooth_texture, with_nose


def test_a_textured_head_shows_the_texture_where_its_rays_meet_the_surface() -> None:
    mesh = ellipsoid(120, 240)
    camera = camera_at(30, mesh, size=200)
    image = render(mesh, camera, smooth_texture(2048, 1024))
    # The exact intersection of each ray with the ellipsoid, and the texture's formula there.
    rows, columns = np.nonzero(image[..., 3] == 255)
    rays = camera.ray_directions(np.column_stack([columns, rows]) + 0.5)
    origin, scaled = camera.center / RADII, rays / RADII
    a, b = (scaled**2).sum(axis=1), scaled @ origin
    root = b**2 - a * (origin @ origin - 1)
    inner = root > 0.05 * b**2 * 0.01
    t = (-b - np.sqrt(np.maximum(root, 0))) / a
    unit = origin + t[:, None] * scaled
    u = np.arctan2(unit[:, 0], unit[:, 2]) / (2 * np.pi) + 0.5
    v = 1 - (np.arcsin(np.clip(unit[:, 1], -1, 1)) / np.pi + 0.5)
    waves = [np.sin(24 * np.pi * u) * np.cos(20 * v), np.cos(10 * np.pi * u + 15 * v)]
    expected = 128 + 90 * np.column_stack([*waves, np.sin(14 * np.pi * u - 25 * v)])
    difference = np.abs(image[rows, columns, :3] - expected)[inner]
    assert inner.mean() > 0.9
    assert np.percentile(difference, 99) < 6
    assert np.median(difference) < 1.5


def test_alpha_is_the_covered_share_of_a_pixel() -> None:
    square = np.array([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]])
    mesh = Mesh(square, np.array([[0, 1, 2], [0, 2, 3]]))
    camera = camera_at(0, mesh, size=64)
    corner = camera.project(square)
    assert corner[3] == pytest.approx(64 - corner[1])
    area = float(np.ptp(corner[:, 0]) * np.ptp(corner[:, 1]))
    for samples, tolerance in ((1, 0.04), (4, 0.02), (9, 0.015)):
        image = render(mesh, camera, samples=samples)
        assert image[..., 3].sum() / 255 == pytest.approx(area, rel=tolerance)
    assert set(np.unique(render(mesh, camera)[..., 3])) == {0, 255}
    # Straight alpha: a half-covered pixel keeps the head's colour.
    edge = render(mesh, camera, samples=4, vertex_colours=np.full((4, 3), 200.0))
    assert (edge[edge[..., 3] > 0][:, :3] == 200).all()


def test_clay_is_brightest_where_it_faces_the_key_light() -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh, size=200)
    light = Light(key=(-1, 0, -1), fill=(0, 0, -1), fill_strength=0, ambient=0.3, key_strength=0.7)
    image = render(mesh, camera, light=light).astype(float)
    assert image[100, 65, 0] == pytest.approx(CLAY[0], abs=6)
    # From the axis of the light the brightness falls to what comes from everywhere.
    assert image[100, 136, 0] < 0.6 * CLAY[0]
    assert image[..., 0][image[..., 3] == 255].min() >= 0.3 * CLAY[0] - 1


def test_vertex_colours_are_interpolated_and_light_is_optional() -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh, size=100)
    plain = render(mesh, camera, vertex_colours=np.full(mesh.vertices.shape, 77.0))
    assert (plain[plain[..., 3] == 255][:, :3] == 77).all()
    lit = render(mesh, camera, vertex_colours=np.full(mesh.vertices.shape, 77.0), light=Light())
    assert (lit[..., :3][lit[..., 3] == 255] < 77).any()


def test_parts_can_be_chosen_and_hair_and_lashes_are_hidden_by_default() -> None:
    mesh = with_nose(ellipsoid())
    hair = Mesh(mesh.vertices, mesh.triangles, part=mesh.part, part_names=("skin", "hair"))
    camera = camera_at(90, mesh, size=100)
    default = render(hair, camera)[..., 3] > 0
    everything = render(hair, camera, parts=("skin", "hair"))[..., 3] > 0
    only = render(hair, camera, parts=("hair",))[..., 3] > 0
    assert default.sum() < everything.sum()
    np.testing.assert_array_equal(everything, default | only)
    with pytest.raises(InputError, match="part: expected skin or hair, got teeth"):
        render(hair, camera, parts=("teeth",))


def test_backgrounds() -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh, size=64)
    image = render(mesh, camera, background=(1, 2, 3))
    assert (image[..., 3] == 255).all()
    assert (image[0, 0, :3] == (1, 2, 3)).all()
    behind = np.full((64, 64, 3), 9, np.uint8)
    half = np.full((64, 64, 4), 128, np.uint8)
    assert (over_background(half, behind)[..., :3] == round(9 + 128 / 255 * 119)).all()
    with pytest.raises(InputError, match="background: expected a colour or an image of 64x64 px"):
        over_background(half, behind[:10])


def test_minified_textures_become_their_mean() -> None:
    mesh = ellipsoid()
    checks = (np.indices((1024, 2048)).sum(axis=0) % 2 * 255).astype(np.uint8)
    texture = np.repeat(checks[..., None], 3, axis=2)
    image = render(mesh, camera_at(0, mesh, size=64), texture)
    inner = image[24:40, 24:40, :3].astype(int)
    assert np.abs(inner - 128).max() <= 2


def test_vertices_in_the_camera_plane_are_skipped() -> None:
    mesh = Mesh(np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0]]), np.array([[0, 1, 2]]))
    camera = camera_at(0, ellipsoid(), size=32)
    placed = mesh.with_vertices(mesh.vertices + camera.center)
    assert not render(placed, camera).any()


def test_bad_input_is_refused() -> None:
    mesh = ellipsoid()
    bare = Mesh(mesh.vertices, mesh.triangles)
    camera = camera_at(0, mesh, size=32)
    texture = np.zeros((4, 4, 3), np.uint8)
    with pytest.raises(InputError, match="samples: expected 1 or 4 or 9, got 2"):
        render(mesh, camera, samples=2)
    with pytest.raises(InputError, match="mesh: expected one with texture coordinates"):
        prepare_textured_mesh(bare, build_pyramids([texture]))
    with pytest.raises(InputError, match="vertex_colours: expected only one of them"):
        render(mesh, camera, texture, vertex_colours=np.zeros(mesh.vertices.shape))
    with pytest.raises(InputError, match=r"vertex_colours: expected shape \(3321, 3\)"):
        render(mesh, camera, vertex_colours=np.zeros((5, 3)))
