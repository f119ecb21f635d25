"""Heads from feature points beside the frames of a clip, and all points from a few of them.

Run: python -m benchmarks.head_synthesis HEADS [NAME[=CLIP] ...]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.propagation_clips import KNOWN, known_points, most_different
from benchmarks.table import markdown_table, write_results
from benchmarks.track_clips import CLIPS
from benchmarks.track_runs import follow
from mien.arrays import Array, Float, UInt8
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.video.video import Video
from mien.head import Head
from mien.io.head.head_folder import load_head
from mien.render.picture import HeadRenderer
from mien.report.track.comparison import face_mask, face_psnr
from mien.rig.state import PosedFace
from mien.synthesis.heads.feature_points import feature_points_on
from mien.synthesis.heads.synthesizer import HeadSynthesizer
from mien.synthesis.synthesizer import SynthesisOptions
from mien.track.lens import expected_focal
from mien.track.state import Track, TrackedFrame

MIN_GAP = 5
"""Frames nearer to one that the head was made from are not measured."""
MEASURED = 60
EXPRESSIONS = 25
"""The most different ones, completed from a few points."""

NEUTRAL, NEAREST = "neutral's texture", "the nearest expression's"
SYNTHESISED = "synthesised"
BY_PAPER = "synthesised as [Zhang 2006] prints it"
BY_REGIONS = "[Pighin 2002]'s regions, by the tracker"
Variant = Callable[[PosedFace, Array], PosedFace]


@dataclass(frozen=True)
class Tracked:
    """A head in the frames of a clip that it was not made from.

    Attributes:
        frames: (h, w, 3) each.
        found: likewise, none of them lost.
        track: what they are of.
        faces: as the tracker left them.
        points: (N, n, 3) mm, head space.
    """

    head: Head
    synthesizer: HeadSynthesizer
    track: Track
    frames: tuple[UInt8[Array, "h w 3"], ...]
    found: tuple[TrackedFrame, ...]
    faces: tuple[PosedFace, ...]
    points: Float[Array, "N n 3"]


def tracked(head: Head, clip: Path, detector: LandmarkDetector) -> Tracked:
    """All frames of the clip tracked; those far enough from the head's own are kept."""
    frames = [frame.pixels() for frame in Video(clip).frames()]
    height, width = frames[0].shape[:2]
    focal_px = expected_focal(head, width, height).focal_px
    track = follow(head, frames, detector, focal_px=focal_px, fps=25.0).track
    own = [int(Path(view.photo).stem.rpartition("_")[2]) for view in head.views]
    free = [
        found
        for found in track.frames
        if found.state is not None and min(abs(found.frame - index) for index in own) >= MIN_GAP
    ]
    synthesizer = HeadSynthesizer(head)
    states = [found.state.face(track.layout) for found in free if found.state is not None]
    faces = tuple(synthesizer.rig.evaluate(state) for state in states)
    points = np.stack([feature_points_on(face.vertices) for face in faces])
    kept = tuple(frames[found.frame] for found in free)
    return Tracked(head, synthesizer, track, kept, tuple(free), faces, points)


def variants(clip: Tracked) -> Mapping[str, Variant]:
    """Faces that are compared: the tracked shapes with other textures, and synthesised ones."""
    rig = clip.synthesizer.rig
    paper = HeadSynthesizer(clip.head, SynthesisOptions.paper(), warp=False, rig=rig)

    def one(row: int, face: PosedFace) -> PosedFace:
        weights = np.zeros_like(face.weights)
        weights[:, row] = 1
        return PosedFace(face.vertices, weights, face.brightness)

    def nearest(face: PosedFace, points: Array) -> PosedFace:
        squares = ((clip.synthesizer.examples - points) ** 2).sum(axis=(1, 2))
        return one(int(squares.argmin()), face)

    return {
        NEUTRAL: lambda face, points: one(0, face),
        NEAREST: nearest,
        SYNTHESISED: lambda face, points: clip.synthesizer.synthesize(points).face,
        BY_PAPER: lambda face, points: paper.synthesize(points).face,
        BY_REGIONS: lambda face, points: face,
    }


def psnrs(clip: Tracked) -> dict[str, Float[Array, " f"]]:
    """PSNR over the face of evenly chosen frames, dB."""
    renderer = HeadRenderer(clip.head, rig=clip.synthesizer.rig)
    rows = np.linspace(0, len(clip.frames) - 1, MEASURED).astype(int)
    quality: dict[str, list[float]] = {}
    for row in rows:
        found, face = clip.found[row], clip.faces[row]
        assert found.state is not None
        camera = clip.track.camera(found.state)
        inside = face_mask(clip.head.mesh.with_vertices(face.vertices), camera)
        for name, make in variants(clip).items():
            drawn = renderer.draw_posed(make(face, clip.points[row]), camera)
            matched = np.clip(drawn[..., :3] * found.gain + found.bias, 0, 255).astype(np.uint8)
            mask = inside & (drawn[..., 3] == 255)
            quality.setdefault(name, []).append(face_psnr(clip.frames[row], matched, mask))
    return {name: np.array(values) for name, values in quality.items()}


def psnr_row(name: str, clip: Tracked) -> list[object]:
    """Medians, gains over neutral's texture, and distances from the hull."""
    psnr = psnrs(clip)
    gains = [float(np.median(psnr[label] - psnr[NEUTRAL])) for label in (NEAREST, SYNTHESISED)]
    made = [
        clip.synthesizer.synthesize(points) for points in clip.points[:: len(clip.points) // 20]
    ]
    hull = np.array([item.hull_mm for item in made])
    medians = [float(np.median(values)) for values in psnr.values()]
    return [name, len(clip.frames), *medians, *gains, float(np.median(hull)), float(hull.max())]


def completion_rows(name: str, clip: Tracked) -> list[list[object]]:
    """Mean errors in mm at points that were not given, over the most different expressions."""
    synthesizer, layout = clip.synthesizer, clip.synthesizer.layout
    rest = synthesizer.examples[0]
    chosen = clip.points[most_different(clip.points - rest, EXPRESSIONS)]
    printed = HeadSynthesizer(
        clip.head, SynthesisOptions(propagation="printed"), rig=synthesizer.rig
    )
    rows: list[list[object]] = []
    for count in KNOWN:
        known = known_points(layout, count)
        unknown = np.setdiff1d(np.arange(len(rest)), known)
        row: list[object] = [f"{name}, {count} points"]
        row.append(float(np.linalg.norm(chosen - rest, axis=2)[:, unknown].mean()))
        for variant in (synthesizer, printed):
            made = np.stack([variant.complete(known, points[known]) for points in chosen])
            row.append(float(np.linalg.norm(made - chosen, axis=2)[:, unknown].mean()))
        rows.append(row)
    return rows


def milliseconds(clip: Tracked) -> float:
    """Of one face from its points, without the picture; the median."""
    taken = []
    for points in clip.points[:40]:
        begun = time.perf_counter()
        clip.synthesizer.synthesize(points)
        taken.append(1000 * (time.perf_counter() - begun))
    return float(np.median(taken))


def main(arguments: Sequence[str]) -> int:
    """Measures, prints and writes the tables; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("heads", type=Path, help="HEADS/NAME: heads built of frames of the clips")
    parser.add_argument("clips", nargs="*", default=["d10", "d6"], metavar="NAME[=CLIP]")
    given = parser.parse_args(arguments)
    quality: list[list[object]] = []
    completion: list[list[object]] = []
    times = []
    with LandmarkDetector() as detector:
        for entry in given.clips:
            name, _, path = entry.partition("=")
            clip = tracked(load_head(given.heads / name), Path(path or CLIPS[name]), detector)
            quality.append(psnr_row(name, clip))
            completion += completion_rows(name, clip)
            times.append(milliseconds(clip))
    names = (NEUTRAL, NEAREST, SYNTHESISED, BY_PAPER, BY_REGIONS)
    gains = ("gain of the nearest", "gain of synthesis")
    header = ("", "frames", *names, *gains, "left of the hull, mm: median", "greatest")
    parts = [
        "PSNR over the face against frames that the head was not made from, dB, medians over "
        f"{MEASURED} of them. Shapes are the tracker's, in the columns of synthesis made again "
        "from their feature points.",
        markdown_table(header, quality),
        f"All points from some, in space: mean error in mm at those not given, over {EXPRESSIONS} "
        "expressions.",
        markdown_table(("", "unmoved", "closed form", "printed"), completion),
        f"One face from its points: {min(times):.1f} to {max(times):.1f} ms, without the picture.",
    ]
    write_results("head_synthesis", "Heads from feature points", parts)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
