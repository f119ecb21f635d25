from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.track_changes import changes, covering, extra_expressions, face_masks
from benchmarks.track_scenes import (
    Performance,
    choose_three,
    cluttered,
    known_path,
    known_weights,
    perform,
    with_expressions,
)

from mien.errors import InputError
from mien.numeric.rotation import rotation_to_vector
from posable import head

SHOWN = ("neutral", "anger", "joy")


@pytest.fixture(scope="module")
def scene() -> Performance:
    return perform(with_expressions(head(), SHOWN), frames=9, size=120)


def test_the_head_turns_as_far_as_said() -> None:
    rotations, places = known_path(401)
    turns = np.degrees(rotation_to_vector(rotations @ np.diag([1.0, -1.0, -1.0])))
    assert np.abs(turns[:, 1]).max() == pytest.approx(25, abs=1.5)
    assert np.ptp(places, axis=0).min() > 30
    steps = np.abs(np.diff(turns, axis=0)).max()
    assert steps < 1


def test_weights_sum_to_one_and_show_each_alone() -> None:
    weights = known_weights(201)
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    assert (weights.max(axis=0) > 0.99).all()
    assert (weights[[0, -1]] == [1, 0, 0]).all()
    assert (weights.min(axis=1) > 0.15).any()
    assert np.abs(np.diff(weights, axis=0)).max() < 0.1


def test_truth_and_pictures_belong_together(scene: Performance) -> None:
    assert scene.truth.layout.expressions == SHOWN
    assert len(scene.frames) == len(scene.truth.frames) == 9
    for frame, tracked in zip(scene.frames, scene.truth.frames, strict=True):
        assert tracked.state is not None
        shown = (frame != (52, 54, 58)).any(axis=2)
        rows, columns = np.nonzero(shown)
        vertices = scene.head.mesh.vertices
        pixels = scene.truth.camera(tracked.state).project(vertices)
        inside = np.clip(pixels, 0, 120)
        assert abs(columns.min() - inside[:, 0].min()) < 3
        assert abs(rows.max() + 1 - inside[:, 1].max()) < 3


def test_parts_are_given_to_what_is_alike() -> None:
    assert choose_three(head()) == SHOWN
    clip = replace(
        head(),
        expressions=dict(
            zip(("neutral", "smile", "x", "frown"), head().expressions.values(), strict=True)
        ),
    )
    assert choose_three(clip) == ("neutral", "frown", "smile")
    alone = with_expressions(head(), ("neutral", "joy"))
    with pytest.raises(InputError, match="two expressions beside neutral"):
        choose_three(alone)


def test_a_head_keeps_only_the_expressions_wanted() -> None:
    one = with_expressions(head(), ("neutral", "awe"))
    assert tuple(one.expressions) == ("neutral", "awe")
    assert set(one.textures) == {"atlas", "awe"}
    with pytest.raises(InputError, match="grief"):
        with_expressions(head(), ("neutral", "grief"))


def test_models_get_other_expressions() -> None:
    assert extra_expressions(("neutral", "joy", "anger", "awe"), SHOWN, 1) == ("awe",)


def test_changes_do_what_they_say(scene: Performance) -> None:
    rng = np.random.default_rng(0)
    changed = {change.name: change.apply(scene, rng) for change in changes()}
    first = scene.frames[0].astype(int)
    assert (changed["clean"][0] == first).all()
    assert np.abs(changed["colours x 0.7"][0] - 0.7 * first).max() <= 0.5
    noise = changed["noise of 10 grey levels"][0] - first
    inner = noise[(first > 50) & (first < 205)]
    assert inner.std() == pytest.approx(10, rel=0.05)
    assert changed["half resolution"][0].shape == (60, 60, 3)


@pytest.mark.parametrize("moving", [False, True])
def test_hands_cover_a_quarter(scene: Performance, moving: bool) -> None:
    masks = face_masks(scene)
    hands = covering(scene, moving=moving)
    shares = [(h & m).sum() / m.sum() for h, m in zip(hands, masks, strict=True)]
    assert np.mean(shares) == pytest.approx(0.25, abs=0.02)
    assert (hands[0] != hands[2]).any() == moving


def test_clutter_is_that_of_its_seed() -> None:
    one, same, other = (cluttered(90, np.random.default_rng(seed)) for seed in (0, 0, 1))
    assert (one == same).all()
    assert (one != other).any()
    assert one.std() > 20
