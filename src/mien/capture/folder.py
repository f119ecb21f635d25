"""The photos of a folder, by expression, and the files that are not used."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mien.capture.images.opening import is_image
from mien.capture.images.photos import PHOTO_SUFFIXES
from mien.capture.images.unsupported import count_by_kind, is_unsupported
from mien.capture.source_kind import VIDEO_SUFFIXES, kind_of_source, made_by_mien
from mien.errors import InputError, escaped
from mien.expression_names import check_expression_folders
from mien.head import NEUTRAL
from mien.reading.names import list_folder, portable_name

ANNOTATIONS = "annotations"
_DOCUMENTS = frozenset({"COPYING", "CREDITS", "LICENCE", "LICENSE", "NOTICE", "README"})
"""Files that often lie beside photos: no note is made of them."""


def photo_files(source: Path) -> dict[str, list[Path]]:
    """Photos by expression, `neutral` first, each in natural order.

    Raises:
        InputError: as kind_of_source; a folder without photos: names what it holds.
    """
    if kind_of_source(source) != "folder":
        return {NEUTRAL: [source]}
    photos = _photos_in(source)
    if photos:
        return {NEUTRAL: photos}
    check_expression_folders(folder for folder in _subfolders(source) if _photos_in(folder))
    folders = {_expression(folder): _photos_in(folder) for folder in _subfolders(source)}
    folders = {name: paths for name, paths in folders.items() if paths}
    if not folders:
        expected = "photos in this folder or in folders within (JPEG, PNG, TIFF, WebP, HEIC, ...)"
        raise InputError(source, expected, "; ".join(_other_content(source)) or "none")
    return dict(sorted(folders.items(), key=lambda item: item[0] != NEUTRAL))


def _expression(folder: Path) -> str:
    """A folder's name; `Neutral` becomes `neutral`."""
    return NEUTRAL if folder.name.lower() == NEUTRAL else portable_name(folder)


def ignored_files(source: Path) -> list[str]:
    """Notes on files and folders that are not used as photos; hidden ones need none."""
    if not source.is_dir():
        return []
    flat = bool(_photos_in(source))
    folders = [source] if flat else [source, *_subfolders(source)]
    there = [path for folder in folders for path in _files_in(folder)]
    notes = [f"{source.name}: not read: {what}" for what in [*_unread(there), *_made(source)]]
    ignored = [path for path in there if _is_stray(path)]
    if flat:
        ignored += [folder for folder in _subfolders(source) if _photos_in(folder)]
    if ignored:
        shown = ", ".join(escaped(str(path.relative_to(source))) for path in ignored[:5])
        more = ", ..." if len(ignored) > 5 else ""
        notes.append(f"not used, as they are no photos or lie beside photos: {shown}{more}")
    return notes


def orphaned_annotations(photos: Sequence[Path]) -> list[str]:
    """A note on annotations whose photo is not there: most often it was renamed."""
    folder = photos[0].parent / ANNOTATIONS
    if not folder.is_dir():
        return []
    stems = {path.stem for path in list_folder(photos[0].parent)}
    return [
        f"{ANNOTATIONS}/{escaped(path.name)}: there is no photo of that name"
        for path in list_folder(folder)
        if path.suffix == ".json" and path.stem not in stems
    ]


def _other_content(source: Path) -> list[str]:
    """What lies in a folder without photos, in it or one level down."""
    folders = _subfolders(source)
    there = [path for folder in (source, *folders) for path in _files_in(folder)]
    found = [*_unread(there), *_made(source)]
    deeper = [within for folder in folders for within in _subfolders(folder) if _photos_in(within)]
    if deeper:
        within = deeper[0].relative_to(source)
        found.append(f"photos one level deeper, as in {within}: give the folder {within.parent}")
    strays = [path for path in there if _is_stray(path)]
    if strays:
        count = f"{len(strays)} other file{'s' * (len(strays) > 1)}"
        found.append(f"{count}, as {strays[0].relative_to(source)}")
    return found


def _unread(there: Sequence[Path]) -> list[str]:
    """The pictures and clips among these files that are not read, by kind."""
    clips = [path for path in there if _is_clip(path)]
    found = count_by_kind(path for path in there if is_unsupported(path))
    if clips:
        count = f"{len(clips)} video{'s' * (len(clips) > 1)}"
        found.append(f"{count}, as {clips[0].name} (give a video itself as the source)")
    return found


def _made(source: Path) -> list[str]:
    made = [(folder.name, made_by_mien(folder)) for folder in _folders_in(source)]
    return [f"{name}, {kind} that mien made" for name, kind in made if kind]


def _photos_in(folder: Path) -> list[Path]:
    return [path for path in _files_in(folder) if _is_photo(path)]


def _files_in(folder: Path) -> list[Path]:
    """All but folders; also pipes and devices, so that one with a photo's name is refused."""
    return [path for path in list_folder(folder) if not path.is_dir()]


def _subfolders(folder: Path) -> list[Path]:
    """Those that may hold photos."""
    folders = _folders_in(folder)
    return [path for path in folders if path.name != ANNOTATIONS and not made_by_mien(path)]


def _folders_in(folder: Path) -> list[Path]:
    return [path for path in list_folder(folder) if path.is_dir()]


def _is_stray(path: Path) -> bool:
    known = _is_photo(path) or _is_clip(path) or is_unsupported(path)
    return not known and path.stem.upper() not in _DOCUMENTS


def _is_clip(path: Path) -> bool:
    return path.suffix.lower() in VIDEO_SUFFIXES


def _is_photo(path: Path) -> bool:
    """By its ending; without one, by its content."""
    if not path.suffix:
        return path.is_file() and path.name not in _DOCUMENTS and is_image(path)
    return path.suffix.lower() in PHOTO_SUFFIXES
