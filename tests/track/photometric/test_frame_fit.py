"""One frame, from coarse to fine: exact pictures, other colours, hands, faces not there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import patterned
from mien.arrays import Array
from mien.numeric.rotation import angle_between
from mien.track.image.colour_gain import Colours
from mien.track.image.drawing import Pose
from mien.track.parameters import Belief, Guess
from mien.track.photometric.frame_fit import FitOptions, Fitted, FrameFit
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS

WEIGHTS = {"mouth": (0.6, 0.1), "eyes": (0.1, 0.4), "forehead": (0.2, 0.5)}
TRUTH = Guess(patterned.pose(), patterned.doing(WEIGHTS))
COUNT = POSE_UNKNOWNS + len(TRUTH.face.vector)
DEVIATIONS = np.array([0.1] * 3 + [15.0, 15.0, 40.0, 0.3] + [0.3] * (COUNT - POSE_UNKNOWNS))
OFF = np.array([0.03, -0.03, 0.02, 4, -3, 10, 0, *[0.15, -0.1] * 3, 0, 0, 0, 0])


@pytest.fixture(scope="module")
def pixels() -> Array:
    return patterned.picture(TRUTH)


def fitted(
    pixels: Array, start: Guess | None = None, colours: Colours | None = None
) -> Fitted | None:
    start = start or TRUTH.moved(OFF)
    # More steps than in real time.
    fit = FrameFit(patterned.model(), FitOptions(iterations=10, tolerance=1e-5))
    belief = Belief(start, DEVIATIONS)
    return fit.fit(pixels, patterned.camera(TRUTH.pose), start, belief, colours or Colours())


def assert_truth(found: Fitted | None, *, degrees: float, share: float, weights: float) -> None:
    assert found is not None
    guess = found.guess
    assert np.degrees(angle_between(guess.pose.R, TRUTH.pose.R)) < degrees
    assert np.linalg.norm(guess.pose.t - TRUTH.pose.t) < share * TRUTH.pose.t[2]
    model = patterned.model()
    off = model.weights(guess.face) - model.weights(TRUTH.face)
    assert np.abs(off).mean() < weights


def test_the_truth_is_found(pixels: Array) -> None:
    found = fitted(pixels)
    assert_truth(found, degrees=0.1, share=0.002, weights=0.03)
    assert found is not None
    assert found.agreement.rms < 2
    assert found.agreement.seen > 0.9
    assert found.agreement.likeness > 0.99
    assert len(found.deviations) == COUNT
    np.testing.assert_allclose(found.colours.gain, 1, atol=0.03)


def test_another_cameras_colours(pixels: Array) -> None:
    """As found out in the frames before."""
    other = Colours(np.array([0.8, 0.9, 1.05]), np.array([12.0, -4.0, 3.0]))
    frame = np.clip(np.rint(other.applied(np.float32(pixels))), 0, 255).astype(np.uint8)
    found = fitted(frame, colours=other)
    assert_truth(found, degrees=0.1, share=0.002, weights=0.03)
    assert found is not None
    np.testing.assert_allclose(found.colours.gain, other.gain, atol=0.03)


def test_colours_come_nearer_frame_by_frame(pixels: Array) -> None:
    dark, colours, gains = np.uint8(np.rint(0.7 * pixels)), Colours(), []
    for _ in range(3):
        found = fitted(dark, TRUTH, colours)
        assert found is not None
        colours = found.colours
        gains.append(np.abs(colours.gain - 0.7).max())
    assert gains[2] < gains[0] < 0.3


def test_a_hand_on_a_quarter_of_the_face(pixels: Array) -> None:
    covered = pixels.copy()
    drawn = fitted(pixels)
    assert drawn is not None
    covered[patterned.SIZE // 2 :, : patterned.SIZE // 2] = (205, 150, 120)
    found = fitted(covered, TRUTH.moved(0.3 * OFF))
    assert_truth(found, degrees=0.7, share=0.005, weights=0.15)
    assert found is not None
    assert 0.55 < found.agreement.seen < 0.9


@pytest.mark.parametrize(
    "place", [(0, 0, -500), (2000, 0, 620), (0, 0, 80_000), (0, 0, 20)], ids=str
)
def test_no_face_there(pixels: Array, place: tuple[float, float, float]) -> None:
    """Behind the camera, beside the frame, a speck, around the camera."""
    assert fitted(pixels, replace(TRUTH, pose=Pose(TRUTH.pose.R, np.array(place)))) is None


def test_nobody_is_not_like_a_face() -> None:
    rng = np.random.default_rng(2)
    noise = rng.integers(0, 255, (patterned.SIZE, patterned.SIZE, 3)).astype(np.uint8)
    found = fitted(noise)
    assert found is None or found.agreement.likeness < 0.5


def test_half_out_of_the_frame() -> None:
    beside = replace(TRUTH, pose=patterned.pose(place=(-120, -12, 620)))
    pixels = patterned.picture(beside)
    found = fitted(pixels, beside.moved(0.3 * OFF))
    assert found is not None
    assert found.agreement.seen < 0.75
    assert np.degrees(angle_between(found.guess.pose.R, beside.pose.R)) < 0.5


def test_the_same_every_time(pixels: Array) -> None:
    one, other = fitted(pixels), fitted(pixels)
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.guess.since(TRUTH), other.guess.since(TRUTH))
    assert one.agreement == other.agreement
