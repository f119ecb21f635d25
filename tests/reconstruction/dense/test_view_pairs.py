from __future__ import annotations

import numpy as np

from marbled import at
from mien.reconstruction.dense.view_pairs import choose_pairs


def test_one_and_two_photos() -> None:
    assert choose_pairs([at(0)]) == []
    assert choose_pairs([at(-24), at(24)]) == [(0, 1)]


def test_photos_too_far_apart_are_not_matched() -> None:
    assert choose_pairs([at(-40), at(40)]) == []
    pairs = choose_pairs([at(-60), at(-20), at(20), at(60)])
    assert {(0, 1), (1, 2), (2, 3)} <= set(pairs)
    assert (0, 3) not in pairs


def test_many_photos_have_few_neighbours_and_hang_together() -> None:
    yaws = np.linspace(-75, 75, 24)
    pairs = choose_pairs([at(yaw, 3 * (-1) ** k) for k, yaw in enumerate(yaws)])
    assert all(a < b for a, b in pairs)
    assert len(pairs) <= 3 * 24
    reached = {0}
    for _ in range(24):
        reached |= {b for a, b in pairs if a in reached} | {a for a, b in pairs if b in reached}
    assert reached == set(range(24))


def test_neighbours_are_far_enough_to_tell_depth() -> None:
    yaws = np.linspace(-60, 60, 25)
    pairs = choose_pairs([at(yaw) for yaw in yaws])
    apart = np.array([abs(yaws[a] - yaws[b]) for a, b in pairs])
    assert 10 < np.median(apart) < 30


def test_a_lonely_photo_is_linked_to_the_nearest() -> None:
    pairs = choose_pairs([at(-10), at(0), at(10), at(20), at(72)])
    assert any(4 in pair for pair in pairs)
