from __future__ import annotations

import numpy as np

from mien.texture.cylinder import cylinder_surface, fit_cylinder
from mien.texture.equalize import estimate_gains
from mien.texture.visibility import prepare_view
from shapes import camera_at, ellipsoid


def test_gains_undo_what_was_done_to_the_photos(rng: np.random.Generator) -> None:
    mesh = ellipsoid()
    surface = cylinder_surface(mesh, fit_cylinder(mesh), width=128, height=64)
    done = np.array([[0.7, 0.8, 0.9], [1.2, 1.1, 1.0], [1.0, 0.9, 1.1], [0.9, 1.2, 1.0]])
    views = []
    for yaw, factor in zip((-60, -20, 20, 60), done, strict=True):
        photo = np.tile(120 * factor, (320, 320, 1)) + rng.normal(0, 4, (320, 320, 3))
        photo[rng.random((320, 320)) < 0.05] = 255  # Highlights that only one photo has.
        views.append(prepare_view(mesh, camera_at(yaw, mesh), np.rint(photo).astype(np.uint8)))
    gains = estimate_gains(surface, views)
    np.testing.assert_allclose(np.prod(gains, axis=0), 1, atol=1e-9)
    evened = gains * done
    np.testing.assert_allclose(evened / evened.mean(axis=0), 1, atol=0.01)


def test_one_photo_is_left_as_it_is() -> None:
    mesh = ellipsoid()
    surface = cylinder_surface(mesh, fit_cylinder(mesh), width=64, height=32)
    view = prepare_view(mesh, camera_at(0, mesh), np.full((320, 320, 3), 80, np.uint8))
    np.testing.assert_array_equal(estimate_gains(surface, [view]), 1)
