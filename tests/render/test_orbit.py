from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.render.orbit import orbit_camera, turntable_cameras
from shapes import ellipsoid

VERTICES = ellipsoid().vertices + np.array([3.0, -40, -60])


def test_the_front_view_has_left_on_the_right_and_up_on_top() -> None:
    camera = orbit_camera(0, width=300, height=400, vertices=VERTICES)
    middle = (VERTICES.min(axis=0) + VERTICES.max(axis=0)) / 2
    center, left, up = camera.project(middle + np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0]]))
    np.testing.assert_allclose(center, [150, 200], atol=1e-9)
    assert left[0] > 150
    assert up[1] < 200
    assert camera.center[2] > VERTICES[:, 2].max()


def test_signs_of_the_angles() -> None:
    size = {"width": 300, "height": 400, "vertices": VERTICES}
    middle = (VERTICES.min(axis=0) + VERTICES.max(axis=0)) / 2
    assert orbit_camera(0.5, **size).center[0] > middle[0] + 100  # From the subject's left.
    assert orbit_camera(0, 0.5, **size).center[1] > middle[1] + 100  # From above.
    rolled = orbit_camera(0, 0, 0.5, **size)
    top = rolled.project(middle[None] + np.array([[0, 50, 0]]))[0]
    assert top[0] < 150  # The head leans counter-clockwise.
    offset = orbit_camera(0.5, **size).center - middle
    direction = offset / np.linalg.norm(offset)
    np.testing.assert_allclose(direction, [np.sin(0.5), 0, np.cos(0.5)], atol=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("pitch", [-1.2, 0.0, 0.4])
@pytest.mark.parametrize("size", [(300, 400), (400, 300), (256, 256)])
def test_everything_is_in_the_picture(yaw: float, pitch: float, size: tuple[int, int]) -> None:
    roll = 0.3 * yaw
    camera = orbit_camera(yaw, pitch, roll, width=size[0], height=size[1], vertices=VERTICES)
    pixels = camera.project(VERTICES)
    margin = 0.06 * np.array(size)
    assert (pixels >= margin - 1e-6).all()
    assert (pixels <= np.array(size) - margin + 1e-6).all()
    # And it fills the picture reasonably, though every yaw must fit at the same scale.
    assert (np.ptp(pixels, axis=0) / size).max() > 0.4


def test_a_turntable_goes_once_around_and_keeps_its_scale() -> None:
    cameras = list(turntable_cameras(8, width=100, height=120, vertices=VERTICES))
    assert len(cameras) == 8
    middle = (VERTICES.min(axis=0) + VERTICES.max(axis=0)) / 2
    distances = [np.linalg.norm(camera.center - middle) for camera in cameras]
    np.testing.assert_allclose(distances, distances[0])
    assert cameras[2].center[0] > middle[0] + 100
    assert cameras[4].center[2] < middle[2]


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match="vertices: expected at least one, got none"):
        orbit_camera(0, width=10, height=10, vertices=np.zeros((0, 3)))
    with pytest.raises(InputError, match="fov: expected an angle between 0 and pi"):
        orbit_camera(0, width=10, height=10, vertices=VERTICES, fov=4)
    with pytest.raises(InputError, match=r"margin: expected a share from 0 to 0\.5"):
        orbit_camera(0, width=10, height=10, vertices=VERTICES, margin=0.5)
    with pytest.raises(InputError, match="width: expected a number above zero"):
        orbit_camera(0, width=0, height=10, vertices=VERTICES)
    with pytest.raises(InputError, match="frames: expected a number above zero"):
        list(turntable_cameras(0, width=10, height=10, vertices=VERTICES))
