"""What benchmarks.expression_quality found, as tables."""

from __future__ import annotations

import sys
from collections.abc import Mapping

import numpy as np

from benchmarks.table import markdown_table
from mien.arrays import Array, Float

__all__ = ["MIEN", "NEAREST", "NEUTRAL", "Found", "Report"]

Found = Mapping[str, Float[Array, "f 3"]]
"""By way: PSNR, SSIM and detail of each frame."""

NEUTRAL, NEAREST, MIEN = "neutral, warped", "nearest example, warped", "synthesised"

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


class Report:
    """The tables as they fill up."""

    def __init__(self) -> None:
        self._halves: list[list[object]] = []
        self._compared: list[list[object]] = []
        self._switched: list[list[object]] = []

    def compare(self, name: str, blocks: str, counts: tuple[int, int], found: Found) -> None:
        """Synthesised beside both others, from so many examples and frames."""
        self._halves.append([name, blocks, *counts, *ahead(found)])
        print(self._halves[-1], file=sys.stderr)

    def detail(self, name: str, found: Found, switched: Mapping[str, tuple[Array, Array]]) -> None:
        """Each way for itself; by switch, what it gives and what neutral gives beside it."""
        for way, values in found.items():
            self._compared.append([name, way, *cells_of(values, found[NEUTRAL])])
        for way, (values, base) in switched.items():
            self._switched.append([name, way, *cells_of(values, base)])

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
