"""Clips made for tests."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from mien.arrays import Array

QUARTER_TURNS = {-1: (0, 1, -1, 0), 2: (-1, 0, 0, -1), 1: (0, -1, 1, 0)}
"""What right (x) and down (y) of the stored picture become (tkhd's a, b, c, d), by quarter turns
counterclockwise that make it upright."""


def written(path: Path, frames: Iterable[Array], times: Sequence[int] | None = None) -> Path:
    """A clip of 10 frames a second, or with the given times in tenths of a second."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=10, options={"crf": "4", "g": "4"})
        stream.pix_fmt = "yuv420p"
        for index, pixels in enumerate(frames):
            if not index:
                stream.height, stream.width = pixels.shape[:2]
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")
            frame.pts = index if times is None else times[index]
            frame.time_base = Fraction(1, 10)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def grey(levels: Iterable[int]) -> list[Array]:
    return [np.full((48, 64, 3), level, np.uint8) for level in levels]


def flagged(path: Path, quarters: int) -> Path:
    """The .mp4, which says now that it is to be turned by so many quarters counterclockwise."""
    a, b, c, d = (65536 * entry for entry in QUARTER_TURNS[quarters])
    data = path.read_bytes()
    upright = struct.pack(">9i", 65536, 0, 0, 0, 65536, 0, 0, 0, 1 << 30)
    place = data.index(upright, data.index(b"tkhd"))
    turned = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data[:place] + turned + data[place + 36 :])
    return path


def broken(path: Path) -> Path:
    """The file without its second half."""
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return path
