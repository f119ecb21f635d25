"""The kind of a user's source: by its bytes first, then by its name."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from mien.capture.images.opening import is_image
from mien.capture.images.photos import PHOTO_SUFFIXES
from mien.capture.images.unsupported import unsupported_kind
from mien.capture.video.video import is_video
from mien.errors import FileFormatError, InputError
from mien.reading.files import check_readable, describe_content
from mien.reading.names import check_path

_EXPECTED = "a photo, a video or a folder of photos"
_VIDEO_SUFFIXES = (
    ".3g2 .3gp .apng .asf .avi .divx .dv .f4v .flv .m1v .m2ts .m2v .m4v .mkv .mod .mov .mp4 .mpe "
    ".mpeg .mpg .mts .mxf .ogm .ogv .qt .rm .tod .ts .vob .webm .wmv"
)
VIDEO_SUFFIXES = frozenset(_VIDEO_SUFFIXES.split())
"""Endings (lower case) of files that count as videos where their bytes are not recognized."""

_INDEXES = {
    "head.json": (rb'"format"\s*:\s*"mien head"', "a head folder"),
    "examples.json": (rb'"format"\s*:\s*"mien examples"', "an example folder"),
}
_BEGINNING = 4096
"""Bytes within which both kinds of index state their format."""

SourceKind = Literal["folder", "photo", "video"]


def kind_of_source(source: str | Path) -> SourceKind:
    """Whether a source is a folder, a photo or a video.

    An animated picture (GIF, PNG) is a video. A file whose bytes are not recognized is what its
    name says: its reader will find what is wrong with it.

    Raises:
        InputError: nothing given, nothing there, a folder that mien made, a pipe, a device.
        FileFormatError: an empty file, one that is neither a photo nor a video.
    """
    path = check_path("source", source, _EXPECTED)
    if path.is_dir():
        if made := made_by_mien(path):
            raise InputError(source, "photos or a video", f"{made} that mien made of them")
        return "folder"
    if not path.exists():
        raise InputError(source, _EXPECTED, "nothing there")
    check_readable(path, "a photo or a video")
    if is_image(path):
        return "photo"
    unread, suffix = unsupported_kind(path), path.suffix.lower()
    if not unread and (is_video(path) or suffix in VIDEO_SUFFIXES):
        return "video"
    if suffix in PHOTO_SUFFIXES:
        return "photo"
    raise FileFormatError(
        path, f"expected a photo or a video, found {unread or describe_content(path)}"
    )


def made_by_mien(folder: Path) -> str:
    """What kind of folder mien wrote here: "a head folder", "an example folder"; "" for others."""
    for name, (pattern, kind) in _INDEXES.items():
        index = folder / name
        try:
            # Opening a pipe would wait.
            if index.is_file():
                with index.open("rb") as file:
                    if re.search(pattern, file.read(_BEGINNING)):
                        return kind
        except OSError:
            continue
    return ""
