from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.render.picture import GREY
from mien.report.track.sheet import contact_sheet, evenly_chosen
from mien.track.state import Track
from posable import head
from tracks import random_state, random_track, track_of


@pytest.fixture
def track(rng: np.random.Generator) -> Track:
    made = track_of([random_state(rng), None, random_state(rng)], rng)
    return replace(made, width=80, height=60, focal_px=150.0)


def test_first_and_last_and_evenly_between(rng: np.random.Generator) -> None:
    track = random_track(rng)
    assert [found.frame for found in evenly_chosen(track, 3).frames] == [0, 4, 8]
    assert evenly_chosen(track, 1).frames == track.frames[:1]
    assert evenly_chosen(track, 99) == track


@pytest.mark.parametrize(("columns", "shape"), [(3, (120, 248)), (2, (244, 164)), (9, (120, 248))])
def test_frames_above_what_was_found(track: Track, columns: int, shape: tuple[int, int]) -> None:
    frames = [np.full((60, 80, 3), 60 * (index + 1), np.uint8) for index in range(3)]
    pairs = zip(frames, track.frames, strict=True)
    sheet = contact_sheet(pairs, track, head(), columns=columns)
    assert sheet.shape == (*shape, 3)
    for index, frame in enumerate(frames):
        row, column = divmod(index, columns)
        top, left = 124 * row, 84 * column
        cell = sheet[top : top + 120, left : left + 80]
        assert (cell[20:60] == frame[20:]).all(), "but for its number"
        drawn = (cell[60:] != GREY).any(axis=2).mean()
        assert drawn < 0.1 if track.frames[index].state is None else drawn > 0.2
