"""One frame, from coarse to fine: exact pictures, other colours, hands, faces not there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import patterned
from mien.arrays import Array
from mien.numeric.rotation import angle_between
from mien.track.image.colour_gain import ColourGain
from mien.track.image.drawing import Pose
from mien.track.parameters import GaussianPrior, Parameters
from mien.track.photometric.frame_fit import FrameFitOptions, FrameFitter, FrameSolution
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS

WEIGHTS = {"mouth": (0.6, 0.1), "eyes": (0.1, 0.4), "forehead": (0.2, 0.5)}
TRUTH = Parameters(patterned.pose(), patterned.doing(WEIGHTS))
COUNT = POSE_UNKNOWNS + len(TRUTH.face.vector)
DEVIATIONS = np.array([0.1] * 3 + [15.0, 15.0, 40.0, 0.3] + [0.3] * (COUNT - POSE_UNKNOWNS))
OFF = np.array([0.03, -0.03, 0.02, 4, -3, 10, 0, *[0.15, -0.1] * 3, 0, 0, 0, 0])


@pytest.fixture(scope="module")
def pixels() -> Array:
    return patterned.picture(TRUTH)


def fitted(
    pixels: Array, start: Parameters | None = None, colour_gain: ColourGain | None = None
) -> FrameSolution | None:
    start = start or TRUTH.plus(OFF)
    # More steps than in real time.
    fit = FrameFitter(patterned.model(), FrameFitOptions(iterations=10, tolerance=1e-5))
    prior = GaussianPrior(start, DEVIATIONS)
    return fit.fit(pixels, patterned.camera(TRUTH.pose), start, prior, colour_gain or ColourGain())


def assert_truth(
    found: FrameSolution | None, *, degrees: float, share: float, weights: float
) -> None:
    assert found is not None
    parameters = found.parameters
    assert np.degrees(angle_between(parameters.pose.R, TRUTH.pose.R)) < degrees
    assert np.linalg.norm(parameters.pose.t - TRUTH.pose.t) < share * TRUTH.pose.t[2]
    model = patterned.model()
    off = model.weights(parameters.face) - model.weights(TRUTH.face)
    assert np.abs(off).mean() < weights


def test_the_truth_is_found(pixels: Array) -> None:
    found = fitted(pixels)
    assert_truth(found, degrees=0.1, share=0.002, weights=0.03)
    assert found is not None
    assert found.error.rms < 2
    assert found.error.seen > 0.9
    assert found.error.ncc > 0.99
    assert len(found.deviations) == COUNT
    np.testing.assert_allclose(found.colour_gain.gain, 1, atol=0.03)


def test_another_cameras_colours(pixels: Array) -> None:
    """As found out in the frames before."""
    other = ColourGain(np.array([0.8, 0.9, 1.05]), np.array([12.0, -4.0, 3.0]))
    frame = np.clip(np.rint(other.applied(np.float32(pixels))), 0, 255).astype(np.uint8)
    found = fitted(frame, colour_gain=other)
    assert_truth(found, degrees=0.1, share=0.002, weights=0.03)
    assert found is not None
    np.testing.assert_allclose(found.colour_gain.gain, other.gain, atol=0.03)


def test_colours_come_nearer_frame_by_frame(pixels: Array) -> None:
    dark, colour_gain, gains = np.uint8(np.rint(0.7 * pixels)), ColourGain(), []
    for _ in range(3):
        found = fitted(dark, TRUTH, colour_gain)
        assert found is not None
        colour_gain = found.colour_gain
        gains.append(np.abs(colour_gain.gain - 0.7).max())
    assert gains[2] < gains[0] < 0.3


def test_a_hand_on_a_quarter_of_the_face(pixels: Array) -> None:
    covered = pixels.copy()
    drawn = fitted(pixels)
    assert drawn is not None
    covered[patterned.SIZE // 2 :, : patterned.SIZE // 2] = (205, 150, 120)
    found = fitted(covered, TRUTH.plus(0.3 * OFF))
    assert_truth(found, degrees=0.7, share=0.005, weights=0.15)
    assert found is not None
    assert 0.55 < found.error.seen < 0.9


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
    assert found is None or found.error.ncc < 0.5


def test_half_out_of_the_frame() -> None:
    beside = replace(TRUTH, pose=patterned.pose(place=(-120, -12, 620)))
    pixels = patterned.picture(beside)
    found = fitted(pixels, beside.plus(0.3 * OFF))
    assert found is not None
    assert found.error.seen < 0.75
    assert np.degrees(angle_between(found.parameters.pose.R, beside.pose.R)) < 0.5


def test_the_same_every_time(pixels: Array) -> None:
    one, other = fitted(pixels), fitted(pixels)
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.parameters.minus(TRUTH), other.parameters.minus(TRUTH))
    assert one.error == other.error
