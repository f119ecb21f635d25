"""A short performance, known exactly, followed frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
import pytest

import patterned
from marked import Blind
from mien.arrays import Array
from mien.errors import InputError
from mien.numeric.rotation import angle_between
from mien.track.landmarks.initialization import HeadDetection, HeadDetector
from mien.track.parameters import Parameters
from mien.track.state import TrackedFrame, TrackState
from mien.track.tracker import MISMATCH_RMS, Tracker, TrackOptions

FRAMES, FPS = 8, 25.0
NOBODY = np.full((patterned.SIZE, patterned.SIZE, 3), 70, np.uint8)


def truth(number: int) -> Parameters:
    """A head that turns and comes nearer while its mouth goes from neutral towards joy."""
    where = patterned.pose((4, 2 * number - 6, -3), (8 + number, -12, 630 - 2 * number))
    return Parameters(where, patterned.doing({"mouth": (0.09 * number, 0.0)}))


@cache
def frame(number: int) -> Array:
    return patterned.picture(truth(number))


def state_of(parameters: Parameters) -> TrackState:
    weights = patterned.model().weights(parameters.face)
    return TrackState(
        parameters.pose.R, parameters.pose.t, weights, parameters.face.units, parameters.face.gaze
    )


class Told:
    """Stands for the search by landmarks: a degree and some millimetres off, or blind."""

    def __init__(self) -> None:
        self.number: int | None = 0
        self.asked = 0

    def detect(self, *_: object, small: bool = False, **__: object) -> list[HeadDetection]:
        self.asked += 1
        if self.number is None or small:
            return []
        off = np.zeros(17)
        off[:6] = (0.015, -0.015, 0.01, 3, -2, 8)
        return [HeadDetection(state_of(truth(self.number).plus(off)), 1.0)]


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Told:
    one = Told()
    monkeypatch.setattr(HeadDetector, "detect", one.detect)
    return one


def tracker() -> Tracker:
    size = patterned.SIZE
    return Tracker(patterned.head(), size, size, focal_px=patterned.FOCAL, detector=Blind())


def followed(frames: Sequence[Array], by: Tracker | None = None) -> list[TrackedFrame]:
    by = by or tracker()
    return [by.step(pixels, number, number / FPS) for number, pixels in enumerate(frames)]


def assert_truth(
    found: TrackedFrame, number: int, *, degrees: float, share: float, weights: float
) -> None:
    assert found.state is not None
    true = state_of(truth(number))
    assert np.degrees(angle_between(found.state.R_cam_head, true.R_cam_head)) < degrees
    off = np.linalg.norm(found.state.t_cam_head - true.t_cam_head)
    assert off < share * true.t_cam_head[2]
    assert np.abs(found.state.weights - true.weights).mean() < weights


def test_a_performance(told: Told) -> None:
    found = followed([frame(number) for number in range(FRAMES)])
    assert [item.status for item in found] == ["ok"] * FRAMES
    assert told.asked == 1
    for number, item in enumerate(found):
        assert (item.frame, item.time) == (number, number / FPS)
        assert_truth(item, number, degrees=0.1, share=0.002, weights=0.02)
        assert item.seen > 0.9
        assert item.rms < 5
        assert item.deviations.shape == (len(tracker().layout.channels),)
        assert (item.deviations > 0).all()


def test_a_face_lost_and_found_again(told: Told) -> None:
    by = tracker()
    assert by.step(frame(0), 0, 0.0).status == "ok"
    told.number = None
    for number in (1, 2):
        lost = by.step(NOBODY, number, number / FPS)
        assert lost.status == "lost"
        assert lost.state is None
        assert np.isnan(lost.rms)
        assert lost.seen == 0
    told.number = 3
    again = by.step(frame(3), 3, 3 / FPS)
    assert again.status == "reacquired"
    assert_truth(again, 3, degrees=0.3, share=0.005, weights=0.08)
    assert by.step(frame(4), 4, 4 / FPS).status == "ok"


def test_nobody_from_the_start(told: Told) -> None:
    told.number = None
    by = tracker()
    assert by.step(NOBODY, 0, 0.0).status == "lost"
    told.number = 1
    assert by.step(frame(1), 1, 1 / FPS).status == "reacquired"


def assert_same(one: TrackedFrame, other: TrackedFrame) -> None:
    assert one.state is not None
    assert other.state is not None
    np.testing.assert_array_equal(one.state.R_cam_head, other.state.R_cam_head)
    np.testing.assert_array_equal(one.state.t_cam_head, other.state.t_cam_head)
    np.testing.assert_array_equal(one.state.values, other.state.values)
    np.testing.assert_array_equal(one.deviations, other.deviations)
    np.testing.assert_array_equal(one.gain, other.gain)
    assert (one.frame, one.status, one.rms, one.seen) == (
        other.frame,
        other.status,
        other.rms,
        other.seen,
    )


@pytest.mark.parametrize("done", [1, 3])
def test_resumed_it_goes_on_bit_for_bit(told: Told, done: int) -> None:
    frames = [frame(number) for number in range(5)]
    whole = followed(frames)
    by = tracker()
    by.resume(whole[:done])
    for number in range(done, 5):
        assert_same(by.step(frames[number], number, number / FPS), whole[number])


def test_the_same_pixels_smaller(told: Told) -> None:
    """A reduced frame is the same camera's."""
    import cv2

    half = patterned.SIZE // 2
    frames = [cv2.resize(frame(n), (half, half), interpolation=cv2.INTER_AREA) for n in range(3)]
    for number, item in enumerate(followed(frames)):
        assert_truth(item, number, degrees=0.6, share=0.01, weights=0.1)


def test_a_quarter_covered_from_the_third_frame_on(told: Told) -> None:
    frames = [frame(number).copy() for number in range(6)]
    middle = patterned.SIZE // 2
    for pixels in frames[3:]:
        pixels[middle:, :middle] = (205, 150, 120)
    for number, item in enumerate(followed(frames)):
        assert_truth(item, number, degrees=1.0, share=0.01, weights=0.15)
        if number >= 3:
            assert item.seen < 0.9


def test_units_of_ones_choice() -> None:
    size = patterned.SIZE
    options = TrackOptions(units=("jawOpen",))
    chosen = Tracker(
        patterned.head(), size, size, focal_px=500.0, detector=Blind(), options=options
    )
    assert chosen.layout.units == ("jawOpen",)
    with pytest.raises(InputError, match="wink"):
        Tracker(
            patterned.head(),
            size,
            size,
            focal_px=500.0,
            detector=Blind(),
            options=TrackOptions(units=("wink",)),
        )


def test_of_several_faces_the_heads_own_is_found(
    told: Told, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first, larger one is somewhere else; the landmarks of both fit alike."""
    elsewhere = HeadDetection(
        state_of(Parameters(patterned.pose((0, 0, 0), (90, 40, 500)), truth(0).face)), 1.0
    )
    alone = told.detect
    monkeypatch.setattr(
        HeadDetector, "detect", lambda *rest, **options: [elsewhere, *alone(**options)]
    )
    by = tracker()
    found = by.step(frame(0), 0, 0.0)
    assert found.status == "ok"
    assert_truth(found, 0, degrees=0.3, share=0.005, weights=0.08)
    assert not by.other_faces_seen


def disturbed(number: int) -> Array:
    """A frame that shows the face off by some 25 grey levels, in spots as large as features."""
    coarse = np.random.default_rng(1).normal(0, 45, (12, 12))
    spots = cv2.resize(coarse, (patterned.SIZE, patterned.SIZE), interpolation=cv2.INTER_CUBIC)
    return np.clip(frame(number) + spots[..., None], 0, 255).astype(np.uint8)


def test_after_the_head_no_other_face_is_taken_for_it(told: Told) -> None:
    other = disturbed(6)
    told.number = 6
    alone = tracker()
    assert alone.step(other, 0, 0.0).rms > MISMATCH_RMS, "where nobody else was, it may be the head"
    told.number = 0
    by = tracker()
    assert [item.status for item in followed([frame(k) for k in range(5)], by)] == ["ok"] * 5
    told.number = None
    assert by.step(NOBODY, 5, 5 / FPS).status == "lost"
    assert not by.other_faces_seen
    told.number = 6
    assert by.step(other, 6, 6 / FPS).status == "lost"
    assert by.other_faces_seen
    told.number = 7
    assert by.step(frame(7), 7, 7 / FPS).status == "reacquired"
