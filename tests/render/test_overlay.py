from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.mesh import Mesh
from mien.render.overlay import overlay_mesh
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


def test_bad_input_is_refused() -> None:
    mesh = ellipsoid(6, 12)
    with pytest.raises(InputError, match="photo: expected 200x200 px as its camera says"):
        overlay_mesh(np.zeros((10, 20, 3), np.uint8), mesh, camera_at(0, mesh, size=200))
