from __future__ import annotations

import numpy as np

from mien.arrays import Array
from mien.render.shade import render
from mien.texture.subject import subject_mask
from shapes import camera_at, ellipsoid


def photo_of_a_thinner_head(
    rng: np.random.Generator, head: tuple[int, ...], wall: tuple[int, ...]
) -> tuple[Array, Array]:
    """A noisy photo of a head that is 8 % thinner than the mesh, and where it is in the photo."""
    mesh = ellipsoid()
    thin = mesh.with_vertices(mesh.vertices * [0.92, 1, 1])
    colours = np.tile(np.float64(head), (len(mesh.vertices), 1))
    camera = camera_at(0, mesh)
    image = render(thin, camera, vertex_colours=colours, background=wall)[..., :3]
    noisy = np.clip(image + rng.normal(0, 6, image.shape), 0, 255).astype(np.uint8)
    return noisy, render(thin, camera)[..., 3] > 0


def test_background_within_the_outline_is_found(rng: np.random.Generator) -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh)
    photo, truth = photo_of_a_thinner_head(rng, (180, 130, 110), (40, 90, 60))
    outline = render(mesh, camera)[..., 3] > 0
    found = subject_mask(mesh, camera, photo)
    wrong = outline & ~truth
    assert wrong.sum() > 2000
    assert (found & wrong).sum() < 0.1 * wrong.sum()
    assert (found & truth).sum() > 0.98 * truth.sum()


def test_dark_hair_before_a_dark_wall_stays(rng: np.random.Generator) -> None:
    mesh = ellipsoid()
    camera = camera_at(0, mesh)
    photo, truth = photo_of_a_thinner_head(rng, (14, 12, 10), (10, 11, 14))
    assert (subject_mask(mesh, camera, photo) & truth).sum() > 0.99 * truth.sum()


def test_a_head_beside_the_photo_leaves_nothing() -> None:
    mesh = ellipsoid()
    away = mesh.with_vertices(mesh.vertices + np.array([9000, 0, 0]))
    assert not subject_mask(away, camera_at(0, mesh), np.zeros((320, 320, 3), np.uint8)).any()


def test_the_same_photo_gives_the_same_mask(rng: np.random.Generator) -> None:
    mesh = ellipsoid()
    photo, _ = photo_of_a_thinner_head(rng, (120, 100, 90), (90, 90, 60))
    first, second = (subject_mask(mesh, camera_at(0, mesh), photo) for _ in range(2))
    np.testing.assert_array_equal(first, second)
