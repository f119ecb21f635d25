"""Which files of a folder mien wrote: a folder that is replaced keeps all others.

`.mien-files.json` in every folder that mien writes as a whole lists its files with size and
checksum. A file that is not in the list, or is not as it was written, is the user's.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from typing import Any

from mien.errors import MienError
from mien.reading.strict_json import DocumentFormat, read_json

MANIFEST = ".mien-files.json"
KEPT = "kept"
"""Where files go that somebody changed, or whose name the new folder needs."""

_FORMAT = DocumentFormat("mien files", 1)


Snapshot = frozenset[tuple[str, int, int, int]]
"""The files of a folder at one time: path within it, inode, size and time of change."""


@dataclass(frozen=True)
class Manifest:
    """The files of a folder as mien wrote them.

    Attributes:
        files: size in bytes and SHA-256, by path within the folder, with forward slashes.
    """

    files: dict[str, tuple[int, str]]

    def describes(self, folder: Path, name: str) -> bool:
        """Whether a file is still as it was written; False when in doubt."""
        size, digest = self.files.get(name, (-1, ""))
        with suppress(OSError):
            path = folder / name
            return path.stat().st_size == size and _digest(path) == digest
        return False


def save_manifest(folder: Path) -> None:
    """List all files of a folder that mien has just written."""
    files = {name: [(folder / name).stat().st_size, _digest(folder / name)] for name in _in(folder)}
    data = _FORMAT.header | {"files": files}
    text = json.dumps(data, indent=0, sort_keys=True)
    (folder / MANIFEST).write_text(text + "\n", encoding="utf-8")


def load_manifest(folder: Path) -> Manifest | None:
    """None where there is none, or none that can be read: then no file counts as mien's."""
    try:
        data = read_json(folder / MANIFEST)
        files = {str(name): (int(size), str(digest)) for name, (size, digest) in _files(data)}
    except (MienError, TypeError, ValueError):
        return None
    return Manifest(files)


def user_files(folder: Path) -> list[str]:
    """Files in a folder that mien did not write, or not as they are now, in order of their names.

    Without a manifest that is all of them.
    """
    manifest = load_manifest(folder) or Manifest({})
    return [name for name in _in(folder) if not manifest.describes(folder, name)]


def keep_user_files(old: Path, new: Path, *, editable: Collection[str] = ()) -> Snapshot:
    """Bring the user's files from a folder into the one that will replace it.

    Files that mien did not write keep their places, and so do empty folders; files that it wrote
    and somebody changed, or whose names the new folder has taken, go to `kept/`.

    Args:
        old: may be missing.
        new: with its manifest written.
        editable: paths that people are meant to change: theirs stay, in the place of mien's.

    Returns:
        what was in the old folder, for keep_late_files.
    """
    if not old.exists():
        return frozenset()
    before = _snapshot(old)
    known = (load_manifest(old) or Manifest({})).files
    # Files that mien never wrote come first, so that they keep their places, in `kept/`, too.
    for name in sorted(user_files(old), key=known.__contains__):
        _bring(old, new, name, changed=name in known, replaces=name in editable)
    _keep_empty_folders(old, new)
    return before


def keep_late_files(old: Path, new: Path, before: Snapshot) -> None:
    """Bring what came into a folder, or changed there, while its user's files were brought.

    Args:
        old: moved aside.
        new: in its place.
        before: as keep_user_files returned it.
    """
    late = {name for name, *_ in _snapshot(old) - before}
    for name in late.intersection(user_files(old)) if late else ():
        _bring(old, new, name)


def _bring(
    old: Path, new: Path, name: str, *, changed: bool = False, replaces: bool = False
) -> None:
    """Link a file of the old folder into the new one.

    Args:
        old: the old folder.
        new: the new folder.
        name: of the file.
        changed: mien wrote it, and somebody changed it.
        replaces: it takes the place of mien's.
    """
    place = new / name
    if replaces:
        place.unlink(missing_ok=True)
    elif changed or not _is_free(new, name):
        place = _kept_place(new, name)
    place.parent.mkdir(parents=True, exist_ok=True)
    _link(old / name, place)


def _keep_empty_folders(old: Path, new: Path) -> None:
    for top, folders, names in os.walk(old):
        name = Path(top).relative_to(old).as_posix()
        if not (folders or names) and _is_free(new, name):
            (new / name).mkdir(parents=True)


def _is_free(folder: Path, name: str) -> bool:
    return not (_is_blocked(folder, name) or os.path.lexists(folder / name))


def _is_blocked(folder: Path, name: str) -> bool:
    """Whether something else has the name of a folder that a file is to lie in."""
    above = [folder / part for part in Path(name).parents][:-1]
    return any(os.path.lexists(path) and not _is_folder(path) for path in above)


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _kept_place(new: Path, name: str) -> Path:
    """A free one in `kept/`, in `kept-2/` where that is no folder or holds none of this name."""
    folder, number = KEPT, 2
    while _is_blocked(new, f"{folder}/{name}"):
        folder, number = f"{KEPT}-{number}", number + 1
    return _free(new / folder / name)


def kept_notes(folder: Path) -> tuple[str, ...]:
    """A note on the user's files in a folder, if there are any."""
    names = user_files(folder)
    if not names:
        return ()
    more = ", ..." if len(names) > 5 else ""
    return (f"{folder}: kept, as mien did not write it: {', '.join(names[:5])}{more}",)


def _files(data: dict[str, Any]) -> list[tuple[str, Any]]:
    if data.get("format") != _FORMAT.name or not isinstance(data.get("files"), dict):
        raise ValueError
    return list(data["files"].items())


def _in(folder: Path) -> Iterator[str]:
    """Files and links below a folder but its manifest."""
    for top, folders, names in os.walk(folder, onerror=_raised):
        folders.sort()
        links = [name for name in folders if os.path.islink(os.path.join(top, name))]
        for name in sorted([*names, *links]):
            path = Path(top, name).relative_to(folder).as_posix()
            if path != MANIFEST:
                yield path


def _snapshot(folder: Path) -> Snapshot:
    found = ((name, (folder / name).lstat()) for name in _in(folder))
    return frozenset((name, info.st_ino, info.st_size, info.st_mtime_ns) for name, info in found)


def _raised(error: OSError) -> None:
    """A folder that cannot be listed must not count as empty."""
    raise error


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


def _free(path: Path) -> Path:
    """The path, or with a number where there is one already."""
    number, found = 2, path
    while os.path.lexists(found):
        found = path.with_name(f"{path.stem}-{number}{path.suffix}")
        number += 1
    return found


def _link(source: Path, place: Path) -> None:
    """The same file under another name; a copy where the file system has no links."""
    try:
        os.link(source, place, follow_symlinks=False)
    except (OSError, NotImplementedError):
        shutil.copy2(source, place, follow_symlinks=False)
