"""How near synthesised expressions come to the frames they were kept from.

Run: python -m benchmarks.expression_quality [NAME[=CLIP] ...]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.expression_quality_clips import (
    FilmedFace,
    Likeness,
    examples_of,
    face_mask,
    filmed,
    held_out,
    likeness,
)
from benchmarks.table import markdown_table, write_results
from benchmarks.track_clips import CLIPS
from mien.arrays import Array, Float, UInt8
from mien.assets.feature_points import load_feature_layout
from mien.capture.detector import LandmarkDetector
from mien.formats.image import save_image
from mien.synthesis.coefficients import UPPER_FACE, coefficients
from mien.synthesis.compose import Composer
from mien.synthesis.examples import ExampleSet

Shares = Callable[[ExampleSet, Array], Array]
"""A set and points, px: each subregion's shares of its examples."""

Found = Mapping[str, Float[Array, "f 3"]]
"""By way: PSNR, SSIM and detail of each frame."""

NEUTRAL, NEAREST, MIEN = "neutral, warped", "nearest example, warped", "synthesised"
SHEET_ROWS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Frames of a sheet: which share of all gain less."""
EXAMPLES = {"d6": 60}
"""Of clips with twice the frames and more expressions."""
SHIPPED = ("cap12", "cap13")
"""Clips whose pictures may be shown (data/README.md of the development data)."""
IMAGES = Path(__file__).parents[1] / "docs" / "images"
_GAP, _MARGIN = 4, 0.12


def neutral_alone(examples: ExampleSet, points: Array) -> Array:
    """What expression mapping that moves points alone has."""
    return _one(examples, 0)


def nearest_alone(examples: ExampleSet, points: Array) -> Array:
    """The example whose points, head motion taken out, are nearest to these."""
    apart = examples.geometries - examples.geometry(points)
    return _one(examples, int((apart**2).sum(axis=(1, 2)).argmin()))


def _one(examples: ExampleSet, row: int) -> Array:
    shares = np.zeros((len(examples.subregions.names), len(examples.examples)))
    shares[:, row] = 1
    return shares


COMPARED: Mapping[str, Shares] = {
    NEUTRAL: neutral_alone,
    NEAREST: nearest_alone,
    MIEN: coefficients,
}
SWITCHES: Mapping[str, Shares] = {
    "as mien does it by default": coefficients,
    "the paper's: no penalty, each subregion for itself": lambda s, p: coefficients(
        s, p, distance_penalty=0.0, together=()
    ),
    "penalty 0.1": lambda s, p: coefficients(s, p, distance_penalty=0.1),
    "penalty 0.3": lambda s, p: coefficients(s, p, distance_penalty=0.3),
    "upper face together": lambda s, p: coefficients(s, p, together=[UPPER_FACE]),
    "shares down to -0.01": lambda s, p: coefficients(s, p, slack=0.01),
    "shares down to -0.05": lambda s, p: coefficients(s, p, slack=0.05),
}


@dataclass(frozen=True)
class Trial:
    """Frames of a clip that no example is from or near to, to be drawn from their points."""

    face: FilmedFace
    rows: tuple[int, ...]
    examples: ExampleSet
    composer: Composer

    def drawn(self, row: int, shares: Shares) -> UInt8[Array, "h w 3"]:
        """A frame's expression, in the frame's place."""
        points = self.face.points[row]
        motion = self.composer.head_motion(points)
        return self.composer.render(points, shares(self.examples, points), motion=motion)

    def measured(self, shares: Shares) -> Float[Array, "f 3"]:
        """PSNR, SSIM and detail of each frame."""
        found = [self._likeness(row, shares) for row in self.rows]
        return np.array([(like.psnr, like.ssim, like.detail) for like in found])

    def _likeness(self, row: int, shares: Shares) -> Likeness:
        return likeness(self.drawn(row, shares), self.face.frames[row], face_mask(self.face, row))

    def sheet(self, rows: Sequence[int]) -> UInt8[Array, "h w 3"]:
        """Z06's Figs. 10 and 11: the frame, neutral warped, nearest example warped, synthesised."""
        lines = []
        for row in rows:
            window = _window(self.face, row)
            cells = [self.face.frames[row], *(self.drawn(row, way) for way in COMPARED.values())]
            lines.append(_joined([_cut(cell, window) for cell in cells], axis=1))
        return _joined(lines, axis=0)


def trial(face: FilmedFace, *, examples: int, frames: int, odd: bool = True) -> Trial:
    """Examples from every other stretch of a clip, held-out frames from the stretches between."""
    chosen = examples_of(face, examples, odd=odd)
    rows = tuple(held_out(face, frames, odd=odd))
    return Trial(face, rows, chosen, Composer(chosen))


def _window(face: FilmedFace, row: int) -> tuple[slice, slice]:
    """A square around the face, as large in every frame."""
    boxes = np.ptp(face.landmarks, axis=1)
    side = int((1 + 2 * _MARGIN) * np.median(boxes.max(axis=1)))
    height, width = face.frames[row].shape[:2]
    side = min(side, height, width)
    middle = face.landmarks[row].min(axis=0) + boxes[row] / 2
    left, top = np.clip(middle - side / 2, 0, [width - side, height - side]).astype(int)
    return slice(top, top + side), slice(left, left + side)


def _cut(image: UInt8[Array, "h w 3"], window: tuple[slice, slice]) -> UInt8[Array, "h w 3"]:
    return image[window]


def _joined(cells: Sequence[UInt8[Array, "h w 3"]], axis: int) -> UInt8[Array, "h w 3"]:
    """Side by side or one above another, a white gap between them; cut to the same length."""
    shape = list(cells[0].shape)
    shape[axis] = _GAP
    gap = np.full(shape, 255, np.uint8)
    parts = [part for cell in cells for part in (cell, gap)][:-1]
    return np.concatenate(parts, axis=axis)


ABOUT = (
    "Examples from every other stretch of 15 frames of a clip, held-out frames from the stretches "
    "between; the frame's points in, a picture out, compared with the frame within the hull of its "
    "landmarks. Detail: deviation of what is finer than about 2 px, in shares of the frame's own. "
    "Medians over the frames, quartiles beside them; a gain is the median of the frames' gains."
)
BOTH = "Over each of the others, on the median frame; both halves of each clip in turn."
SWITCHED = "The same examples and frames, other options of `synthesis.coefficients`."
EACH = ("PSNR, dB", "quartiles", "SSIM", "detail", "over neutral, dB", "quartiles", "frames ahead")
AHEAD = ("dB", "SSIM", "frames ahead")


def cells_of(values: Float[Array, "f 3"], base: Float[Array, "f 3"]) -> list[object]:
    """For the tables: EACH of one way."""
    psnr, ssim, detail = np.median(values, axis=0)
    gain = values[:, 0] - base[:, 0]
    return [
        f"{psnr:.2f}",
        _quartiles(values[:, 0]),
        f"{ssim:.3f}",
        f"{detail:.2f}",
        f"{np.median(gain):.2f}",
        _quartiles(gain),
        f"{np.mean(gain > 0):.0%}",
    ]


def _quartiles(values: Array) -> str:
    return " to ".join(f"{value:.1f}" for value in np.percentile(values, [25, 75]))


def ahead(found: Found) -> list[object]:
    """Synthesised against both others: AHEAD twice."""
    cells: list[object] = []
    for other in (NEUTRAL, NEAREST):
        gain = found[MIEN] - found[other]
        psnr, ssim, _ = np.median(gain, axis=0)
        cells += [f"{psnr:.2f}", f"{ssim:.3f}", f"{np.mean(gain[:, 0] > 0):.0%}"]
    return cells


def write_sheet(path: Path, tried: Trial, found: Found) -> None:
    """Frames from those that gain little to those that gain much."""
    order = np.argsort(found[MIEN][:, 0] - found[NEUTRAL][:, 0])
    rows = [tried.rows[order[int(share * len(order))]] for share in SHEET_ROWS]
    path.parent.mkdir(parents=True, exist_ok=True)
    save_image(path, tried.sheet(rows), quality=85)


class Report:
    """The tables as they fill up."""

    def __init__(self) -> None:
        self._halves: list[list[object]] = []
        self._compared: list[list[object]] = []
        self._switched: list[list[object]] = []

    def compare(self, name: str, blocks: str, tried: Trial) -> Found:
        """Synthesised beside both others."""
        found = {way: tried.measured(shares) for way, shares in COMPARED.items()}
        counts = (len(tried.examples.examples), len(tried.rows))
        self._halves.append([name, blocks, *counts, *ahead(found)])
        print(self._halves[-1], file=sys.stderr)
        return found

    def detail(self, name: str, tried: Trial, found: Found) -> None:
        """Each way for itself, and what switches do."""
        for way, values in found.items():
            self._compared.append([name, way, *cells_of(values, found[NEUTRAL])])
        for way, shares in SWITCHES.items():
            cells = cells_of(tried.measured(shares), found[NEUTRAL])
            self._switched.append([name, way, *cells])

    def parts(self) -> list[str]:
        """For the results."""
        of = [f"over {other}: {what}" for other in (NEUTRAL, NEAREST) for what in AHEAD]
        each = ["clip", "", *EACH]
        return [
            ABOUT,
            BOTH,
            markdown_table(
                ["clip", "examples from blocks", "examples", "frames", *of], self._halves
            ),
            "## Odd blocks",
            markdown_table(each, self._compared),
            "## Switches",
            SWITCHED,
            markdown_table(each, self._switched),
        ]


def run(clips: Mapping[str, FilmedFace], asked: argparse.Namespace) -> Report:
    """Everything that is measured; draws the sheets on the way."""
    report = Report()
    for name, face in clips.items():
        count = asked.examples or EXAMPLES.get(name, 40)
        for blocks in ("odd", "even"):
            tried = trial(face, examples=count, frames=asked.frames, odd=blocks == "odd")
            found = report.compare(name, blocks, tried)
            if blocks == "even":
                continue
            report.detail(name, tried, found)
            if asked.sheets or name in SHIPPED:
                write_sheet((asked.sheets or IMAGES) / f"expressions-{name}.jpg", tried, found)
    return report


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures, prints, writes results/expression_quality.md and sheets of pictures."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.expression_quality", description=__doc__
    )
    parser.add_argument("clips", nargs="*", metavar="NAME[=CLIP]", help="by default the six")
    parser.add_argument("--examples", type=int, help="at most; by default 40, of d6 60")
    parser.add_argument("--frames", type=int, default=45, help="held out of each clip")
    parser.add_argument(
        "--sheets", type=Path, help="folder for sheets of all clips; by default docs/images, "
        "for those that may be shown"
    )  # fmt: skip
    asked = parser.parse_args(arguments)
    named = [item.partition("=")[::2] for item in asked.clips]
    paths = {name: Path(path) if path else CLIPS[name] for name, path in named} or CLIPS
    for path in paths.values():
        if not path.is_file():
            print(f"error: {path}: expected the clip, found nothing", file=sys.stderr)
            return 2
    layout = load_feature_layout()
    with LandmarkDetector() as detector:
        clips = {name: filmed(path, layout, detector) for name, path in paths.items()}
    report = run(clips, asked)
    title = "How near synthesised expressions come"
    write_results("expression_quality", title, report.parts())
    return 0


if __name__ == "__main__":
    sys.exit(main())
