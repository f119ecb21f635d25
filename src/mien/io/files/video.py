"""Video files from rendered frames: H.264 in .mp4, VP9 in .webm."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from mien.arrays import Array, UInt8, check_image, check_positive
from mien.errors import InputError
from mien.io.files.atomic import atomic_file, check_file_place

# By container: the encoders that will do, the best first (a build of FFmpeg may lack libx264 for
# its licence), and the container's own options. With its index moved to the front an .mp4
# starts to play before all of it has arrived.
_ENCODERS = {".mp4": ("libx264", "libopenh264"), ".webm": ("libvpx-vp9",)}
_CONTAINER_OPTIONS = {".mp4": {"movflags": "+faststart"}, ".webm": {}}

# libvpx needs bit rate 0 for constant quality, and is slow by default. With alpha it must not use
# alternate reference frames, which the two streams would not share.
_TUNING = {"libvpx-vp9": {"b": "0", "cpu-used": "4", "row-mt": "1"}}
_ALPHA_TUNING = {"auto-alt-ref": "0"}

# By channels of a frame; a player without alpha shows the same picture without it.
_PIXELS = {3: "yuv420p", 4: "yuva420p"}

# FFmpeg's numbers: BT.709 for matrix, primaries and transfer; 16 to 235 for luma. Players take a
# file without them for one or the other by its size, and shift its colours.
_BT709, _LIMITED_RANGE = 1, 1


def save_video(
    path: str | Path,
    frames: Iterable[UInt8[Array, "h w c"]],
    fps: float,
    *,
    quality: int = 18,
) -> int:
    """Write frames as a video that browsers and players open, whole or not at all.

    Args:
        path: .mp4 (H.264) or .webm (VP9).
        frames: (h, w, 3) sRGB, or for .webm (h, w, 4) with alpha last, not premultiplied; all of
            one size, taken one at a time. An odd side is made even by repeating its last row or
            column: colour at half resolution needs pairs.
        fps: frames a second.
        quality: the encoder's constant rate factor; lower is better and larger, 18 looks exact.

    Returns:
        how many frames were written.

    Raises:
        InputError: another suffix, no frame, a frame of another size, alpha into an .mp4, no
            encoder in this build of FFmpeg, a place that cannot be written.
    """
    import av

    suffix = _check_suffix(path)
    rate = Fraction(check_positive("fps", fps)).limit_denominator(1001)
    encoder = _find_encoder(path, _ENCODERS[suffix])
    remaining = iter(frames)
    first = next(remaining, None)
    if first is None:
        raise InputError(path, "at least one frame to write", "none")
    shape = _check_frame(first, 0, None)
    height, width, channels = shape
    if channels == 4 and suffix != ".webm":
        raise InputError(path, "a .webm for pictures with alpha", suffix)
    options = _CONTAINER_OPTIONS[suffix]
    with (
        atomic_file(path) as temporary,
        av.open(temporary, "w", format=suffix[1:], container_options=options) as container,
    ):
        tuning = {"crf": str(quality)} | _TUNING.get(encoder, {})
        tuning |= _ALPHA_TUNING if channels == 4 else {}
        stream: Any = container.add_stream(encoder, rate, tuning)
        stream.width, stream.height = width + width % 2, height + height % 2
        stream.codec_context.pix_fmt = _PIXELS[channels]
        _declare_color(stream)
        count = 0
        for frame in chain([first], remaining):
            _check_frame(frame, count, shape)
            container.mux(stream.encode(_to_yuv(frame)))
            count += 1
        container.mux(stream.encode(None))
    return count


def check_video_place(path: str | Path) -> None:
    """Refuse, before any frame is made, a place that save_video would not take.

    Raises:
        InputError: another suffix, a place that cannot be written.
    """
    _check_suffix(path)
    check_file_place(path)


def _check_suffix(path: str | Path) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in _ENCODERS:
        raise InputError(path, f"a name that ends in {' or '.join(_ENCODERS)}", suffix or "none")
    return suffix


def _find_encoder(path: str | Path, names: tuple[str, ...]) -> str:
    import av

    for name in names:
        if name in av.codecs_available:
            return name
    raise InputError(path, f"PyAV with the encoder {' or '.join(names)}", "a build without")


def _declare_color(stream: Any) -> None:
    context = stream.codec_context
    context.colorspace = context.color_primaries = context.color_trc = _BT709
    context.color_range = _LIMITED_RANGE


def _check_frame(
    frame: object, index: int, expected: tuple[int, int, int] | None
) -> tuple[int, int, int]:
    """The shape of a frame, which is as expected."""
    name = f"frame {index}"
    pixels = np.asarray(frame)
    channels = 4 if pixels.ndim == 3 and pixels.shape[2] == 4 else 3
    height, width = check_image(name, pixels[..., :3] if channels == 4 else pixels).shape[:2]
    found = (height, width, channels)
    if expected not in (None, found):
        raise InputError(name, f"{_size_text(expected)} as the first", _size_text(found))
    return found


def _size_text(shape: tuple[int, int, int] | None) -> str:
    assert shape is not None
    height, width, channels = shape
    return f"{width}x{height} px{' with alpha' if channels == 4 else ''}"


def _to_yuv(frame: UInt8[Array, "h w c"]) -> Any:
    import av

    height, width, channels = frame.shape
    even = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    picture = av.VideoFrame.from_ndarray(even, format={3: "rgb24", 4: "rgba"}[channels])
    return picture.reformat(format=_PIXELS[channels], dst_colorspace=_BT709)
