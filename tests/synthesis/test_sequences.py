"""Pictures of a sequence change no more than its geometry does.

Each picture is made on its own ([Zhang 2006] section 14.1). A picture that jumped somewhere would
differ from the one before by the same amount however short the time between them; one that follows
differs by half when the steps of the geometry are half as long.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.synthesis.inference.coefficients import coefficients
from mien.synthesis.synthesizer import SynthesisOptions, Synthesizer

LAYOUT = load_feature_layout()
STEPS = 8
OPTIONS = {"default": SynthesisOptions(), "paper": SynthesisOptions.paper()}


def painted(size, number):
    """A pattern that all examples have and, as strong, wrinkles of its own."""
    width, height = size
    y, x = np.mgrid[:height, :width] + 0.5
    turns = [0.7 * number + channel for channel in range(3)]
    own = [np.sin((np.cos(turn) * x + np.sin(turn) * y) / 5) for turn in turns]
    common = np.sin(x / 5) * np.cos(y / 7)
    return np.uint8(127.5 + 60 * np.stack(own, axis=-1) + 60 * common[..., None])


@pytest.fixture(scope="module")
def person():
    """Ten examples whose points and textures have little to do with each other; key geometries."""
    rng = np.random.default_rng(7)
    size = (200, 250)
    neutral = (LAYOUT.template - LAYOUT.template.mean(0)) * 130 + [100, 125]
    x, y = LAYOUT.template.T
    wave, phase = rng.normal(0, 6, (2, 8, 2)), rng.uniform(0, 6, (2, 8))
    modes = np.sin(wave[..., :1] * x + wave[..., 1:] * y + phase[..., None])
    expressions = neutral + np.einsum("awn,mw->mna", modes, rng.normal(0, 2.0, (14, 8)))
    pairs = enumerate([neutral, *expressions[:9]])
    examples = tuple(Example(f"e{i}", painted(size, i), points, "") for i, points in pairs)
    subregions = default_subregions(LAYOUT, expressions[0], size)
    return ExampleSet(LAYOUT, examples, 1, expressions, subregions), [
        neutral,
        *expressions[9:],
        neutral,
    ]


@pytest.fixture(scope="module")
def filmed(shared: Path):
    """Sixteen frames of a clip as examples, spread over it; others as key geometries."""
    from mien.capture.faces.detector import LandmarkDetector
    from mien.capture.video.video import Video

    clip = Video(shared / "data" / "videos" / "driving_d10.mp4")
    frames = [frame.pixels() for i, frame in enumerate(clip.frames()) if i % 14 == 0]
    with LandmarkDetector() as detector:
        faces = [detector.detect_fast(frame) for frame in frames]
    points = [LAYOUT.from_landmarks(face.points[:, :2]) for face in faces]
    examples = tuple(Example(f"f{i}", frames[i], points[i], "") for i in range(0, len(frames), 2))
    height, width = frames[0].shape[:2]
    subregions = default_subregions(LAYOUT, points[0], (width, height))
    found = ExampleSet(LAYOUT, examples, 0, np.stack(points), subregions)
    found = replace(found, statistics=found.geometry(found.statistics))
    return found, [found.statistics[i] for i in (1, 9, 15, 23, 29)]


def path_of(keys, steps):
    """Points interpolated between key geometries, in equal steps between two of them."""
    fractions = np.arange(steps) / steps
    parts = [a + (b - a) * fractions[:, None, None] for a, b in pairwise(keys)]
    return np.concatenate([*parts, [keys[-1]]])


def picture_steps(example_set, keys, steps, options):
    """Between pictures: mean difference over the face, grey levels per px that points moved."""
    synthesizer = Synthesizer(example_set, options)
    shape = example_set.neutral.photo.shape[:2]
    face = np.zeros(shape, np.uint8)
    hull = cv2.convexHull(example_set.neutral.points.astype(np.float32)).astype(np.int32)
    cv2.fillConvexPoly(face, hull, 1)
    points = path_of(keys, steps)
    pictures = [synthesizer.synthesize(own).image[face > 0].astype(np.int16) for own in points]
    moved = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    differences = np.array([np.abs(b - a).mean() for a, b in pairwise(pictures)])
    return differences, differences / moved


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
@pytest.mark.parametrize(("who", "most"), [("person", 4), ("filmed", 2)])
def test_a_sequence_steps_no_farther_than_its_geometry(who, most, options, request):
    """Measured: 3 times the median step where wrinkles are made up, 1.3 on the clip."""
    example_set, keys = request.getfixturevalue(who)
    steps, per_px = picture_steps(example_set, keys, STEPS, options)
    finer, finer_per_px = picture_steps(example_set, keys, 2 * STEPS, options)
    assert finer.max() < 0.75 * steps.max()
    assert per_px.max() < most * np.median(per_px)
    assert finer_per_px.max() < most * np.median(finer_per_px)


@pytest.mark.parametrize("teeth", [(), (2, 5, 7)])
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_coefficients_do_not_jump(person, options, teeth):
    """Where they change fastest, ever nearer geometries have ever nearer coefficients."""
    example_set, keys = replace(person[0], teeth=teeth), person[1]

    def mixture(points):
        tied, penalty = options.tied, options.distance_penalty
        return coefficients(example_set, points, distance_penalty=penalty, tied=tied)

    path = path_of(keys, STEPS)
    found = [mixture(points) for points in path]
    steps = [np.abs(b - a).sum(axis=1).max() for a, b in pairwise(found)]
    first = int(np.argmax(steps))
    near, far = path[first], path[first + 1]
    differences = []
    for _ in range(10):
        middle = (near + far) / 2
        before, after = (
            np.abs(mixture(a) - mixture(b)).sum(axis=1).max()
            for a, b in ((near, middle), (middle, far))
        )
        differences.append(max(before, after))
        near, far = (near, middle) if before > after else (middle, far)
    assert differences[-1] < 0.02 * max(steps)
