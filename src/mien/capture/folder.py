"""Which files of a folder are photos, of which expression, and which are not used."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mien.capture.files import listed, plain_name
from mien.capture.photos import PHOTO_SUFFIXES
from mien.errors import InputError, escaped

NEUTRAL = "neutral"
ANNOTATIONS = "annotations"
_DOCUMENTS = frozenset({"COPYING", "CREDITS", "LICENCE", "LICENSE", "NOTICE", "README"})
"""Files that often lie beside photos and that nobody takes for one."""


def photo_files(source: Path) -> dict[str, list[Path]]:
    """Photos by expression, `neutral` first, each in natural order."""
    if source.is_file():
        return {NEUTRAL: [source]}
    if not source.is_dir():
        raise InputError(source, "a photo, a video or a folder of photos", "nothing there")
    photos = _photos_in(source)
    if photos:
        return {NEUTRAL: photos}
    folders = {_expression(folder): _photos_in(folder) for folder in _subfolders(source)}
    folders = {name: paths for name, paths in folders.items() if paths}
    if not folders:
        raise InputError(source, "photos in this folder or in folders within", "none")
    return dict(sorted(folders.items(), key=lambda item: item[0] != NEUTRAL))


def _expression(folder: Path) -> str:
    """A folder's name; `Neutral` is `neutral`, as other stages look for that."""
    return NEUTRAL if folder.name.lower() == NEUTRAL else plain_name(folder)


def ignored_files(source: Path) -> list[str]:
    """A note on files and folders that hold no photos; hidden ones need none."""
    if not source.is_dir():
        return []
    flat = bool(_photos_in(source))
    folders = [source] if flat else [source, *_subfolders(source)]
    ignored = [path for folder in folders for path in listed(folder) if _is_stray(path)]
    if flat:
        ignored += [folder for folder in _subfolders(source) if _photos_in(folder)]
    if not ignored:
        return []
    shown = ", ".join(escaped(str(path.relative_to(source))) for path in ignored[:5])
    more = ", ..." if len(ignored) > 5 else ""
    return [f"not used, as they are no photos or lie beside photos: {shown}{more}"]


def orphaned_annotations(photos: Sequence[Path]) -> list[str]:
    """A note on annotations whose photo is not there: most often it was renamed."""
    folder = photos[0].parent / ANNOTATIONS
    if not folder.is_dir():
        return []
    stems = {path.stem for path in listed(photos[0].parent)}
    return [
        f"{ANNOTATIONS}/{escaped(path.name)}: there is no photo of that name"
        for path in listed(folder)
        if path.suffix == ".json" and path.stem not in stems
    ]


def _photos_in(folder: Path) -> list[Path]:
    return [path for path in listed(folder) if path.is_file() and _is_photo(path)]


def _subfolders(folder: Path) -> list[Path]:
    return [path for path in listed(folder) if path.is_dir() and path.name != ANNOTATIONS]


def _is_stray(path: Path) -> bool:
    return path.is_file() and not _is_photo(path) and path.stem.upper() not in _DOCUMENTS


def _is_photo(path: Path) -> bool:
    return path.suffix.lower() in PHOTO_SUFFIXES
