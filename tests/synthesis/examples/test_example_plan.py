"""Which pictures become neutral, standard, examples, teeth and statistics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clips import scored
from mien.arrays import Array
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.capture.faces.face_series import FaceSeries
from mien.capture.images.photos import Photo
from mien.capture.video.frame_selection import FrameScores
from mien.errors import InputError
from mien.synthesis.examples.example_plan import (
    ExamplePlan,
    SelectionOverrides,
    build_examples,
    lip_gaps,
    plan_examples,
)

OPEN = (0.0, 0.0, 6.0, 0.0, 4.0, 0.1)
"""How far the lips of six pictures are apart, px of a face 100 wide."""
RAISED = (0.0, 0.0, 0.0, 6.0, 0.0, 0.0)
"""How far the right brow goes up in them."""


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    return load_feature_layout()


@pytest.fixture(scope="module")
def points(layout: FeatureLayout) -> Array:
    """Six faces whose head moves as well."""
    rest = 100 * layout.template + 120
    upper = layout.index("upper_lip_inner")
    lower = [i for i, name in enumerate(layout.names) if "lower_lip_" in name]
    brow = [i for i, name in enumerate(layout.names) if name.startswith("right_brow")]
    lips = [i for i, name in enumerate(layout.names) if "lip_" in name or "teeth" in name]
    rest[lips, 1] = rest[upper, 1]
    faces = np.tile(rest, (6, 1, 1))
    faces[:, lower, 1] += np.array(OPEN)[:, None]
    faces[:, brow, 1] -= np.array(RAISED)[:, None]
    return faces + 5 * np.arange(6)[:, None, None]


def series_of(names: Sequence[str] = (), **changes: Array) -> FaceSeries:
    """Six frames at rest except the third to the fifth."""
    blendshapes = np.stack([scored()] * 2 + [scored(jawOpen=0.9)] * 3 + [scored()])
    scores = FrameScores(
        np.arange(6),
        np.array([1.0, 1.2, 1, 1, 1, 1]),
        np.zeros((6, 2)),
        blendshapes,
        np.array(OPEN),
    )
    return FaceSeries(
        source=Path("anna.mp4"),
        is_video=not names,
        files=(),
        names=tuple(names) or tuple(f"frame_{i:06d}.png" for i in range(6)),
        landmarks=np.zeros((6, 478, 2)),
        sizes=np.full((6, 2), 300),
        scores=replace(scores, **changes),
        seconds=None,
        max_side=300,
        left_out={},
        notes=(),
    )


def chosen(plan: ExamplePlan) -> list[int]:
    return plan.choice.rows.tolist()


def test_rest_comes_first_and_the_widest_mouth_is_the_standard(
    layout: FeatureLayout, points: Array
) -> None:
    plan = plan_examples(layout, series_of(), points)
    # The second is as much at rest as the first, and sharper, which it is like.
    assert chosen(plan)[:2] == [1, 2]
    assert plan.standard == 1
    assert sorted(chosen(plan)) == [1, 2, 3, 4]
    assert plan.choice.reasons[1:3] == ("neutral", "standard, its mouth is most open")
    assert plan.choice.reasons[0] == "like frame_000001.png"
    assert len(plan.statistics) == 6


def test_the_motion_of_the_head_is_no_expression(layout: FeatureLayout, points: Array) -> None:
    plan = plan_examples(layout, series_of(), points)
    np.testing.assert_allclose(plan.geometries[0], points[1], atol=1e-9)


def test_everything_can_be_overruled(layout: FeatureLayout, points: Array) -> None:
    overrides = SelectionOverrides(neutral=0, standard=4, include=(5, 0), exclude=(3,))
    plan = plan_examples(layout, series_of(), points, overrides=overrides)
    assert chosen(plan) == [0, 4, 5, 2]
    assert plan.standard == 1
    assert plan.choice.reasons[4:] == ("standard, as asked for", "as asked for")
    assert plan.choice.reasons[3] == "excluded"
    assert len(plan.statistics) == 5


def test_overrides_that_contradict_each_other(layout: FeatureLayout, points: Array) -> None:
    with pytest.raises(InputError, match="exclude: expected others than those that are wanted"):
        plan_examples(
            layout, series_of(), points, overrides=SelectionOverrides(include=(3,), exclude=(3,))
        )


def test_rejected_and_blurred_ones_are_neither_rest_nor_standard_nor_statistics(
    layout: FeatureLayout, points: Array
) -> None:
    sharpness = np.array([1.0, 1.2, 0.2, 1, 1, 1])
    rejections = ("", "covered", "", "", "", "")
    plan = plan_examples(layout, series_of(sharpness=sharpness), points, rejections=rejections)
    assert chosen(plan)[:2] == [0, 4]
    assert plan.choice.reasons[1:3] == ("covered", "blurred, 20% of the usual sharpness")
    assert len(plan.statistics) == 4


def test_a_folder_called_neutral_has_the_face_at_rest(layout: FeatureLayout, points: Array) -> None:
    names = ["a/1.jpg", "a/2.jpg", "a/3.jpg", "neutral/4.jpg", "a/5.jpg", "a/6.jpg"]
    assert chosen(plan_examples(layout, series_of(names), points))[0] == 3


def test_one_picture_is_an_example_set(layout: FeatureLayout, points: Array) -> None:
    whole = series_of()
    scores = FrameScores(*(getattr(whole.scores, f)[:1] for f in FrameScores.__dataclass_fields__))
    alone = replace(whole, names=whole.names[:1], scores=scores)
    plan = plan_examples(layout, alone, points[:1])
    assert (chosen(plan), plan.standard) == ([0], 0)
    assert plan.choice.reasons == ("neutral and standard",)


def photos_of(plan: ExamplePlan) -> dict[int, Photo]:
    return {
        row: Photo(plan.names[row], Path("a"), np.full((300, 300, 3), 40 + row, np.uint8))
        for row in chosen(plan)
    }


def test_examples_of_a_plan(layout: FeatureLayout, points: Array) -> None:
    plan = plan_examples(layout, series_of(), points)
    examples, why = build_examples(plan, photos_of(plan), source="anna.mp4", equalize=False)
    assert [example.name for example in examples.examples[:2]] == ["frame_000001", "frame_000002"]
    assert examples.neutral.source == "anna.mp4, frame 000001"
    assert why["frame_000001"] == "neutral"
    assert list(why) == [example.name for example in examples.examples]
    assert (examples.examples[1].photo == 42).all()
    # Only lips 4 and 6 px apart show teeth.
    assert {examples.examples[row].name for row in examples.teeth} == {
        "frame_000002",
        "frame_000004",
    }
    np.testing.assert_allclose(examples.geometries, plan.geometries[chosen(plan)], atol=1e-9)


def test_photos_of_one_name_in_two_folders(layout: FeatureLayout, points: Array) -> None:
    names = ["a/x.jpg", "a/y.jpg", "joy/y.jpg", "joy/y.png", "joy/x.jpg", "b.jpg"]
    plan = plan_examples(layout, series_of(names), points)
    examples, _ = build_examples(plan, photos_of(plan))
    assert {example.name for example in examples.examples} == {
        "a-y",
        "joy-y.jpg",
        "joy-y.png",
        "joy-x",
    }
    assert examples.neutral.source == "a/y.jpg"


def test_gaps_of_lips(layout: FeatureLayout, points: Array) -> None:
    np.testing.assert_allclose(lip_gaps(layout, points), OPEN)


def test_the_correction_of_the_examples_points_is_applied_to_all(
    layout: FeatureLayout, points: Array
) -> None:
    """A detector that has every brow 2 px too low: measured in the examples, corrected in all."""
    shift = np.zeros_like(points[0])
    brows = [index for index, name in enumerate(layout.names) if "_brow_" in name]
    shift[brows, 1] = -2.0
    plan = plan_examples(layout, series_of(), points)
    better = {row: points[row] + shift for row in chosen(plan)}
    moved = plan.with_points(better)
    truth = plan_examples(layout, series_of(), points + shift)
    np.testing.assert_allclose(moved.points[chosen(plan)], list(better.values()))
    np.testing.assert_allclose(moved.geometries, truth.geometries, atol=0.05)
    assert np.abs(plan.geometries - truth.geometries).max() > 1
    built, _ = build_examples(moved, photos_of(plan), equalize=False)
    np.testing.assert_allclose(built.neutral.points, points[chosen(plan)[0]] + shift)
    np.testing.assert_allclose(built.statistics, moved.statistics)
