"""Real tracking of a head that is known, through clips as cameras and phones write them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import mien.pipelines.tracking.prepared_head
from filmed import flagged, written
from mien.arrays import Array
from mien.camera import FRONTAL, Camera
from mien.capture.video.video import Video
from mien.errors import EstimationError, FileFormatError
from mien.head import Head
from mien.io.head.head_folder import load_head
from mien.io.tracks.track_csv import load_track
from mien.io.tracks.track_journal import journal_of
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.pipelines.track import Tracked, track_video
from mien.pipelines.tracking.outputs import TrackFiles
from mien.pipelines.tracking.run import head_digest, mean_fps
from mien.render.picture import HeadRenderer
from mien.rig.state import FaceState
from mien.track.state import Track, TrackedFrame
from mien.track.tracker import Tracker
from posable import head as other_head

WIDTH, HEIGHT, FOCAL = 240, 288, 420.0
WITH_FACE = (0, 1, 2, 4, 5, 27, 28, 30)
"""When the camera sees it, in tenths of a second; there is nobody for two seconds."""
TIMES = (*WITH_FACE[:5], *range(6, 27), *WITH_FACE[5:])
LENS = f"{FOCAL}px"


@dataclass(frozen=True)
class Filmed:
    """A clip of a head whose places are known, and its track."""

    head: Head
    frames: list[Array]
    track: Track
    tracked: Tracked


def camera_at(tenths: int) -> Camera:
    """That sees the head turn steadily and come nearer."""
    turn = rotation_from_vector(np.array([0.02, np.radians(tenths - 15), 0.03]))
    place = np.array([tenths - 10.0, 20.0, 480.0 - tenths])
    return Camera(WIDTH, HEIGHT, FOCAL, FRONTAL @ turn, place)


def film(head: Head) -> list[Array]:
    renderer = HeadRenderer(head)
    wall = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    wall[:, ::24] = 140
    frames = []
    for tenths in TIMES:
        picture = wall
        if tenths in WITH_FACE:
            picture = renderer.draw(FaceState(), camera_at(tenths), background=wall)[..., :3]
        frames.append(picture)
    return frames


@pytest.fixture(scope="module")
def filmed(expressive: Path, tmp_path_factory: pytest.TempPathFactory) -> Filmed:
    place = tmp_path_factory.mktemp("filmed")
    head = load_head(expressive)
    frames = film(head)
    clip = written(place / "a.mp4", frames, TIMES)
    tracked = track_video(clip, head, TrackFiles(place / "t.csv"), lens=LENS)
    return Filmed(head, frames, load_track(place / "t.csv"), tracked)


def test_found_again_after_two_seconds_without_a_face(filmed: Filmed) -> None:
    statuses = [frame.status for frame in filmed.track.frames]
    assert statuses == ["ok"] * 5 + ["lost"] * 21 + ["reacquired"] + ["ok"] * 2
    assert filmed.tracked.counts == {"ok": 7, "reacquired": 1, "lost": 21}
    assert "the face is lost in 21 of 29 frames, at 0.60 s first" in filmed.tracked.notes


def test_poses_at_a_variable_rate(filmed: Filmed) -> None:
    for frame, tenths in zip(filmed.track.frames, TIMES, strict=True):
        assert frame.time == pytest.approx(tenths / 10)
        assert (frame.state is not None) == (tenths in WITH_FACE)
        if frame.state is not None:
            true = camera_at(tenths)
            turned = np.degrees(angle_between(frame.state.R_cam_head, true.R_cam_head))
            assert turned < 0.2
            off = np.linalg.norm(frame.state.t_cam_head - true.t_cam_head)
            assert off < 0.002 * true.t_cam_head[2]
    assert filmed.track.fps == pytest.approx(28 / 3.0)


def test_a_clip_to_be_turned_gives_the_same_poses(filmed: Filmed, tmp_path: Path) -> None:
    stored = [np.rot90(picture, -1) for picture in filmed.frames[:4]]
    clip = flagged(written(tmp_path / "a.mp4", stored, TIMES), 1)
    track_video(clip, filmed.head, TrackFiles(tmp_path / "t.csv"), lens=LENS)
    found = load_track(tmp_path / "t.csv")
    assert (found.width, found.height) == (WIDTH, HEIGHT)
    for frame, upright in zip(found.frames, filmed.track.frames, strict=False):
        assert frame.state is not None
        assert upright.state is not None
        turned = np.degrees(angle_between(frame.state.R_cam_head, upright.state.R_cam_head))
        assert turned < 0.1
        np.testing.assert_allclose(frame.state.t_cam_head, upright.state.t_cam_head, atol=1)


def test_killed_and_resumed_gives_the_same_bytes(
    filmed: Filmed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Stopped(Tracker):
        def step(self, pixels: Array, frame: int, time: float) -> TrackedFrame:
            if frame == 3:
                raise KeyboardInterrupt
            return super().step(pixels, frame, time)

    clip = written(tmp_path / "a.mp4", filmed.frames[:5], TIMES)
    tables = [TrackFiles(tmp_path / name) for name in ("whole.csv", "t.csv")]
    track_video(clip, filmed.head, tables[0], lens=LENS)
    with monkeypatch.context() as patch:
        patch.setattr(mien.pipelines.tracking.prepared_head, "Tracker", Stopped)
        with pytest.raises(KeyboardInterrupt):
            track_video(clip, filmed.head, tables[1], lens=LENS)
    assert track_video(clip, filmed.head, tables[1], lens=LENS, resume=True).resumed == 3
    assert tables[1].table.read_bytes() == tables[0].table.read_bytes()


def test_a_journal_of_more_frames_than_the_clip_has(
    filmed: Filmed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Stopped(Tracker):
        def step(self, pixels: Array, frame: int, time: float) -> TrackedFrame:
            if frame == 4:
                raise KeyboardInterrupt
            return super().step(pixels, frame, time)

    clip = written(tmp_path / "a.mp4", filmed.frames[:5], TIMES)
    files = TrackFiles(tmp_path / "t.csv")
    with monkeypatch.context() as patch:
        patch.setattr(mien.pipelines.tracking.prepared_head, "Tracker", Stopped)
        with pytest.raises(KeyboardInterrupt):
            track_video(clip, filmed.head, files, lens=LENS)
    journal = journal_of(files.table)
    lines = journal.read_text().splitlines()
    last = json.loads(lines[-1])
    more = [json.dumps(last | {"frame": number}) for number in range(4, 9)]
    journal.write_text("\n".join([*lines, *more, ""]))
    with pytest.raises(FileFormatError) as caught:
        track_video(clip, filmed.head, files, lens=LENS, resume=True)
    problem = "line 10: expected at most the frames of a.mp4, found 9"
    assert str(caught.value) == f"{journal}: {problem}"
    assert not files.table.exists()


def test_digests_of_different_heads_differ(filmed: Filmed) -> None:
    assert head_digest(filmed.head) == head_digest(filmed.head) != head_digest(other_head())


@pytest.mark.parametrize(
    ("times", "rate"),
    [([], 25), ([3.0], 25), ([0.0, 0.0], 25), ([0, 0.04001, 0.08], 25), ([0, 0.1, 0.3], 20 / 3)],
)
def test_mean_fps(times: list[float], rate: float) -> None:
    unknown = np.empty(0)
    frames = [
        TrackedFrame(number, time, "lost", None, np.nan, 0.0, unknown, unknown, unknown)
        for number, time in enumerate(times)
    ]
    assert mean_fps(frames, 25) == pytest.approx(rate)


COMPANY = (640, 480)
WITH_OWNER = (*range(6), *range(12, 18))
"""Frames of 18 that show the head's owner, beside somebody larger who is always there."""


def beside(number: int) -> Camera:
    """That sees the head small, at the right."""
    turn = rotation_from_vector(np.array([0.02, np.radians(2 * number - 15), 0.03]))
    return Camera(*COMPANY, 2 * FOCAL, FRONTAL @ turn, np.array([330.0 + number, 20.0, 1100.0]))


@pytest.fixture(scope="module")
def company(filmed: Filmed, shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip of two people."""
    other = next(Video(shared / "data" / "videos" / "single_face.mp4").frames()).pixels()
    wall = np.full((COMPANY[1], COMPANY[0], 3), 90, np.uint8)
    wall[:360, :400] = other[:, 120:520]
    renderer = HeadRenderer(filmed.head)
    frames = [
        renderer.draw(FaceState(), beside(number), background=wall)[..., :3]
        if number in WITH_OWNER
        else wall
        for number in range(18)
    ]
    return written(tmp_path_factory.mktemp("company") / "two.mp4", frames)


@pytest.mark.parametrize("lens", [f"{2 * FOCAL}px", None])
def test_the_heads_owner_is_followed_beside_somebody_larger(
    filmed: Filmed, company: Path, tmp_path: Path, lens: str | None
) -> None:
    tracked = track_video(company, filmed.head, TrackFiles(tmp_path / "t.csv"), lens=lens)
    frames = load_track(tmp_path / "t.csv").frames
    assert [item.frame for item in frames if item.state is not None] == list(WITH_OWNER)
    assert [item.frame for item in frames if item.status == "reacquired"] == [12]
    for item in frames:
        if item.state is not None:
            true = beside(item.frame)
            turned = np.degrees(angle_between(item.state.R_cam_head, true.R_cam_head))
            # Of a head at the side a lens that is not known turns the view.
            assert turned < (1 if lens else 12)
            bearing = item.state.t_cam_head / item.state.t_cam_head[2] * tracked.focal_px
            wanted = true.t_cam_head / true.t_cam_head[2] * true.focal_px
            np.testing.assert_allclose(bearing[:2], wanted[:2], atol=3)
    (note,) = [note for note in tracked.notes if "lost" in note]
    assert note.startswith(
        "the face is lost in 6 of 18 frames, at 0.60 s first; faces were there, "
    )


def test_a_clip_of_somebody_else_alone(filmed: Filmed, shared: Path, tmp_path: Path) -> None:
    pixels = next(Video(shared / "data" / "videos" / "single_face.mp4").frames()).pixels()
    clip = written(tmp_path / "a.mp4", [pixels] * 3)
    with pytest.raises(EstimationError, match=r"a\.mp4: .* found in none of 3 frames: faces were"):
        track_video(clip, filmed.head, TrackFiles(tmp_path / "t.csv"), lens=LENS)
    assert [item.status for item in load_track(tmp_path / "t.csv").frames] == ["lost"] * 3


def test_one_note_on_a_face_that_the_edge_cuts(filmed: Filmed, tmp_path: Path) -> None:
    cut = [pixels[:, WIDTH // 2 - 40 :] for pixels in filmed.frames[:5]]
    wide = [np.pad(pixels, ((0, 0), (0, 40), (0, 0)), "edge") for pixels in cut]
    tracked = track_video(
        written(tmp_path / "a.mp4", wide), filmed.head, TrackFiles(tmp_path / "t.csv"), lens=LENS
    )
    (note,) = [note for note in tracked.notes if "edge" in note]
    assert note.startswith("the edge cuts the face in 5 of 5 frames, at 0.00 s first")
    assert not [note for note in filmed.tracked.notes if "edge" in note]
