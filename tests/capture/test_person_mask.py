from __future__ import annotations

import numpy as np

from mien.arrays import Array
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.person_mask import PersonMask, find_person


def around(detector: LandmarkDetector, pixels: Array) -> tuple[Array, float]:
    """The middle of the face, and twice its height."""
    points = detector.detect_all_fast(pixels)[0].points[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, 2.2 * float((high - low)[1])


def test_a_man_before_a_dark_wall(faces: dict[str, Array], detector: LandmarkDetector) -> None:
    photo = faces["left"]
    centre, side = around(detector, photo)
    person = find_person(photo, centre, side)
    mask = person.of_photo(600, 800)
    assert mask.shape == (800, 600)
    face = detector.detect_all_fast(photo)[0].points[:, :2]
    assert (person.at(face) > 0.5).mean() > 0.97
    forehead, nose = face[10], face[1]
    assert person.at((forehead + 0.3 * (forehead - nose))[None])[0] > 0.9, "hair"
    assert person.at(np.array([[10.0, 200.0], [590.0, 200.0]])).max() < 0.1, "wall"


def test_the_mirrored_photo_has_the_mirrored_mask(
    faces: dict[str, Array], detector: LandmarkDetector
) -> None:
    photo = faces["left"]
    centre, side = around(detector, photo)
    plain = find_person(photo, centre, side).of_photo(600, 800)
    turned = np.ascontiguousarray(photo[:, ::-1])
    other = find_person(turned, np.array([600 - centre[0], centre[1]]), side).of_photo(600, 800)
    assert (plain != other[:, ::-1]).mean() < 0.002


def test_outside_of_the_photo_is_nobody(
    faces: dict[str, Array], detector: LandmarkDetector
) -> None:
    photo = faces["left"][:, 150:]
    centre, side = around(detector, faces["left"])
    person = find_person(photo, centre - [150, 0], 2 * side)
    rows = np.linspace(100, 700, 20)
    assert person.at(np.column_stack([np.full(20, -5.0), rows])).max() == 0


def test_a_mask_lies_where_it_was_made() -> None:
    alpha = np.zeros((50, 50), np.float32)
    alpha[10:20, 30:40] = 1
    person = PersonMask(alpha, np.array([100.0, 200.0]), 4.0)
    mask = person.of_photo(400, 500)
    rows, columns = np.nonzero(mask)
    assert (columns.min(), columns.max() + 1) == (100 + 4 * 30, 100 + 4 * 40)
    assert (rows.min(), rows.max() + 1) == (200 + 4 * 10, 200 + 4 * 20)
    places = np.array([[100 + 4 * 35.0, 200 + 4 * 15.0], [90.0, 210.0], [310.0, 250.0]])
    np.testing.assert_array_equal(person.at(places), [1, 0, 0])
