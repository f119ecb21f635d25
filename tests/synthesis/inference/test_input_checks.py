"""Points of faces that were mirrored, moved or exchanged on purpose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.errors import EstimationError, InputError
from mien.numeric.planar_similarity import PlanarSimilarity
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.synthesis.inference.input_checks import (
    MIN_STATISTICS,
    OUTLIER_RMS,
    face_width,
    head_moved,
    look_mirrored,
    mahalanobis_rms,
)

WIDTH, HEIGHT = 160, 200
FACE = 100.0
MOVED = PlanarSimilarity(np.array(1.1), np.array(0.15), np.array([-20.0, 4.0]))


@pytest.fixture(scope="module")
def layout():
    return load_feature_layout()


@pytest.fixture(scope="module")
def example_set(layout):
    """A mean face that is 100 px wide, with 80 expressions of six smooth modes."""
    rng = np.random.default_rng(8)
    neutral = (layout.template - layout.template.mean(0)) * FACE + [WIDTH / 2, HEIGHT / 2]
    photo = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    subregions = default_subregions(layout, neutral, (WIDTH, HEIGHT))
    expressions = np.stack([expression(layout, neutral, row) for row in rng.normal(0, 1, (80, 6))])
    found = ExampleSet(
        layout, (Example("neutral", photo, neutral, ""),), 0, expressions, subregions
    )
    return replace(found, statistics=found.geometry(expressions))


def expression(layout, neutral, amounts):
    """Points that move by waves over the face, 1.5 px each."""
    rng = np.random.default_rng(3)
    x, y = layout.template.T
    moved = neutral.copy()
    for amount in amounts:
        wave, phase = rng.normal(0, 5, (2, 2)), rng.uniform(0, 6, 2)
        waves = [np.sin(wave[i, 0] * x + wave[i, 1] * y + phase[i]) for i in (0, 1)]
        moved += 1.5 * amount * np.stack(waves, axis=-1)
    return moved


def indices(layout, *names):
    return np.array([layout.index(name) for name in names])


def test_the_width_of_a_face(layout, example_set):
    neutral = example_set.neutral.points
    assert face_width(layout, neutral) == pytest.approx(FACE)
    assert face_width(layout, MOVED(neutral)) == pytest.approx(FACE * np.hypot(1.1, 0.15))
    with pytest.raises(EstimationError, match="share a place"):
        face_width(layout, np.ones_like(neutral))


SOME = {
    "all": None,
    "mouth and chin": ("right_mouth_corner", "left_mouth_corner", "menton"),
    "right side": ("right_brow_upper.0", "right_eye_outer", "right_mouth_corner"),
    "eyes and mouth": ("right_eye_outer", "left_eye_outer", "left_mouth_corner"),
}


@pytest.mark.parametrize("names", SOME.values(), ids=SOME)
def test_points_whose_right_is_left_look_mirrored(layout, example_set, names):
    neutral = example_set.neutral.points
    known = np.arange(len(neutral)) if names is None else indices(layout, *names)
    points = MOVED(expression(layout, neutral, [0.5, -0.5, 0, 0.5, 0, 0.5]))
    flipped = [WIDTH, 0] + points * [-1, 1]
    assert not look_mirrored(layout, neutral, known, points[known])
    assert look_mirrored(layout, neutral, known, flipped[known])
    assert look_mirrored(layout, neutral, known, points[layout.mirror[known]])


def test_points_of_the_midline_never_look_mirrored(layout, example_set):
    neutral = example_set.neutral.points
    known = np.flatnonzero(layout.mirror == np.arange(len(neutral)))
    flipped = [WIDTH, 0] + neutral * [-1, 1]
    assert not look_mirrored(layout, neutral, known, flipped[known])


def test_one_point_cannot_look_mirrored(layout, example_set):
    with pytest.raises(InputError, match="known: expected at least 2 points, got 1"):
        look_mirrored(layout, example_set.neutral.points, np.array([3]), np.zeros((1, 2)))


@pytest.mark.parametrize("amount", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("count", [3, 12, 134])
def test_expressions_are_no_motion_of_the_head(layout, example_set, count, amount):
    neutral = example_set.neutral.points
    known = np.random.default_rng(count).permutation(len(neutral))[:count]
    points = example_set.geometry(expression(layout, neutral, [1, -1, 0.5, 1, 0, 1]))
    points = neutral + amount * (points - neutral)
    assert not head_moved(example_set, known, points[known])


@pytest.mark.parametrize("count", [3, 12, 134])
def test_a_head_that_moves_with_its_expression_has_moved(layout, example_set, count):
    neutral = example_set.neutral.points
    known = np.random.default_rng(count).permutation(len(neutral))[:count]
    points = MOVED(expression(layout, neutral, [1, -1, 0.5, 1, 0, 1]))
    assert head_moved(example_set, known, points[known])


def test_another_person_is_an_outlier_and_the_same_one_is_not(layout, example_set):
    neutral = example_set.neutral.points
    own = expression(layout, neutral, [1, -1, 0.5, 1, 0, 1])
    assert mahalanobis_rms(example_set, own) < OUTLIER_RMS / 2
    assert mahalanobis_rms(example_set, MOVED(own)) == pytest.approx(
        mahalanobis_rms(example_set, own), rel=1e-6
    )
    nose = [i for i, name in enumerate(layout.names) if "nose" in name]
    wider = own.copy()
    wider[nose, 0] += 0.4 * (wider[nose, 0] - neutral[:, 0].mean())
    longer = own * [1, 1.1]
    assert (
        min(mahalanobis_rms(example_set, wider), mahalanobis_rms(example_set, longer)) > OUTLIER_RMS
    )


def test_few_expressions_give_no_distance(example_set):
    few = replace(example_set, statistics=example_set.statistics[: MIN_STATISTICS - 1])
    assert mahalanobis_rms(few, few.neutral.points) is None


def test_real_people_are_distinguished(shared, layout):
    """Frames of one clip, and two photos of another person."""
    from mien.capture.faces.detector import LandmarkDetector
    from mien.capture.images.photos import load_photo
    from mien.capture.video.video import Video

    clip = Video(shared / "data" / "videos" / "driving_d10.mp4")
    with LandmarkDetector() as detector:
        frames = (frame for number, frame in enumerate(clip.frames()) if number % 7 == 0)
        faces = [detector.detect_fast(frame.pixels()) for frame in frames]
        found = [layout.from_landmarks(face.points[:, :2]) for face in faces]
        others = [
            layout.from_landmarks(detector.detect(load_photo(path)).points)
            for path in sorted((shared / "data" / "london").glob("02*.jpg"))
        ]
    photo = np.zeros((512, 512, 3), np.uint8)
    subregions = default_subregions(layout, found[0], (512, 512))
    examples = (Example("neutral", photo, found[0], ""),)
    clip_set = ExampleSet(layout, examples, 0, np.stack(found[::2]), subregions)
    clip_set = replace(clip_set, statistics=clip_set.geometry(clip_set.statistics))
    own = np.array([mahalanobis_rms(clip_set, points) for points in found[1::2]])
    assert (own < OUTLIER_RMS).mean() > 0.85
    assert min(mahalanobis_rms(clip_set, points) for points in others) > OUTLIER_RMS
