"""Verdicts on marks and photos, from residuals that are made up."""

from __future__ import annotations

import numpy as np
import pytest

from mien.model.verdict import Mark, PhotoFit, find_misfit, name_notes, typical_misfits
from people import camera


def photo_fit(distrusted: int, of: int, *, by_hand: bool = True) -> PhotoFit:
    marks = tuple(
        Mark(
            f"chin {n}", np.zeros(2), np.array([3.0, 4.0]), by_hand, "off" if n < distrusted else ""
        )
        for n in range(of)
    )
    return PhotoFit(camera(0), marks)


def test_a_photo_counts_by_its_trusted_marks() -> None:
    fit = photo_fit(2, 10)
    assert len(fit.trusted) == 8
    assert fit.rms_px == pytest.approx(5.0)
    assert photo_fit(3, 3).rms_px == 0.0


def test_names_are_doubted_when_many_marks_are_distrusted() -> None:
    photos = {"good.jpg": photo_fit(3, 10), "doubtful.jpg": photo_fit(4, 10)}
    (note,) = name_notes(photos)
    assert note.startswith("doubtful.jpg: 4 of its 10 hand-made marks are distrusted")
    assert name_notes({"detected.jpg": photo_fit(10, 10, by_hand=False)}) == ()


def test_typical_misfit_is_the_median_over_what_is_seen() -> None:
    residuals = np.array([[[3.0, 4.0], [0.0, 1.0], [np.nan, np.nan]]])
    assert typical_misfits(residuals, np.full((1, 3), 0.5)) == pytest.approx([6.0])


@pytest.mark.parametrize(
    ("typical", "worst"),
    [
        ([9.0], None),
        ([1.0, 1.2, 3.9], None),
        ([1.0, 1.2, 4.1], 2),
        ([5.0, 6.0, 7.0], None),
        ([30.0, 6.0, 7.0], 0),
    ],
)
def test_the_worst_photo_is_left_out_only_when_it_stands_apart(
    typical: list[float], worst: int | None
) -> None:
    found = find_misfit(np.array(typical))
    assert (found and found[0]) == worst
