from __future__ import annotations

from dataclasses import replace

import numpy as np

from marbled import GENERIC, Person, detected, photographed
from mien.reconstruction.mirroring import find_mirrored, is_suspicious, mirrored_view
from people import person

WHO = Person(person(3), 1)
PHOTOS = photographed(WHO, (-25.0, 0.0, 25.0))
VIEWS = [detected(view, camera, WHO.vertices, off_mm=0.0) for view, camera in PHOTOS]
CAMERAS = [camera for _, camera in PHOTOS]


def test_a_photo_turned_over_twice_is_itself() -> None:
    twice = mirrored_view(mirrored_view(VIEWS[0], GENERIC), GENERIC)
    np.testing.assert_array_equal(twice.photo.pixels, VIEWS[0].photo.pixels)
    assert twice.landmarks is not None
    assert VIEWS[0].landmarks is not None
    np.testing.assert_allclose(twice.landmarks.points, VIEWS[0].landmarks.points, atol=1e-9)


def test_the_left_eye_of_a_mirrored_photo_was_the_right_one() -> None:
    assert VIEWS[0].landmarks is not None
    scores = np.zeros(52)
    scores[9] = 1.0  # eyeBlinkLeft
    winking = replace(VIEWS[0], landmarks=replace(VIEWS[0].landmarks, blendshapes=scores))
    turned = mirrored_view(winking, GENERIC).landmarks
    assert turned is not None
    assert np.flatnonzero(turned.blendshapes).tolist() == [10]
    width = VIEWS[0].photo.size[0]
    np.testing.assert_allclose(
        turned.points[33], [width, 0] + VIEWS[0].landmarks.points[263] * [-1, 1]
    )


def test_the_one_that_was_mirrored_is_found() -> None:
    assert find_mirrored(VIEWS, CAMERAS, WHO.vertices, GENERIC) is None
    turned = mirrored_view(VIEWS[1], GENERIC)
    assert find_mirrored([VIEWS[0], turned, VIEWS[2]], CAMERAS, WHO.vertices, GENERIC) == 1


def test_what_is_suspicious() -> None:
    assert is_suspicious([])
    assert is_suspicious([1137, 1357, 1122, 494])
    assert not is_suspicious([680, 966, 1136, 1160, 826, 685, 878])
