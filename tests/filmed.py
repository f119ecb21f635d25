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
    return shown_by(path, *QUARTER_TURNS[quarters])


def shown_by(path: Path, *matrix: int) -> Path:
    """The .mp4, which says now that it is to be shown by this display matrix."""
    a, b, c, d = (65536 * entry for entry in matrix)
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


def coded_hdr(codes: Array, transfer: int) -> Array:
    """sRGB values, 0 to 255 and beyond, as R'G'B' in [0, 1] of BT.2020 in PQ (16) or HLG (18).

    By BT.2100: ordinary white lies at 203 cd/m2, on a display of 1,000 for HLG.
    """
    shown = np.asarray(codes) / 255
    linear = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    # BT.2087.
    from_709 = np.array(
        [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    )
    light = 203 * linear @ from_709.T
    if transfer == 16:
        power = (light / 10_000) ** 0.1593017578125
        return ((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375
    luminance = np.maximum(light @ [0.2627, 0.6780, 0.0593], 1e-9)[..., None] / 1000
    scene = light / 1000 * luminance ** (1 / 1.2 - 1)
    above = 0.17883277 * np.log(np.maximum(12 * scene - 0.28466892, 1e-9)) + 0.55991073
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), above)


def hdr_written(
    path: Path, frames: Iterable[Array], transfer: int, *, matrix_stated: bool = True
) -> Path:
    """A 10-bit clip of such sRGB pictures in BT.2020, PQ (16) or HLG (18), limited range."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=10, options={"crf": "2"})
        stream.pix_fmt = "yuv420p10le"
        context = stream.codec_context
        context.color_trc, context.color_primaries, context.color_range = transfer, 9, 1
        context.colorspace = 9 if matrix_stated else 2
        for index, codes in enumerate(frames):
            if not index:
                stream.height, stream.width = codes.shape[:2]
            frame = av.VideoFrame(codes.shape[1], codes.shape[0], "yuv420p10le")
            for plane, values in zip(frame.planes, _yuv(coded_hdr(codes, transfer)), strict=True):
                rows = np.zeros((values.shape[0], plane.line_size // 2), np.uint16)
                rows[:, : values.shape[1]] = values
                plane.update(rows.tobytes())
            frame.pts, frame.time_base = index, Fraction(1, 10)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def _yuv(rgb: Array) -> list[Array]:
    """Y', Cb and Cr of BT.2020, 10 bits of limited range, chroma halved."""
    luma = rgb @ [0.2627, 0.6780, 0.0593]
    blue, red = (rgb[..., 2] - luma) / 1.8814, (rgb[..., 0] - luma) / 1.4746
    height, width = luma.shape
    halved = [c.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3)) for c in (blue, red)]
    return [np.rint(64 + 876 * luma), *(np.rint(512 + 896 * chroma) for chroma in halved)]
