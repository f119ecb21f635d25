from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.mesh import Mesh
from mien.render.overlay import draw_points, overlay_mesh
from shapes import camera_at, ellipsoid


def test_visible_edges_are_drawn_and_hidden_ones_are_not() -> None:
    front = np.array([[-50.0, -50, 50], [50, -50, 50], [50, 50, 50], [-50, 50, 50]])
    back = front * [0.5, 0.5, -1]
    mesh = Mesh(np.vstack([front, back]), np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]]))
    camera = camera_at(0, mesh, size=200)
    black = np.zeros((200, 200, 3), np.uint8)
    drawn = overlay_mesh(black, mesh, camera, colour=(255, 255, 255), opacity=1)
    for start, end in ((0, 1), (1, 2), (0, 2)):
        x, y = camera.project((front[start] + front[end])[None] / 2)[0]
        patch = drawn[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2]
        assert patch.max() > 200
    x, y = camera.project((back[1] + back[2])[None] / 2)[0]
    assert not drawn[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2].any()
    assert not black.any()


def test_opacity_mixes_lines_with_the_photo() -> None:
    mesh = ellipsoid(6, 12)
    photo = np.full((200, 200, 3), 100, np.uint8)
    drawn = overlay_mesh(photo, mesh, camera_at(0, mesh, size=200), colour=(200, 200, 200))
    assert drawn.min() == 100
    assert drawn.max() == 160


def test_points_are_drawn_at_their_places() -> None:
    black = np.zeros((40, 60, 3), np.uint8)
    points = np.array([[30.5, 10.5], [np.nan, 5], [1e30, 5], [-5.0, -5]])
    drawn = draw_points(black, points, colour=(255, 0, 0), radius=2).astype(float)
    assert drawn[10, 30, 0] == 255
    rows, columns = np.indices((40, 60)) + 0.5
    total = drawn[..., 0].sum()
    assert (columns * drawn[..., 0]).sum() / total == pytest.approx(30.5, abs=0.05)
    assert (rows * drawn[..., 0]).sum() / total == pytest.approx(10.5, abs=0.05)
    assert not black.any()


def test_bad_input_is_refused() -> None:
    mesh = ellipsoid(6, 12)
    with pytest.raises(InputError, match="photo: expected 200x200 px as its camera says"):
        overlay_mesh(np.zeros((10, 20, 3), np.uint8), mesh, camera_at(0, mesh, size=200))
    with pytest.raises(InputError, match=r"points: expected shape \(any, 2\)"):
        draw_points(np.zeros((10, 20, 3), np.uint8), np.zeros((3, 3)))
