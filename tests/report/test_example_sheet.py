"""The contact sheet of examples."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.assets.subregions import Subregions
from mien.report.example_sheet import example_sheet
from mien.synthesis.examples.example_set import Example, ExampleSet


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    return load_feature_layout()


def spotted(layout: FeatureLayout, scale: float, size: tuple[int, int]) -> tuple[Array, Array]:
    """A blue photo, red around the tip of the nose, and the points of its face."""
    points = scale * layout.template + np.array(size[::-1]) / 2
    photo = np.full((*size, 3), (0, 0, 200), np.uint8)
    x, y = points[layout.index("nose_tip")]
    reach = scale / 10
    photo[round(y - reach) : round(y + reach), round(x - reach) : round(x + reach)] = (220, 0, 0)
    return photo, points


def faces(layout: FeatureLayout, count: int) -> ExampleSet:
    """Faces of several sizes in photos of several sizes."""
    examples = []
    for number in range(count):
        photo, points = spotted(layout, 60 + 40 * number, (220 + 90 * number, 200 + 100 * number))
        examples.append(Example(f"frame_{number}", photo, points, ""))
    height, width = examples[0].photo.shape[:2]
    everywhere = Subregions(("face",), np.ones((height, width, 1), np.float32), (np.arange(9),))
    return ExampleSet(layout, tuple(examples), 0, examples[0].points[None], everywhere, (1,))


def test_every_face_has_the_same_size_whatever_its_photo(layout: FeatureLayout) -> None:
    sheet = example_sheet(faces(layout, 3), {"frame_1": "chosen"}, columns=2)
    width = (sheet.shape[1] - 4) // 2
    height = (sheet.shape[0] - 4) // 2
    cells = [(0, 0), (0, width + 4), (height + 4, 0)]
    reds = []
    for top, left in cells:
        cell = sheet[top : top + height, left : left + width]
        rows, columns = np.nonzero((cell[..., 0] > 150) & (cell[..., 2] < 60))
        reds.append((rows.mean(), columns.mean(), np.ptp(rows), np.ptp(columns)))
    np.testing.assert_allclose(reds[1:], [reds[0]] * 2, atol=3)


def test_the_caption_is_under_the_face(layout: FeatureLayout) -> None:
    """No reason, one line; a reason, more ink. Nothing but paper beside the last one."""
    shown = faces(layout, 3)
    bare = example_sheet(shown, {}, columns=3)
    told = example_sheet(shown, {"frame_0": "chosen as number 3, for the left brow"}, columns=3)
    first = slice(0, (bare.shape[1] - 8) // 3)
    np.testing.assert_array_equal(bare[:300], told[:300])
    assert (told[300:, first] < 200).sum() > 1.5 * (bare[300:, first] < 200).sum()
    two_rows = example_sheet(shown, {}, columns=2)
    assert (two_rows[two_rows.shape[0] // 2 + 4 :, two_rows.shape[1] // 2 + 4 :] == 255).all()
