"""Points from viewing rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.errors import InputError
from mien.reconstruction.triangulation import triangulate


def test_exact_rays_meet_at_the_points(make_scene):
    scene = make_scene(0)
    found = triangulate(scene.cameras, scene.image_points)
    views = np.isfinite(scene.image_points[..., 0]).sum(axis=0)
    np.testing.assert_array_equal(found.views, views)
    np.testing.assert_array_equal(found.determined, views >= 2)
    np.testing.assert_allclose(
        found.points[found.determined], scene.points[found.determined], atol=1e-8
    )
    assert np.isnan(found.points[~found.determined]).all()
    assert np.nanmax(found.residual_mm[found.determined]) < 1e-8


def test_no_other_place_is_nearer_to_the_rays(make_scene, rng):
    scene = make_scene(0, noise=3.0, hidden=False)
    weights = rng.uniform(0.1, 1, scene.image_points.shape[:2])
    found = triangulate(scene.cameras, scene.image_points, weights=weights)

    def cost(points):
        total = 0.0
        for camera, image, weight in zip(scene.cameras, scene.image_points, weights, strict=True):
            direction, offset = camera.ray_directions(image), points - camera.center
            total += weight * (np.cross(direction, offset) ** 2).sum(axis=1)
        return total

    best = cost(found.points)
    np.testing.assert_allclose(best / weights.sum(axis=0), found.residual_mm**2, rtol=1e-9)
    for step in 0.01 * np.vstack([np.eye(3), -np.eye(3)]):
        assert (cost(found.points + step) > best).all()


def test_angle_is_the_largest_between_two_rays(make_scene):
    scene = make_scene(0, hidden=False)
    point = scene.points[0]
    rays = np.stack([point - camera.center for camera in scene.cameras])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    expected = np.arccos(np.clip(rays @ rays.T, -1, 1)).max()
    assert triangulate(scene.cameras, scene.image_points).angle[0] == pytest.approx(expected)


def test_one_ray_gives_nothing_or_the_nearest_place_on_it(make_scene):
    scene = make_scene(0, hidden=False)
    scene.image_points[1:, 0] = np.nan
    alone = triangulate(scene.cameras, scene.image_points)
    assert not alone.determined[0]
    assert np.isnan(alone.points[0]).all()
    assert alone.angle[0] == 0
    current = scene.points + np.array([3.0, -2.0, 1.0])
    pulled = triangulate(scene.cameras, scene.image_points, current=current)
    assert not pulled.determined[0]
    direction = scene.cameras[0].ray_directions(scene.image_points[0, :1])[0]
    center = scene.cameras[0].center
    nearest = center + direction * (direction @ (current[0] - center))
    np.testing.assert_allclose(pulled.points[0], nearest, atol=1e-6)
    np.testing.assert_allclose(pulled.points[1:], scene.points[1:], atol=1e-8)


def test_nearly_parallel_rays_do_not_tell_depth(make_scene, rng):
    camera = make_scene(0, yaws=(0,)).cameras[0]
    beside = replace(camera, t_cam_head=camera.t_cam_head + np.array([5.0, 0, 0]))
    points = make_scene(0).points
    image_points = np.stack([camera.project(points), beside.project(points)])
    image_points += 2 * rng.normal(size=image_points.shape)
    found = triangulate([camera, beside], image_points)
    assert not found.determined.any()
    assert np.isnan(found.points).all()
    pulled = triangulate([camera, beside], image_points, current=points)
    assert np.linalg.norm(pulled.points - points, axis=1).max() < 2


def test_a_point_that_nobody_sees_stays(make_scene):
    scene = make_scene(0)
    scene.image_points[:, 2] = np.nan
    assert np.isnan(triangulate(scene.cameras, scene.image_points).points[2]).all()
    pulled = triangulate(scene.cameras, scene.image_points, current=scene.generic)
    np.testing.assert_allclose(pulled.points[2], scene.generic[2], atol=1e-9)
    assert np.isnan(pulled.residual_mm[2])
    assert pulled.views[2] == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"image_points": np.zeros((4, 60, 2))}, r"image_points: expected shape \(5, any, 2\)"),
        ({"weights": -np.ones((5, 60))}, "weights: expected numbers of 0 or more"),
        ({"weights": np.ones(5)}, r"weights: expected shape \(5, 60\)"),
        ({"current": np.full((60, 3), np.nan)}, "current: expected finite numbers"),
        ({"current": np.zeros((59, 3))}, r"current: expected shape \(60, 3\)"),
        ({"min_angle": 0.0}, "min_angle: expected a number above zero"),
    ],
)
def test_refuses_bad_input(make_scene, change, message):
    scene = make_scene(0)
    given = {"cameras": scene.cameras, "image_points": scene.image_points}
    with pytest.raises(InputError, match=message):
        triangulate(**{**given, **change})
