"""Tracking against the truth, under [Pighin 2002]'s changes.

Run: python -m benchmarks.track_synthetic
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.table import markdown_table, write_results
from benchmarks.track_changes import Change, changes, covering, extra_expressions, face_masks
from benchmarks.track_errors import shape_errors, weight_errors
from benchmarks.track_runs import Followed, follow
from benchmarks.track_scenes import (
    PLAIN,
    Performance,
    choose_three,
    cluttered,
    made_up_head,
    perform,
    with_expressions,
)
from mien.arrays import Array, Float
from mien.assets.generic import load_generic_head
from mien.capture.faces.detector import LandmarkDetector
from mien.head import Head
from mien.io.head.head_folder import load_head
from mien.report.track.plots import save_track_plots
from mien.rig.rig import Rig
from mien.track.series import rotation_errors, series_of, translation_errors, truth_for

HEADER = (
    "",
    "rotation, degrees: greatest",
    "mean",
    "translation, % of distance: greatest",
    "mean",
    "weights, mean absolute error: all",
    "mouth",
    "eyes",
    "forehead",
    "shape, mm",
    "grey levels, rms",
    "ok",
    "reacquired",
    "lost",
    "ms a frame",
)


@dataclass(frozen=True)
class Outcome:
    """One alteration tracked.

    Attributes:
        rotation: (N,) degrees. translation: (N,) percent of the distance.
        weights: (N, R) mean absolute error. shape: (N,) mm over the face.
        All are NaN where the frame is lost.
    """

    followed: Followed
    rotation: Float[Array, " n"]
    translation: Float[Array, " n"]
    weights: Float[Array, "n r"]
    shape: Float[Array, " n"]

    @property
    def row(self) -> list[object]:
        """For the table."""
        whole = [f(e) for e in (self.rotation, self.translation) for f in (np.nanmax, np.nanmean)]
        regions = np.nanmean(self.weights, axis=0)
        rms = [frame.rms for frame in self.followed.track.frames]
        means = [np.nanmean(self.weights), *regions, np.nanmean(self.shape), np.nanmean(rms)]
        counts = [self.followed.count(status) for status in ("ok", "reacquired", "lost")]
        return [*map(float, whole), *map(float, means), *counts, self.followed.frame_ms]


class Measurement:
    """A head performing, with everything that all alterations share.

    Args:
        head: whose expressions are shown or beside the point.
        shown: three of them, neutral first.
    """

    def __init__(self, head: Head, shown: Sequence[str], *, seed: int = 6) -> None:
        self._head, self._shown, self._seed = head, tuple(shown), seed
        self._names = Rig(head).names
        own = with_expressions(head, self._shown)
        behind = cluttered(300, np.random.default_rng(seed))
        self.scenes = {True: perform(own, background=PLAIN), False: perform(own, background=behind)}

    def run(self, change: Change, detector: LandmarkDetector) -> Outcome:
        """Track the altered frames and compare."""
        scene = self.scenes[change.plain]
        more = extra_expressions(self._names, self._shown, change.extra)
        model = with_expressions(self._head, (*self._shown, *more))
        frames = change.apply(scene, np.random.default_rng(self._seed))
        focal = scene.truth.focal_px * frames[0].shape[1] / scene.truth.width
        followed = follow(model, frames, detector, focal_px=focal, fps=scene.truth.fps)
        found, true = followed.track, scene.truth
        series, truth = series_of(found), truth_for(found, true)
        face = load_generic_head().regions["face"]
        return Outcome(
            followed,
            rotation_errors(series, truth),
            translation_errors(series, truth),
            weight_errors(found, true),
            shape_errors(found, true, (Rig(model), Rig(scene.head)), face),
        )


def cover_shares(scene: Performance) -> str:
    """What the hands cover of the face, in words."""
    masks = face_masks(scene)
    parts = []
    for name, moving in (("the still hand", False), ("the moving one", True)):
        hands = covering(scene, moving=moving)
        shares = [100 * (h & m).sum() / m.sum() for h, m in zip(hands, masks, strict=True)]
        parts.append(f"{name} covers {min(shares):.0f} to {max(shares):.0f} % of it")
    return ", ".join(parts)


INTRO = (
    "{who} in three expressions ({shown}), blended uniformly over the whole face, {count} frames "
    "of 300x300 px. The head turns by 25 degrees to either side and moves along all axes. Three "
    "regions are tracked, the start is the face detector's, the focal length is known. Head "
    "tracked by the model that it was drawn with, as in [Pighin 2002] sec. 6.2. Weights: "
    "mean absolute "
    "error over all expressions of the model. Shape: mean distance of the face's vertices, which "
    "tells mixtures that look alike from others. Hands cover a quarter of the face in the mean; "
    "{cover}."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures, prints, writes results/track_synthetic.md and plots."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.track_synthetic", description=__doc__
    )
    parser.add_argument(
        "head", nargs="?", type=Path, help="a head folder; by default a made-up head"
    )
    parser.add_argument("--shown", nargs=2, metavar="NAME", help="expressions beside neutral")
    parser.add_argument("--only", help="alterations whose names contain this; nothing is written")
    parser.add_argument("--plots", type=Path, help="folder for plots of every alteration")
    asked = parser.parse_args(arguments)
    head = made_up_head() if asked.head is None else load_head(asked.head)
    shown = ("neutral", *asked.shown) if asked.shown else choose_three(head)
    measurement = Measurement(head, shown)
    rows = []
    with LandmarkDetector() as detector:
        for change in changes():
            if asked.only and asked.only not in change.name:
                continue
            outcome = measurement.run(change, detector)
            rows.append([change.name, *outcome.row])
            print(rows[-1], file=sys.stderr)
            if asked.plots:
                truth = measurement.scenes[change.plain].truth
                folder = asked.plots / change.name.replace(" ", "_")
                track = outcome.followed.track
                save_track_plots(folder, track, reference=truth, title=change.name)
    scene = measurement.scenes[True]
    intro = INTRO.format(
        who="A made-up head" if asked.head is None else f"The head {asked.head.name}",
        shown=", ".join(shown),
        count=len(scene.frames),
        cover=cover_shares(scene),
    )
    parts = [intro, markdown_table(HEADER, rows)]
    if asked.only:
        print("\n\n".join(parts))
    else:
        name = "made_up" if asked.head is None else asked.head.name
        write_results(f"track_synthetic_{name}", "Tracking against the truth", parts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
