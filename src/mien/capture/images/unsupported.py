"""Kinds of pictures that are not read, by the endings of their names, and what to do instead."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

_RAW = (
    ".3fr .arw .cr2 .cr3 .crw .dcr .dng .erf .fff .gpr .iiq .kdc .mef .mos .mrw .nef .nrw .orf "
    ".pef .raf .raw .rw2 .rwl .sr2 .srf .srw .x3f"
)
_KINDS = (
    (_RAW, "camera RAW: export as JPEG or TIFF"),
    (".jxl", "JPEG XL: convert to JPEG or PNG"),
    (".psd .psb .xcf .kra .afphoto", "a picture editor's: export as PNG or TIFF"),
    (".eps .ps .pdf .svg .wmf .emf", "drawings: export as PNG"),
    (".exr .hdr .tga .dds .jxr .ico", "a kind that is not read: convert to PNG or TIFF"),
)
_BY_SUFFIX = {suffix: advice for suffixes, advice in _KINDS for suffix in suffixes.split()}


def unsupported_kind(path: Path) -> str:
    """`a .cr3 file (camera RAW: export as JPEG or TIFF)`; "" for other names."""
    suffix = path.suffix.lower()
    return f"a {suffix} file ({_BY_SUFFIX[suffix]})" if suffix in _BY_SUFFIX else ""


def is_unsupported(path: Path) -> bool:
    """Whether the name is that of a picture of a kind that is not read."""
    return path.suffix.lower() in _BY_SUFFIX


def count_by_kind(paths: Iterable[Path]) -> list[str]:
    """`12 .cr3 files (camera RAW: ...)` for each kind among unread files."""
    counts = Counter(path.suffix.lower() for path in paths)
    return [
        f"{count} {suffix} file{'s' * (count > 1)} ({_BY_SUFFIX[suffix]})"
        for suffix, count in sorted(counts.items())
    ]
