from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.arrays import Array
from mien.report.track.caption import STATUS_COLOURS, draw_text, frame_caption
from mien.track.state import STATUSES, Status, TrackedFrame
from tracks import frame_of, random_state


@pytest.fixture
def found(rng: np.random.Generator) -> TrackedFrame:
    return frame_of(12, 3.4, random_state(rng), rng)


def coloured(image: Array, colour: tuple[int, int, int]) -> int:
    return int((np.abs(image.astype(int) - colour).max(axis=2) < 40).sum())


@pytest.mark.parametrize("status", STATUSES)
def test_the_status_has_its_colour(found: TrackedFrame, status: Status) -> None:
    strip = frame_caption(replace(found, status=status), 900)
    counts = {name: coloured(strip, colour) for name, colour in STATUS_COLOURS.items()}
    assert max(counts, key=counts.__getitem__) == status


@pytest.mark.parametrize("width", [90, 900, 1920])
def test_as_wide_as_asked_and_of_even_height(found: TrackedFrame, width: int) -> None:
    strip = frame_caption(found, width)
    assert strip.shape[1] == width
    assert strip.shape[0] % 2 == 0


def test_words_keep_their_positions(found: TrackedFrame) -> None:
    one, other = frame_caption(found, 900), frame_caption(replace(found, frame=11113), 900)
    changed = np.flatnonzero((one != other).any(axis=(0, 2)))
    assert 0 < changed.min() < changed.max() < 130


def test_text_is_centred_where_asked() -> None:
    grey = np.full((60, 120, 3), 90, np.uint8)
    written = draw_text(grey, "x", (250, 20, 20), at=(0.75, 0.5), size=12)
    rows, columns = np.nonzero((written != grey).any(axis=2))
    assert abs(columns.mean() - 90) < 2
    assert abs(rows.mean() - 30) < 4
    assert (written[rows, columns, 0] >= 90).all()
    outlined = draw_text(grey, "x", (250, 20, 20), at=(0.75, 0.5), size=12, outline=2)
    assert (outlined < 60).any()
