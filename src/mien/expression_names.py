"""Names that an expression may have: they become files, morph targets, columns and options."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from pathlib import Path

from mien.errors import InputError
from mien.limits import MAX_NAME_BYTES

_TEXTURES = frozenset({"atlas", "cylinder"})
"""Of the neutral face."""
_DEVICES = frozenset(
    ("con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10)))
)
_FORBIDDEN = '/\\:*?"<>|'


def is_plain_name(name: str) -> bool:
    """Whether it can be one component of a path, on any system and in an archive."""
    return bool(
        name and not name.startswith(".") and name.isprintable() and not set(name) & set(_FORBIDDEN)
    )


def check_expression_folders(folders: Iterable[Path]) -> None:
    r"""Refuse folders whose names cannot be those of expressions.

    A name can be a file's on every system: no control characters, none of / \ : * ? " < > |, no dot
    or space at either end, no device of Windows', MAX_NAME_BYTES at most. It is not a texture's of
    the neutral face, and differs from every other name in more than case and accents.

    Raises:
        InputError: names the folder.
    """
    taken: dict[str, Path] = {}
    for folder in sorted(folders):
        problem = name_problem(folder.name)
        if problem:
            raise InputError(_shown(folder), "the name of an expression", problem)
        other = taken.setdefault(_key(folder.name), folder)
        if other is not folder:
            expected = f"another name than that of {_shown(Path(other.name))}"
            raise InputError(_shown(folder), expected, "the same but for case or accents")


def name_problem(name: str) -> str:
    """Why a name cannot be an expression's; "" if it can."""
    odd = [mark for mark in name if mark in _FORBIDDEN or not mark.isprintable()]
    if odd:
        return f"{odd[0]!a} in it"
    if name != name.strip(". "):
        return f"a dot or a space at its {'end' if name[0] not in '. ' else 'beginning'}"
    if len(name.encode()) > MAX_NAME_BYTES:
        return f"{len(name.encode())} bytes, of which {MAX_NAME_BYTES} are the most"
    if name.split(".")[0].strip().lower() in _DEVICES:
        return "that of a device on Windows"
    return "that of a texture of the neutral face" if _key(name) in _TEXTURES else ""


def _key(name: str) -> str:
    """Equal for names that some file systems do not distinguish."""
    return unicodedata.normalize("NFC", name).casefold()


def _shown(path: Path) -> str:
    """The path, bytes that are not UTF-8 escaped."""
    return str(path).encode(errors="surrogateescape").decode(errors="backslashreplace")
