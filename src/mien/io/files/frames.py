"""Frames as a folder of numbered PNG pictures, with alpha."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from mien.arrays import Array, UInt8
from mien.errors import InputError
from mien.io.files.atomic import atomic_folder, check_folder_place
from mien.io.files.image import encode_image, is_png_by_mien

_OF_THE_SYSTEM = {".DS_Store", "Thumbs.db", "desktop.ini"}
"""Left by file managers in every folder that they show; may be removed."""


def save_frames(
    path: str | Path,
    frames: Iterable[UInt8[Array, "h w c"]],
    *,
    name: str = "frame",
    read: Iterable[str | Path] = (),
) -> int:
    """Write frames as NAME_000000.png, NAME_000001.png, ...: all of them or none.

    Args:
        path: a folder: new, empty, or one that this function wrote, whose pictures are replaced.
        frames: (h, w, 4) sRGB with alpha last, not premultiplied, or (h, w, 3); all of one size,
            taken one at a time.
        name: what the pictures' names begin with.
        read: what the frames are made from, which must not lie in the folder.

    Returns:
        how many frames were written.

    Raises:
        InputError: a folder with other things in it, no frame, a frame of another size, a name that
            is none, a place that cannot be written.
    """
    if not re.fullmatch(r"[\w-]+", name):
        raise InputError("name", "letters, digits, - and _", repr(name))
    count, shape = 0, None
    with atomic_folder(path, replaces=_holds_frames, read=read) as folder:
        for frame in frames:
            shape = shape or frame.shape
            if frame.shape != shape:
                found = f"shape {frame.shape}"
                raise InputError(f"frame {count}", f"shape {shape} as the first", found)
            (folder / f"{name}_{count:06}.png").write_bytes(encode_image(frame, "PNG"))
            count += 1
        if not count:
            raise InputError(path, "at least one frame to write", "none")
    return count


def check_frames_place(path: str | Path, *, read: Iterable[str | Path] = ()) -> None:
    """Refuse, before any frame is made, a folder that save_frames could not take.

    Raises:
        InputError: a file is in the way, a folder that holds other things or what is read.
    """
    check_folder_place(path, replaces=_holds_frames, read=read)


def _holds_frames(folder: Path) -> bool:
    """Whether everything in a folder is a frame of one sequence, and mien drew it."""
    items = [item for item in folder.iterdir() if item.name not in _OF_THE_SYSTEM]
    names = [re.fullmatch(r"([\w-]+)_\d{6}\.png", item.name) for item in items]
    one_sequence = all(names) and len({match[1] for match in names if match}) <= 1
    return one_sequence and all(map(is_png_by_mien, items))
