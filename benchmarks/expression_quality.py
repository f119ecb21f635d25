"""How near synthesised expressions come to the frames they were kept from.

Run: python -m benchmarks.expression_quality [NAME[=CLIP] ...]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.expression_quality_clips import (
    FilmedFace,
    chosen_rows,
    example_set,
    face_mask,
    filmed,
    held_out,
    picture_quality,
    with_averaged_points,
)
from benchmarks.expression_quality_report import MIEN, NEAREST, NEUTRAL, Found, Report
from benchmarks.table import write_results
from benchmarks.track_clips import CLIPS
from mien.arrays import Array, Float, UInt8
from mien.assets.feature_points import load_feature_layout
from mien.capture.faces.detector import LandmarkDetector
from mien.io.files.image import save_image
from mien.synthesis.composition.composer import Composer
from mien.synthesis.examples.example_set import ExampleSet
from mien.synthesis.examples.selection import COUNT
from mien.synthesis.inference.coefficients import BROWS, UPPER_FACE, coefficients

Mixing = Callable[[ExampleSet, Array], Array]
"""From examples and points, px, to the coefficients of each subregion."""

SHEET_ROWS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Frames of a sheet: quantiles of the gain."""
SHIPPED = ("cap12", "cap13")
"""Clips whose pictures may be shown (data/README.md of the development data)."""
IMAGES = Path(__file__).parents[1] / "docs" / "images"
_GAP, _MARGIN, _SMALL = 4, 0.12, 200


def neutral_alone(examples: ExampleSet, points: Array) -> Array:
    """The neutral photo alone, as in expression mapping that only moves points."""
    return _one(examples, 0)


def nearest_alone(examples: ExampleSet, points: Array) -> Array:
    """The example whose points, head motion compensated, are nearest to these."""
    offsets = examples.geometries - examples.geometry(points)
    return _one(examples, int((offsets**2).sum(axis=(1, 2)).argmin()))


def _one(examples: ExampleSet, row: int) -> Array:
    result = np.zeros((len(examples.subregions.names), len(examples.examples)))
    result[:, row] = 1
    return result


def _with(**options: Any) -> Mixing:
    return lambda examples, points: coefficients(examples, points, **options)


EYES = tuple(name for name in UPPER_FACE if name not in BROWS)
COMPARED: Mapping[str, Mixing] = {
    NEUTRAL: neutral_alone,
    NEAREST: nearest_alone,
    MIEN: coefficients,
}
SWITCHES: Mapping[str, Mixing] = {
    "as mien does it by default": coefficients,
    "the paper's: no penalty, each subregion for itself": _with(distance_penalty=0.0, tied=()),
    "penalty 0.02": _with(distance_penalty=0.02),
    "penalty 0.2": _with(distance_penalty=0.2),
    "each subregion for itself": _with(tied=()),
    "brows together, and eyes with lids": _with(tied=(BROWS, EYES)),
    "upper face together": _with(tied=(UPPER_FACE,)),
    "teeth from all examples": lambda s, p: coefficients(replace(s, teeth=()), p),
    "shares down to -0.01": _with(slack=0.01),
    "shares down to -0.05": _with(slack=0.05),
}
SINGLE = "points from a single look at each frame"


class Size(NamedTuple):
    """How many examples, at most, and held-out frames."""

    examples: int
    frames: int


@dataclass(frozen=True)
class Trial:
    """Frames of a clip that are not near to any example's, to be drawn from their points."""

    face: FilmedFace
    rows: tuple[int, ...]
    examples: ExampleSet
    composer: Composer

    def drawn(self, row: int, mixing: Mixing) -> UInt8[Array, "h w 3"]:
        """A frame's expression, drawn with the frame's head pose."""
        points = self.face.points[row]
        motion = self.composer.head_motion(points)
        return self.composer.render(points, mixing(self.examples, points), motion=motion)

    def measured(self, mixing: Mixing) -> Float[Array, "f 3"]:
        """PSNR, SSIM and detail of each frame."""
        results = [
            picture_quality(
                self.drawn(row, mixing), self.face.frames[row], face_mask(self.face, row)
            )
            for row in self.rows
        ]
        return np.array([(quality.psnr, quality.ssim, quality.detail) for quality in results])

    def sheet(self, rows: Sequence[int]) -> UInt8[Array, "h w 3"]:
        """[Zhang 2006]'s Figs. 10 and 11: frame, neutral warped, nearest example warped, result."""
        lines = []
        for row in rows:
            window = _window(self.face, row)
            drawn = [self.drawn(row, mixing) for mixing in COMPARED.values()]
            lines.append(
                _joined([_cut(cell, window) for cell in (self.face.frames[row], *drawn)], axis=1)
            )
        return _joined(lines, axis=0)


def trial(face: FilmedFace, detector: LandmarkDetector | None, size: Size, *, odd: bool) -> Trial:
    """Examples from every other stretch of a clip, held-out frames from the stretches between.

    Args:
        face: the clip.
        detector: for averaged points in these frames; None: points of single detections.
        size: how many examples and frames.
        odd: examples from the odd stretches.
    """
    chosen = chosen_rows(face, size.examples, odd=odd)
    rows = tuple(held_out(face, size.frames, odd=odd))
    if detector is not None:
        face = with_averaged_points(face, [*chosen, *rows], detector)
    examples = example_set(face, chosen)
    return Trial(face, rows, examples, Composer(examples))


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
    """A part; twice as large where it is small."""
    import cv2

    part = image[window]
    if len(part) >= _SMALL:
        return part
    return np.asarray(cv2.resize(part, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC))


def _joined(cells: Sequence[UInt8[Array, "h w 3"]], axis: int) -> UInt8[Array, "h w 3"]:
    """Side by side or one above another, a white gap between them; cut to the same length."""
    shape = list(cells[0].shape)
    shape[axis] = _GAP
    gap = np.full(shape, 255, np.uint8)
    parts = [part for cell in cells for part in (cell, gap)][:-1]
    return np.concatenate(parts, axis=axis)


def write_sheet(path: Path, tried: Trial, found: Found) -> None:
    """Frames from those that gain little to those that gain much."""
    order = np.argsort(found[MIEN][:, 0] - found[NEUTRAL][:, 0])
    rows = [tried.rows[order[int(share * len(order))]] for share in SHEET_ROWS]
    path.parent.mkdir(parents=True, exist_ok=True)
    save_image(path, tried.sheet(rows), quality=85)


def switches(tried: Trial, single: Trial, base: Array) -> dict[str, tuple[Array, Array]]:
    """Results of each option, and of the warp of neutral beside it."""
    found = {name: (tried.measured(mixing), base) for name, mixing in SWITCHES.items()}
    found[SINGLE] = (single.measured(coefficients), single.measured(neutral_alone))
    return found


def run(asked: argparse.Namespace, paths: Mapping[str, Path]) -> Report:
    """Everything that is measured; draws the sheets on the way."""
    report, layout = Report(), load_feature_layout()
    with LandmarkDetector() as detector:
        for name, path in paths.items():
            face = filmed(path, layout, detector)
            size = Size(asked.examples, asked.frames)
            for blocks in ("odd", "even"):
                tried = trial(face, detector, size, odd=blocks == "odd")
                found = {label: tried.measured(mixing) for label, mixing in COMPARED.items()}
                counts = (len(tried.examples.examples), len(tried.rows))
                report.compare(name, blocks, counts, found)
                if blocks == "even":
                    continue
                single = trial(face, None, size, odd=True)
                report.detail(name, found, switches(tried, single, found[NEUTRAL]))
                if asked.sheets or name in SHIPPED:
                    folder = asked.sheets or IMAGES
                    write_sheet(folder / f"expressions-{name}.jpg", tried, found)
    return report


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures, prints, writes results/expression_quality.md and sheets of pictures."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.expression_quality", description=__doc__
    )
    parser.add_argument("clips", nargs="*", metavar="NAME[=CLIP]", help="by default the six")
    parser.add_argument("--examples", type=int, default=COUNT, help="at most")
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
    report = run(asked, paths)
    title = "How near synthesised expressions come"
    write_results("expression_quality", title, report.parts())
    return 0


if __name__ == "__main__":
    sys.exit(main())
